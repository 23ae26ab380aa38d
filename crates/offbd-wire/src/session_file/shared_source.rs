//! A source that several readers share.

use std::io::{self, Read, Seek, SeekFrom};
use std::sync::{Arc, Mutex, PoisonError};

/// A source that several readers read at their own positions.
pub(super) struct SharedSource<S> {
    source: Arc<Mutex<S>>,
    n_bytes: u64,
}

impl<S> Clone for SharedSource<S> {
    fn clone(&self) -> Self {
        Self { source: self.source.clone(), n_bytes: self.n_bytes }
    }
}

impl<S> SharedSource<S> {
    pub(super) const fn n_bytes(&self) -> u64 {
        self.n_bytes
    }
}

impl<S: Read + Seek> SharedSource<S> {
    pub(super) fn new(mut source: S) -> io::Result<Self> {
        let n_bytes = source.seek(SeekFrom::End(0))?;
        Ok(Self { source: Arc::new(Mutex::new(source)), n_bytes })
    }

    /// Reads up to `n` bytes from `start` on; fewer only at the end of the source.
    pub(super) fn read_at(&self, start: u64, n: usize) -> io::Result<Vec<u8>> {
        let mut source = self.source.lock().unwrap_or_else(PoisonError::into_inner);
        let n = (n as u64).min(self.n_bytes.saturating_sub(start));
        source.seek(SeekFrom::Start(start))?;
        let mut bytes = Vec::with_capacity(usize::try_from(n).unwrap_or_default());
        source.by_ref().take(n).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// The source from the byte `at` on.
    pub(super) fn from(&self, at: u64) -> io::BufReader<SourceFrom<S>> {
        io::BufReader::new(SourceFrom { source: self.clone(), at })
    }
}

/// A source from a position on.
pub(super) struct SourceFrom<S> {
    source: SharedSource<S>,
    at: u64,
}

impl<S: Read + Seek> Read for SourceFrom<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.source.read_at(self.at, buffer.len())?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        self.at += bytes.len() as u64;
        Ok(bytes.len())
    }
}

impl<S> Seek for SourceFrom<S> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.source.n_bytes.checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
        Ok(self.at)
    }
}
