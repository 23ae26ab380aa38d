//! The directory of cold data.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use data_encoding::HEXLOWER;
use sha2::{Digest, Sha256};

use super::ColdFileRow;
use crate::file::private_file;
use offbd_core::vocabulary::Sample;

/// Bytes of a file that are read at a time for its checksum.
const BYTES_AT_ONCE: usize = 64 << 10;

/// The end of the name of a file that is not complete.
const PART: &str = ".part";

/// The samples of a file; an error says in words what is wrong with it.
pub type SampleStream = Box<dyn Iterator<Item = Result<Sample, String>> + Send>;

/// Reads a file as samples.
pub type ReadSamples = fn(File) -> Result<SampleStream, String>;

/// The directory of cold data, and how its files are read. Paths are relative to it.
#[derive(Clone, Debug)]
pub struct ColdDirectory {
    root: Arc<Path>,
    read: ReadSamples,
}

impl ColdDirectory {
    #[must_use]
    pub fn new(root: &Path, read: ReadSamples) -> Self {
        Self { root: root.into(), read }
    }

    /// The directory itself.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Returns the size and the checksum of the file `path`.
    ///
    /// # Errors
    /// The system's, if it cannot be read.
    pub fn measure(&self, path: &str) -> io::Result<(i64, String)> {
        let mut file = File::open(self.root.join(path))?;
        let (mut digest, mut n_bytes) = (Sha256::new(), 0);
        let mut buffer = vec![0; BYTES_AT_ONCE];
        loop {
            match file.read(&mut buffer) {
                Ok(0) => return Ok((n_bytes, HEXLOWER.encode(&digest.finalize()))),
                Ok(n) => {
                    digest.update(&buffer[..n]);
                    n_bytes += i64::try_from(n).unwrap_or_default();
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Returns the samples of the file `path`.
    ///
    /// # Errors
    /// In words, if it cannot be read.
    pub fn samples(&self, path: &str) -> Result<SampleStream, String> {
        let file = File::open(self.root.join(path)).map_err(|error| error.to_string())?;
        (self.read)(file)
    }

    /// Compares size and checksum of the file of `row` with those that are recorded.
    ///
    /// # Errors
    /// In words, if it is missing, damaged or cannot be read.
    pub fn compare(&self, row: &ColdFileRow) -> Result<(), String> {
        let measured = self.measure(&row.path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => "is missing".to_owned(),
            _ => format!("cannot be read: {error}"),
        })?;
        match measured == (row.bytes, row.checksum.clone()) {
            true => Ok(()),
            false => Err("is damaged: its checksum is wrong".to_owned()),
        }
    }

    /// Returns the samples of the file of `row` after comparing its size and its checksum.
    pub(super) fn open(&self, row: &ColdFileRow) -> Result<SampleStream, String> {
        self.compare(row)?;
        self.samples(&row.path).map_err(|error| format!("cannot be read: {error}"))
    }

    /// Writes the file `path` by `fill`, under another name until it is on the disk. An
    /// existing one is replaced.
    ///
    /// # Errors
    /// Those of `fill`, and the system's.
    pub fn write<E: From<io::Error>>(
        &self,
        path: &str,
        fill: impl FnOnce(&mut File) -> Result<(), E>,
    ) -> Result<(), E> {
        self.check()?;
        let (file, part) = (self.root.join(path), self.part(path));
        std::fs::create_dir_all(part.parent().unwrap_or(&self.root))?;
        let mut written = private_file().create(true).truncate(true).open(&part)?;
        fill(&mut written)?;
        written.sync_all()?;
        drop(written);
        std::fs::rename(&part, &file)?;
        // The directories may be new as well.
        for directory in file.ancestors().skip(1) {
            File::open(directory)?.sync_all()?;
            if directory == &*self.root {
                break;
            }
        }
        Ok(())
    }

    /// Removes the file `path` and what an interrupted attempt to write it has left.
    ///
    /// # Errors
    /// The system's; it is no error if there is nothing.
    pub fn remove(&self, path: &str) -> io::Result<()> {
        self.check()?;
        for file in [self.part(path), self.root.join(path)] {
            match std::fs::remove_file(file) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }

    fn part(&self, path: &str) -> PathBuf {
        self.root.join(format!("{path}{PART}"))
    }

    /// Checks that the directory exists. It is never created: it may be a file system that is
    /// not mounted.
    ///
    /// # Errors
    /// The system's.
    pub fn check(&self) -> io::Result<()> {
        std::fs::read_dir(&self.root).map(drop)
    }
}
