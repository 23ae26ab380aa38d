//! Output to stdout or a file, buffered. An error of a closed pipe can be told from other
//! errors.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use clap::builder::{PossibleValuesParser, TypedValueParser};

/// Whether remarks on stderr are left out: `--quiet`.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Leaves out the remarks of this process.
pub fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether remarks are left out.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Prints a remark to stderr, something that is neither a result nor an error; nothing with
/// `--quiet`.
pub fn remark(text: impl Display) {
    if !is_quiet() {
        anstream::eprintln!("{text}");
    }
}

/// How a command prints its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum OutputFormat {
    /// A table for people.
    Table,
    /// One JSON object per line, for programs.
    Json,
}

/// Opens stdout for the path `-`, else a new file.
pub fn create(path: &Path) -> anyhow::Result<Box<dyn Write>> {
    if path == Path::new("-") {
        return Ok(Box::new(stdout()));
    }
    let file = File::create(path).with_context(|| path.display().to_string())?;
    Ok(Box::new(BufWriter::new(file)))
}

/// A file that appears at its path only once it is complete and durable. Until then it has a
/// temporary name beside it, and it is removed if it is dropped.
pub struct NewFile {
    file: BufWriter<File>,
    path: PathBuf,
    temporary: PathBuf,
}

impl NewFile {
    /// Creates the temporary file for `path`.
    pub fn create(path: &Path) -> anyhow::Result<Self> {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}.partial", std::process::id()));
        let temporary = path.with_file_name(name);
        let file = File::create(&temporary).with_context(|| temporary.display().to_string())?;
        Ok(Self { file: BufWriter::new(file), path: path.to_owned(), temporary })
    }

    /// Gives the complete file its name.
    pub fn keep(mut self) -> anyhow::Result<()> {
        let named = |path: &Path| path.display().to_string();
        self.file.flush().with_context(|| named(&self.temporary))?;
        self.file.get_ref().sync_all().with_context(|| named(&self.temporary))?;
        std::fs::rename(&self.temporary, &self.path).with_context(|| named(&self.path))?;
        // The name is durable once the directory is; not every system can open one.
        let directory = self.path.parent().filter(|p| !p.as_os_str().is_empty());
        if let Ok(directory) = File::open(directory.unwrap_or(Path::new("."))) {
            let _ = directory.sync_all();
        }
        Ok(())
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for NewFile {
    fn drop(&mut self) {
        // Not there any more once it is kept.
        let _ = std::fs::remove_file(&self.temporary);
    }
}

/// Stdout with a buffer that is not flushed at line ends.
pub fn stdout() -> BufWriter<io::StdoutLock<'static>> {
    BufWriter::new(io::stdout().lock())
}

/// Writes one line of text to stdout.
pub fn print_line(text: &str) -> anyhow::Result<()> {
    let mut out = stdout();
    writeln!(out, "{text}")?;
    Ok(out.flush()?)
}

/// Writes `value` as one line of JSON to stdout.
pub fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print_line(&serde_json::to_string(value)?)
}

/// Returns whether `error` means that the reader of the output has closed it.
pub fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        let io = cause.downcast_ref::<io::Error>().map(io::Error::kind);
        let json =
            cause.downcast_ref::<serde_json::Error>().and_then(serde_json::Error::io_error_kind);
        io.or(json) == Some(io::ErrorKind::BrokenPipe)
    })
}

/// A parser of arguments with a fixed set of values, which help and errors then list.
pub fn value_parser<T>(
    words: impl IntoIterator<Item = &'static str>,
) -> impl TypedValueParser<Value = T>
where
    T: std::str::FromStr<Err = offbd_core::vocabulary::UnknownWord> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(words).try_map(|word| word.parse::<T>())
}
