//! The recordings that a command gets: files, folders of files, and files that are parts of one
//! recording.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::judge::{open, session_name};
use offbd_core::vocabulary::Sample;
use offbd_terminal::errors::InputError;
use offbd_wire::session_file::{
    RejectedRow, RowPlace, SessionFileError, SessionRowError, SessionRows,
};
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
            files => Ok(Box::new(JoinedRows::open(files, options)?)),
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

/// A file of a joined recording, of which the rows up to its first sample are read.
struct Part {
    path: PathBuf,
    rows: Box<dyn SessionRows>,
    /// The rejected rows before its first sample, and the sample.
    first: std::vec::IntoIter<Result<Sample, SessionRowError>>,
    begins_s: f64,
    /// Latest time so far, s.
    ends_s: f64,
}

impl Part {
    fn open(path: &Path, options: &TableOptions) -> Result<Self, InputError> {
        let mut rows = open(path, options)?;
        let (mut first, mut begins_s) = (Vec::new(), f64::INFINITY);
        for row in rows.by_ref() {
            begins_s = row.as_ref().map_or(begins_s, |sample| sample.t_s);
            let is_rejected = matches!(row, Err(SessionRowError::Rejected(_)));
            first.push(row);
            if !is_rejected {
                break;
            }
        }
        let (path, first) = (path.to_owned(), first.into_iter());
        Ok(Self { path, rows, first, begins_s, ends_s: f64::NEG_INFINITY })
    }
}

/// The rows of several files, in the order of their times.
struct JoinedRows {
    /// The files that are not over, the present one last.
    parts: Vec<Part>,
    /// The end of the file before, s, and the file.
    before: Option<(f64, PathBuf)>,
}

impl JoinedRows {
    fn open(files: &[PathBuf], options: &TableOptions) -> Result<Self, InputError> {
        let parts = files.iter().map(|file| Part::open(file, options));
        let mut parts = parts.collect::<Result<Vec<_>, _>>()?;
        parts.sort_by(|a, b| b.begins_s.total_cmp(&a.begins_s));
        Ok(Self { parts, before: None })
    }
}

impl Iterator for JoinedRows {
    type Item = Result<Sample, SessionRowError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let part = self.parts.last_mut()?;
            let unreadable = |reason: String| {
                let file = part.path.display().to_string();
                Some(Err(SessionRowError::Unreadable(SessionFileError::Part { file, reason })))
            };
            match part.first.next().or_else(|| part.rows.next()) {
                None => {
                    let ended = self.parts.pop().map(|part| (part.ends_s, part.path));
                    // A file without samples ends nowhere.
                    self.before = ended.filter(|(s, _)| s.is_finite()).or(self.before.take());
                }
                Some(Ok(_)) if part.rows.n_runs() > 1 => {
                    return unreadable("its clock starts again; it has several runs".to_owned());
                }
                Some(Ok(sample)) => match &self.before {
                    Some((end_s, file)) if sample.t_s <= *end_s => {
                        let (t_s, file) = (sample.t_s, file.display());
                        return unreadable(format!(
                            "it has a sample at {t_s:.2} s, and {file} ends at {end_s:.2} s: they overlap"
                        ));
                    }
                    _ => {
                        part.ends_s = part.ends_s.max(sample.t_s);
                        return Some(Ok(sample));
                    }
                },
                Some(Err(SessionRowError::Rejected(RejectedRow { place, reason }))) => {
                    let reason = format!("{reason} ({})", part.path.display());
                    return Some(Err(SessionRowError::Rejected(RejectedRow { place, reason })));
                }
                Some(Err(SessionRowError::Unreadable(e))) => return unreadable(e.to_string()),
            }
        }
    }
}

impl SessionRows for JoinedRows {
    fn place(&self) -> RowPlace {
        self.parts.last().map_or(RowPlace::Row(0), |part| part.rows.place())
    }
}
