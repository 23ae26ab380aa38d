//! Which columns of a table have the names of quantities.

use super::CsvError;
use super::dialect::Dialect;
use super::expression::{ColumnMapping, ColumnName, Expression, Term};
use crate::session_csv::COLUMNS;

/// Returns the mapping with the columns that have the name of a quantity, in any case, where
/// `mapping` says nothing.
///
/// # Errors
/// [`CsvError::DoubleColumn`].
pub(super) fn with_own_names(
    mapping: &ColumnMapping,
    dialect: &Dialect,
) -> Result<ColumnMapping, CsvError> {
    let mut whole = mapping.clone();
    for (slot, name) in whole.expressions.iter_mut().zip(COLUMNS) {
        if slot.is_none()
            && let Some(column) = find(dialect, name)?
        {
            let column = Some(ColumnName::Number(column + 1));
            *slot = Some(Expression { terms: vec![Term { column, factor: 1.0 }] });
        }
    }
    Ok(whole)
}

/// Returns the column of this name, in any case.
///
/// # Errors
/// [`CsvError::DoubleColumn`].
pub(super) fn find(dialect: &Dialect, name: &'static str) -> Result<Option<usize>, CsvError> {
    let mut found =
        (0..dialect.names.len()).filter(|i| dialect.names[*i].eq_ignore_ascii_case(name));
    match (found.next(), found.next()) {
        (Some(first), Some(second)) => {
            Err(CsvError::DoubleColumn { name, first: first + 1, second: second + 1 })
        }
        (first, _) => Ok(first),
    }
}
