//! Files that are parts of one recording, read in the order of their times.

use super::{RejectedRow, RowPlace, SessionFileError, SessionRowError, SessionRows};
use offbd_core::vocabulary::Sample;

/// A file of a joined recording, of which the rows up to its first sample are read.
struct JoinedPart {
    file: String,
    rows: Box<dyn SessionRows>,
    /// The rejected rows before its first sample, and the sample.
    first: std::vec::IntoIter<Result<Sample, SessionRowError>>,
    begins_s: f64,
    /// Latest time so far, s.
    ends_s: f64,
}

impl JoinedPart {
    fn new(file: String, mut rows: Box<dyn SessionRows>) -> Self {
        let (mut first, mut begins_s) = (Vec::new(), f64::INFINITY);
        for row in rows.by_ref() {
            begins_s = row.as_ref().map_or(begins_s, |sample| sample.t_s);
            let is_rejected = matches!(row, Err(SessionRowError::Rejected(_)));
            first.push(row);
            if !is_rejected {
                break;
            }
        }
        Self { file, rows, first: first.into_iter(), begins_s, ends_s: f64::NEG_INFINITY }
    }
}

/// The rows of several files, in the order of their times.
pub struct JoinedRows {
    /// The files that are not over, the present one last.
    parts: Vec<JoinedPart>,
    /// The end of the file before, s, and the file.
    before: Option<(f64, String)>,
}

impl JoinedRows {
    /// Joins opened files, each with its name. One that overlaps with another, or has several runs, is
    /// an error of the row where that is found.
    #[must_use]
    pub fn new(files: impl IntoIterator<Item = (String, Box<dyn SessionRows>)>) -> Self {
        let mut parts: Vec<JoinedPart> =
            files.into_iter().map(|(file, rows)| JoinedPart::new(file, rows)).collect();
        parts.sort_by(|a, b| b.begins_s.total_cmp(&a.begins_s));
        Self { parts, before: None }
    }
}

impl Iterator for JoinedRows {
    type Item = Result<Sample, SessionRowError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let part = self.parts.last_mut()?;
            let unreadable = |reason: String| {
                let file = part.file.clone();
                Some(Err(SessionRowError::Unreadable(SessionFileError::Part { file, reason })))
            };
            match part.first.next().or_else(|| part.rows.next()) {
                None => {
                    let ended = self.parts.pop().map(|part| (part.ends_s, part.file));
                    // A file without samples ends nowhere.
                    self.before = ended.filter(|(s, _)| s.is_finite()).or(self.before.take());
                }
                Some(Ok(_)) if part.rows.n_runs() > 1 => {
                    return unreadable("its clock starts again; it has several runs".to_owned());
                }
                Some(Ok(sample)) => match &self.before {
                    Some((end_s, file)) if sample.t_s <= *end_s => {
                        let t_s = sample.t_s;
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
                    let reason = format!("{reason} ({})", part.file);
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
