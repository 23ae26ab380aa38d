//! The number and the name of a part of a long session.

use offbd_store::SessionRow;

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
    pub(super) fn next(&self) -> Self {
        Self { number: self.number + 1, ..self.clone() }
    }

    /// Returns the name of the session that is this part.
    pub(super) fn session_name(&self) -> String {
        self.name.clone() + &suffix(self.number)
    }
}

fn suffix(number: i64) -> String {
    format!(" ({number})")
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
