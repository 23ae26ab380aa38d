//! The recordings that a command gets: files, folders of files, and files that are parts of one
//! recording.

use std::fs::File;
use std::path::{Path, PathBuf};

use clap::Args;

use offbd_terminal::errors::InputError;
use offbd_wire::session_file::{self, JoinedRows, SessionRowError, SessionRows};
use offbd_wire::table::TableOptions;

/// Whether the files are one recording.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct JoinArgs {
    /// Take all files together as one recording, by their times; they must not overlap
    #[arg(long)]
    join: bool,
}

/// A recording in one file or several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// The name of its session.
    pub name: String,
    /// There is at least one.
    pub files: Vec<PathBuf>,
}

impl Recording {
    /// The recording in one file.
    #[must_use]
    pub fn of(file: &Path) -> Self {
        Self { name: session_name(file), files: vec![file.to_owned()] }
    }

    /// Opens its files.
    ///
    /// # Errors
    /// [`InputError`] of the file that cannot be read, or that overlaps with another one.
    pub fn open(&self, options: &TableOptions) -> Result<Box<dyn SessionRows>, InputError> {
        match &*self.files {
            [file] => open(file, options),
            files => {
                let part = |file: &PathBuf| Ok((file.display().to_string(), open(file, options)?));
                let parts = files.iter().map(part).collect::<Result<Vec<_>, InputError>>()?;
                Ok(Box::new(JoinedRows::new(parts)))
            }
        }
    }

    /// An error of its rows.
    pub(crate) fn error(&self, error: SessionRowError) -> InputError {
        match &*self.files {
            [file] => InputError::file(file, error),
            // It names the file.
            _ => InputError::new(self.words(), error),
        }
    }

    /// Its file, or what it consists of.
    #[must_use]
    pub fn words(&self) -> String {
        match &*self.files {
            [file] => file.display().to_string(),
            files => format!("{} ({} files)", self.name, files.len()),
        }
    }
}

impl JoinArgs {
    /// Returns the recordings in `paths`. A folder stands for the files in it, by their names.
    ///
    /// # Errors
    /// [`InputError`] of a folder that cannot be read or has no files.
    pub fn recordings(self, paths: &[PathBuf]) -> Result<Vec<Recording>, InputError> {
        let mut files = Vec::new();
        for path in paths {
            match path.is_dir() {
                true => files.append(&mut files_in(path)?),
                false => files.push(path.clone()),
            }
        }
        if self.join {
            let name = paths.first().map_or_else(String::new, |path| session_name(path));
            return Ok(vec![Recording { name, files }]);
        }
        Ok(files.iter().map(|file| Recording::of(file)).collect())
    }
}

/// The name of a session: that of its file.
pub fn session_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Opens the session file at `path`, whatever its format.
pub fn open(path: &Path, options: &TableOptions) -> Result<Box<dyn SessionRows>, InputError> {
    let file = File::open(path).map_err(|e| InputError::file(path, e))?;
    session_file::open(file, None, options).map_err(|e| InputError::file(path, e))
}

/// Returns the files in a folder, except hidden ones, by their names.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>, InputError> {
    let failed = |error: std::io::Error| InputError::file(folder, error);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let is_hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
        if !is_hidden && entry.path().is_file() {
            files.push(entry.path());
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(InputError::file(folder, "the folder has no files"));
    }
    Ok(files)
}
