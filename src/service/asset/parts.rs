//! The parts of a long session. A session that has become too long ends and continues in
//! another one, its next part, which has the same name with a number.

use super::actor::Asset;
use super::session::OpenSession;
use super::turn::Turn;
use crate::service::ServiceError;
use crate::service::limits::SessionLimits;
use crate::store::SessionRow;

/// Which part of which session an open session is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Part {
    /// Number of the part, from 1.
    pub(super) number: i64,
    /// The id of the first part.
    pub(super) first: String,
    /// The name of the first part, by which the device names all of them.
    pub(super) name: String,
}

impl Part {
    pub(super) fn of(row: &SessionRow) -> Self {
        let suffix = suffix(row.part);
        let name = match row.first_part {
            Some(_) => row.name.strip_suffix(&suffix).unwrap_or(&row.name),
            None => &row.name,
        };
        Self { number: row.part, first: row.first_part().to_owned(), name: name.to_owned() }
    }

    /// Returns the part that follows.
    fn next(&self) -> Self {
        Self { number: self.number + 1, ..self.clone() }
    }

    /// Returns the name of the session that is this part.
    fn session_name(&self) -> String {
        self.name.clone() + &suffix(self.number)
    }
}

fn suffix(number: i64) -> String {
    format!(" ({number})")
}

impl OpenSession {
    /// Whether a batch with the session name `name` belongs to this session.
    pub(super) fn is_named(&self, name: &str) -> bool {
        self.name == name || self.part.name == name
    }

    /// Whether the session must not get longer.
    const fn is_long(&self, limits: SessionLimits) -> bool {
        !self.importing && self.progress.n_samples >= limits.samples
    }
}

impl Asset {
    /// Ends the open session if it has become too long, and opens its next part; later if
    /// sessions of this asset begin too often.
    pub(super) fn continue_if_long(&mut self, turn: &mut Turn<'_>) -> Result<(), ServiceError> {
        let limits = turn.env.handles.sessions;
        let Some(open) = self.open.as_ref().filter(|open| open.is_long(limits)) else {
            return Ok(());
        };
        if !self.session_rate.allows(turn.at) {
            return Ok(());
        }
        let handles = &turn.env.handles;
        handles.fence()?;
        let mut part = open.part.next();
        let named = |part: &Part| {
            handles.wait(handles.store.session_named(&self.row.name, &part.session_name()))
        };
        while named(&part)?.is_some() {
            // Another session of the device has this name.
            part = part.next();
        }
        tracing::info!(
            asset = self.row.name,
            session = open.name,
            "the session continues in another"
        );
        self.end(turn)?;
        self.open(part.session_name(), Some(&part), false, turn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_names_all_parts_like_the_first() {
        let first = Part { number: 1, first: "id".to_owned(), name: "monday (1)".to_owned() };
        let second = first.next();
        let name = second.session_name();
        assert_eq!(name, "monday (1) (2)");
        let row = SessionRow {
            name,
            part: second.number,
            first_part: Some(second.first.clone()),
            ..SessionRow::default()
        };
        assert_eq!(Part::of(&row), second);
    }
}
