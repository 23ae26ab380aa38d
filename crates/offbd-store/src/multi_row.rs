//! Statements for several rows at once, which share the fixed cost of a statement.

use std::sync::OnceLock;

/// Numbers of rows for which there are statements, largest first. Few sizes, so that each
/// is prepared once; powers of two, so that few statements are enough for any number of
/// rows. Larger ones would be slower: SQLite looks up the name of each placeholder by a
/// linear search through the earlier ones.
const SIZES: [usize; 5] = [16, 8, 4, 2, 1];

/// Cuts `rows` into parts for which there are statements.
pub(super) fn in_parts<T>(rows: &[T]) -> impl Iterator<Item = &[T]> {
    let mut rest = rows;
    std::iter::from_fn(move || {
        let size = SIZES.into_iter().find(|&size| size <= rest.len())?;
        let (part, after) = rest.split_at(size);
        rest = after;
        Some(part)
    })
}

/// The SQL `before ($1, …), ($k, …), … after`, for each number of rows in [`SIZES`].
pub(super) struct MultiRowStatement {
    before: &'static str,
    columns: usize,
    after: &'static str,
    statements: OnceLock<[String; SIZES.len()]>,
}

impl MultiRowStatement {
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
        static PUT: MultiRowStatement =
            MultiRowStatement::new("INSERT INTO a VALUES ", 2, " RETURNING 1");
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
