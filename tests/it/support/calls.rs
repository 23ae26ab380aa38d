//! Calls of a process to the operating system: counted, made to fail and recorded by a
//! library that is preloaded, see `calls.c`.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A kind of calls, in the order of `enum kind` in `calls.c`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallKind {
    Open,
    Read,
    Write,
    Sync,
    Truncate,
    Unlink,
    Rename,
    Map,
    Allocate,
    Thread,
}

pub const CALL_KINDS: [CallKind; 10] = {
    use CallKind::*;
    [Open, Read, Write, Sync, Truncate, Unlink, Rename, Map, Allocate, Thread]
};

/// Calls on files of the store.
pub const FILE_CALLS: &[CallKind] = CALL_KINDS.split_at(8).0;

/// How a call fails: with EIO, with ENOSPC, or with EIO after half of the data is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallError {
    Io,
    NoSpace,
    Torn,
}

/// The one call of a process that fails.
#[derive(Clone, Copy, Debug)]
pub struct CallFault {
    pub kind: CallKind,
    /// Counted from 1.
    pub number: u64,
    pub error: CallError,
}

/// Words of `struct control` before the counts.
const N_FAILED: u64 = 5;
const COUNTS: u64 = 6;
const WORDS: u64 = COUNTS + CALL_KINDS.len() as u64;

/// Compiles a C file of `tests/it/support/` as a library to preload.
pub fn preloaded(name: &str, directory: &Path) -> PathBuf {
    let library = directory.join(format!("{name}.so"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/it/support/{name}.c"));
    let made = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"])
        .args([&library, &source])
        .args(["-ldl"])
        .status();
    assert!(made.expect("a C compiler as `cc`").success());
    library
}

/// A disk and a clock that fail for one process, see `faulty.c`.
pub struct FaultySystem {
    library: PathBuf,
    fault: PathBuf,
}

impl FaultySystem {
    /// Keeps its own files in `folder`.
    pub fn new(folder: &Path) -> Self {
        Self { library: preloaded("faulty", folder), fault: folder.join("faults") }
    }

    /// Returns the environment variables of the process.
    pub fn environment(&self) -> [(&'static str, &Path); 2] {
        [("LD_PRELOAD", &self.library), ("FAULTS", &self.fault)]
    }

    /// Lets `fault` happen from now on.
    pub fn set(&self, fault: &str) {
        std::fs::write(&self.fault, fault).unwrap();
    }

    /// Lets nothing fail any more.
    pub fn clear(&self) {
        std::fs::remove_file(&self.fault).unwrap();
    }
}

/// The calls of a process on the files in a folder, and its allocations and threads.
pub struct CallControl {
    library: PathBuf,
    folder: PathBuf,
    file: PathBuf,
    record: Option<PathBuf>,
    words: File,
}

impl CallControl {
    /// Watches calls on files in `folder`, by means of the new file `file` elsewhere.
    pub fn new(library: &Path, folder: &Path, file: &Path) -> Self {
        let words = File::create_new(file).unwrap();
        words.set_len(WORDS * 8).unwrap();
        let words = File::options().read(true).write(true).open(file).unwrap();
        let (library, folder, file) = (library.to_owned(), folder.to_owned(), file.to_owned());
        Self { library, folder, file, record: None, words }
    }

    /// Appends what is done to files, and what is sent, to a file.
    pub fn record_to(self, file: &Path) -> Self {
        Self { record: Some(file.to_owned()), ..self }
    }

    /// Returns the environment variables of a process whose calls are watched.
    pub fn environment(&self) -> Vec<(&'static str, &Path)> {
        let mut variables = vec![
            ("LD_PRELOAD", self.library.as_path()),
            ("STORE_FOLDER", self.folder.as_path()),
            ("CALL_CONTROL", self.file.as_path()),
        ];
        variables.extend(self.record.as_deref().map(|record| ("CALL_RECORD", record)));
        variables
    }

    fn set(&self, word: u64, value: u64) {
        self.words.write_all_at(&value.to_ne_bytes(), word * 8).unwrap();
    }

    fn get(&self, word: u64) -> u64 {
        let mut bytes = [0; 8];
        self.words.read_exact_at(&mut bytes, word * 8).unwrap();
        u64::from_ne_bytes(bytes)
    }

    /// Counts from zero from now on, allocations of `large` bytes and more, and makes a call
    /// fail, or none.
    pub fn begin(&self, fault: Option<CallFault>, large: u64) {
        self.set(1, 0);
        (N_FAILED..WORDS).for_each(|word| self.set(word, 0));
        self.set(4, large);
        let Some(CallFault { kind, number, error }) = fault else { return };
        self.set(0, kind as u64);
        // EIO is 5, ENOSPC is 28.
        self.set(2, if error == CallError::NoSpace { 28 } else { 5 });
        self.set(3, u64::from(error == CallError::Torn));
        self.set(1, number);
    }

    /// Returns how many calls of a kind there were since [`Self::begin`].
    pub fn count(&self, kind: CallKind) -> u64 {
        self.get(COUNTS + kind as u64)
    }

    /// Returns whether the call that should fail was made.
    pub fn has_failed(&self) -> bool {
        self.get(N_FAILED) > 0
    }
}

/// Something that was done to a file, or sent to a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Operation {
    Create,
    Write(usize, Vec<u8>),
    Resize(usize),
    Sync,
    FailedSync,
    Unlink,
    Rename(String),
    Send(Vec<u8>),
}

/// An operation and the path of its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallRecord {
    pub path: String,
    pub operation: Operation,
}

/// Reads what `calls.c` has recorded; returns `None` if the last record is incomplete, because the
/// process was killed while it was written.
pub fn read_records(file: &Path) -> Option<Vec<CallRecord>> {
    let recorded = std::fs::read(file).unwrap();
    let (mut rest, mut records) = (recorded.as_slice(), Vec::new());
    while !rest.is_empty() {
        let mut number = || {
            let bytes = rest.split_off(..8)?;
            usize::try_from(u64::from_ne_bytes(bytes.try_into().unwrap())).ok()
        };
        let [kind, path, data, number] = [number()?, number()?, number()?, number()?];
        let path = String::from_utf8(rest.split_off(..path)?.to_vec()).unwrap();
        let data = rest.split_off(..data)?.to_vec();
        let operation = match u8::try_from(kind).unwrap() {
            b'c' => Operation::Create,
            b'w' => Operation::Write(number, data),
            b't' => Operation::Resize(number),
            b's' => Operation::Sync,
            b'x' => Operation::FailedSync,
            b'u' => Operation::Unlink,
            b'r' => Operation::Rename(String::from_utf8(data).unwrap()),
            b'a' => Operation::Send(data),
            kind => panic!("unknown kind {kind}"),
        };
        records.push(CallRecord { path, operation });
    }
    Some(records)
}
