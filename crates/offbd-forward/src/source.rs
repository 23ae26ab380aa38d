//! The lines of the standard input, until it ends or the agent is told to stop.

use std::io::{self, ErrorKind};

use tokio::fs::File;
use tokio::io::AsyncReadExt;
#[cfg(unix)]
use tokio::net::unix::pipe;

use super::stop::Stop;

/// Longest line, bytes; a longer one ends the source with an error.
const MAX_LINE_BYTES: usize = 1 << 20;
/// Most bytes that are read after the agent was told to stop. Chosen: what the pipe of a writer
/// holds at most, unless an administrator has allowed more.
const MAX_LAST_BYTES: usize = 1 << 20;
/// Bytes that are read at a time.
const PART_BYTES: usize = 8 << 10;

/// The lines of the standard input. When the agent is told to stop, they end with the last whole
/// line that was written to a pipe before.
#[derive(Debug)]
pub struct Lines {
    source: Source,
    stop: Stop,
    /// What was read of lines that were not returned yet.
    read: Vec<u8>,
    /// Whether the source has ended, or failed.
    is_over: bool,
    /// Bytes that may still be read after the agent was told to stop.
    last_bytes: usize,
}

#[derive(Debug)]
enum Source {
    #[cfg(unix)]
    Pipe(pipe::Receiver),
    /// A file or a terminal.
    Other(File),
}

impl Lines {
    /// # Errors
    /// If the process has no standard input.
    pub(super) fn of_stdin(stop: Stop) -> io::Result<Self> {
        let source = Source::stdin()?;
        Ok(Self { source, stop, read: Vec::new(), is_over: false, last_bytes: MAX_LAST_BYTES })
    }

    pub(super) fn stop(&self) -> Stop {
        self.stop.clone()
    }

    /// Returns the next line, with its end; `None` after the last one. Nothing is lost if the
    /// future is dropped before it is ready.
    pub(super) async fn next(&mut self) -> Option<Vec<u8>> {
        loop {
            if let Some(end) = self.read.iter().position(|byte| *byte == b'\n') {
                return Some(self.read.drain(..=end).collect());
            }
            if self.is_over {
                return self.rest();
            }
            if self.read.len() >= MAX_LINE_BYTES {
                tracing::error!(
                    "a line is longer than {MAX_LINE_BYTES} bytes; the rest is not read"
                );
                self.read.clear();
                self.is_over = true;
                return None;
            }
            let n = if self.stop.is_told() {
                self.source.read_now(&mut self.read, self.last_bytes)
            } else {
                tokio::select! {
                    biased;
                    () = self.stop.told() => continue,
                    n = self.source.read(&mut self.read) => n,
                }
            };
            match n {
                Ok(0) => self.is_over = true,
                Ok(n) if self.stop.is_told() => self.last_bytes = self.last_bytes.saturating_sub(n),
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    if !self.read.is_empty() {
                        tracing::warn!("a line is not complete, and is not recorded");
                    }
                    return None;
                }
                Err(error) => {
                    tracing::error!(%error, "the source cannot be read");
                    self.is_over = true;
                }
            }
        }
    }

    /// The last line, which has no end.
    fn rest(&mut self) -> Option<Vec<u8>> {
        let mut rest = std::mem::take(&mut self.read);
        if rest.is_empty() {
            return None;
        }
        rest.push(b'\n');
        Some(rest)
    }
}

impl Source {
    #[cfg(unix)]
    fn stdin() -> io::Result<Self> {
        use std::os::fd::AsFd;
        let descriptor = || io::stdin().as_fd().try_clone_to_owned();
        Ok(match pipe::Receiver::from_owned_fd(descriptor()?) {
            Ok(pipe) => Self::Pipe(pipe),
            Err(_) => Self::Other(File::from_std(descriptor()?.into())),
        })
    }

    #[cfg(windows)]
    fn stdin() -> io::Result<Self> {
        use std::os::windows::io::AsHandle;
        let handle = io::stdin().as_handle().try_clone_to_owned()?;
        Ok(Self::Other(File::from_std(handle.into())))
    }

    /// Waits for bytes and adds some of them to `to`; returns their number, 0 at the end.
    async fn read(&mut self, to: &mut Vec<u8>) -> io::Result<usize> {
        match self {
            #[cfg(unix)]
            Self::Pipe(pipe) => loop {
                pipe.readable().await?;
                match read_part(pipe, to, PART_BYTES) {
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                    read => return read,
                }
            },
            Self::Other(file) => {
                let mut part = [0; PART_BYTES];
                let n = file.read(&mut part).await?;
                to.extend_from_slice(&part[..n]);
                Ok(n)
            }
        }
    }

    /// As [`Self::read`], but does not wait: [`ErrorKind::WouldBlock`] if nothing is there, or more
    /// than `limit` bytes would be read. What is not read of a file stays in it.
    fn read_now(&mut self, to: &mut Vec<u8>, limit: usize) -> io::Result<usize> {
        match self {
            #[cfg(unix)]
            Self::Pipe(pipe) if limit > 0 => read_part(pipe, to, limit.min(PART_BYTES)),
            _ => Err(ErrorKind::WouldBlock.into()),
        }
    }
}

#[cfg(unix)]
fn read_part(pipe: &pipe::Receiver, to: &mut Vec<u8>, limit: usize) -> io::Result<usize> {
    let mut part = [0; PART_BYTES];
    let n = pipe.try_read(&mut part[..limit])?;
    to.extend_from_slice(&part[..n]);
    Ok(n)
}
