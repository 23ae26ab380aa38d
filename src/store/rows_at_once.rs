//! Many rows in one statement: what a statement costs beside its rows is paid
//! once.

use std::sync::OnceLock;

/// Rows in one statement. Few sizes, so that each is prepared once; powers of two,
/// so that few statements make any number. More at once would cost more: SQLite
/// finds the name of each placeholder by going through those before it.
const SIZES: [usize; 5] = [16, 8, 4, 2, 1];

/// `rows`, cut into parts for which there are statements.
pub(super) fn in_parts<T>(rows: &[T]) -> impl Iterator<Item = &[T]> {
    let mut rest = rows;
    std::iter::from_fn(move || {
        let size = SIZES.into_iter().find(|&size| size <= rest.len())?;
        let (part, after) = rest.split_at(size);
        rest = after;
        Some(part)
    })
}

/// The statements `before ($1, …), ($k, …), … after`, one for each size.
pub(super) struct RowsAtOnce {
    before: &'static str,
    columns: usize,
    after: &'static str,
    statements: OnceLock<[String; SIZES.len()]>,
}

impl RowsAtOnce {
    pub(super) const fn new(before: &'static str, columns: usize, after: &'static str) -> Self {
        Self { before, columns, after, statements: OnceLock::new() }
    }

    /// The statement for `n` rows, one of [`SIZES`].
    pub(super) fn sql(&'static self, n: usize) -> &'static str {
        let statements = self.statements.get_or_init(|| SIZES.map(|n| self.write(n)));
        let at = SIZES.iter().position(|&size| size == n).unwrap_or(SIZES.len() - 1);
        &statements[at]
    }

    fn write(&self, n: usize) -> String {
        let row = |i: usize| {
            let first = i * self.columns;
            let marks = (first + 1..=first + self.columns).map(|k| format!("${k}"));
            format!("({})", marks.collect::<Vec<_>>().join(", "))
        };
        let rows = (0..n).map(row).collect::<Vec<_>>().join(", ");
        format!("{}{rows}{}", self.before, self.after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_in_one_part_that_has_a_statement() {
        static PUT: RowsAtOnce = RowsAtOnce::new("INSERT INTO a VALUES ", 2, " RETURNING 1");
        assert_eq!(PUT.sql(1), "INSERT INTO a VALUES ($1, $2) RETURNING 1");
        for n in 0..200 {
            let rows: Vec<usize> = (0..n).collect();
            assert_eq!(in_parts(&rows).flatten().copied().collect::<Vec<_>>(), rows);
            for part in in_parts(&rows) {
                assert_eq!(PUT.sql(part.len()).matches('$').count(), 2 * part.len());
            }
        }
    }
}
