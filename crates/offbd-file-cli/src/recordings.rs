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
            _ => InputError::new(&self.name, error),
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
            let name = session_name(paths.first().unwrap_or(&files[0]));
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
        Ok(Self { path: path.to_owned(), rows, first: first.into_iter(), begins_s })
    }
}

/// The rows of several files, in the order of their times.
struct JoinedRows {
    /// The files, the present one last.
    parts: Vec<Part>,
    /// The end of the samples so far, s, and the file that has it.
    end: Option<(f64, PathBuf)>,
}

impl JoinedRows {
    fn open(files: &[PathBuf], options: &TableOptions) -> Result<Self, InputError> {
        let parts = files.iter().map(|file| Part::open(file, options));
        let mut parts = parts.collect::<Result<Vec<_>, _>>()?;
        parts.sort_by(|a, b| b.begins_s.total_cmp(&a.begins_s));
        Ok(Self { parts, end: None })
    }
}

impl Iterator for JoinedRows {
    type Item = Result<Sample, SessionRowError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let part = self.parts.last_mut()?;
            let name = part.path.display();
            let unfit = |reason: String| {
                let error = SessionFileError::Unfit(format!("{name}: {reason}"));
                Some(Err(SessionRowError::Unreadable(error)))
            };
            match part.first.next().or_else(|| part.rows.next()) {
                None => drop(self.parts.pop()),
                Some(Ok(_)) if part.rows.n_runs() > 1 => {
                    return unfit(
                        "its clock starts again, so that its runs are no one recording".to_owned(),
                    );
                }
                Some(Ok(sample)) => {
                    let end = self.end.as_ref().filter(|(_, file)| *file != part.path);
                    if let Some((end_s, file)) = end.filter(|(end_s, _)| *end_s >= sample.t_s) {
                        return unfit(format!(
                            "it begins at {} s, and {} ends at {end_s} s: they overlap",
                            sample.t_s,
                            file.display()
                        ));
                    }
                    let end_s = self.end.as_ref().map_or(sample.t_s, |(s, _)| s.max(sample.t_s));
                    self.end = Some((end_s, part.path.clone()));
                    return Some(Ok(sample));
                }
                Some(Err(SessionRowError::Rejected(RejectedRow { place, reason }))) => {
                    let reason = format!("{reason} ({name})");
                    return Some(Err(SessionRowError::Rejected(RejectedRow { place, reason })));
                }
                Some(Err(SessionRowError::Unreadable(error))) => return unfit(error.to_string()),
            }
        }
    }
}

impl SessionRows for JoinedRows {
    fn place(&self) -> RowPlace {
        self.parts.last().map_or(RowPlace::Row(0), |part| part.rows.place())
    }
}
