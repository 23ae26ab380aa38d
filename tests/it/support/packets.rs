//! Packets that the kernel loses on their way to a process, through a library that is preloaded,
//! see `packets.c`.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use super::calls::preloaded;
use super::eventually;

/// The ports whose packets may all be lost.
const MAX_PORTS: usize = 4;

/// Words of `struct control`.
const PERCENT: usize = 0;
const PORTS: usize = 1;
const N_CHANGED: usize = PORTS + MAX_PORTS;
const N_APPLIED: usize = N_CHANGED + 1;
const N_REPEATED: usize = N_APPLIED + 1;
const N_REPEATED_BY_OPEN: usize = N_REPEATED + 1;
const WORDS: usize = N_REPEATED_BY_OPEN + 1;

/// What a process loses of what is sent to its TCP sockets. A process that takes the place of
/// another one loses the same.
pub struct PacketLoss {
    library: PathBuf,
    file: PathBuf,
    words: File,
}

impl PacketLoss {
    /// One for each of `n` processes; nothing is lost yet. Keeps files in `folder`.
    pub fn of_processes(n: usize, folder: &Path) -> Vec<Self> {
        let library = preloaded("packets", folder);
        (0..n).map(|i| Self::new(library.clone(), folder.join(format!("packets-{i}")))).collect()
    }

    fn new(library: PathBuf, file: PathBuf) -> Self {
        let words = File::options().read(true).write(true).create_new(true).open(&file).unwrap();
        words.set_len((WORDS * 8) as u64).unwrap();
        Self { library, file, words }
    }

    /// Returns the environment variables of the process.
    pub fn environment(&self) -> Vec<(&'static str, String)> {
        let text = |path: &Path| path.to_str().unwrap().to_owned();
        vec![("LD_PRELOAD", text(&self.library)), ("PACKET_CONTROL", text(&self.file))]
    }

    fn write(&self, word: usize, value: u64) {
        self.words.write_all_at(&value.to_ne_bytes(), (word * 8) as u64).unwrap();
    }

    fn read(&self, word: usize) -> u64 {
        let mut bytes = [0; 8];
        self.words.read_exact_at(&mut bytes, (word * 8) as u64).unwrap();
        u64::from_ne_bytes(bytes)
    }

    /// Loses so many of 100 segments by chance. For a process that starts later.
    pub fn begin_with(&self, percent: u64) {
        self.write(PERCENT, percent);
    }

    /// Loses all segments from and to these ports, once this returns; those of no others.
    pub async fn cut(&self, ports: &[u16]) {
        assert!(ports.len() <= MAX_PORTS);
        for i in 0..MAX_PORTS {
            self.write(PORTS + i, ports.get(i).copied().map_or(0, u64::from));
        }
        self.apply().await;
    }

    /// Loses nothing any more. Returns how many segments the process, and those before it, had
    /// to send again: on sockets that were closed, and on those that are open.
    pub async fn end(&self) -> u64 {
        self.write(PERCENT, 0);
        self.cut(&[]).await;
        self.read(N_REPEATED) + self.read(N_REPEATED_BY_OPEN)
    }

    /// Waits until all sockets lose what they should.
    async fn apply(&self) {
        let n = self.read(N_CHANGED) + 1;
        self.write(N_CHANGED, n);
        eventually(async || (self.read(N_APPLIED) == n).then_some(())).await;
    }
}
