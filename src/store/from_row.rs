//! Rows of the database as structs: each field is the column of its name, and
//! one in brackets is a struct of further columns of the same row.

/// Implements `sqlx::FromRow` by the names of the fields.
macro_rules! from_row {
    ($row:ident { $($field:ident),* $(,)? } $([$inner:ident])?) => {
        impl<'r> sqlx::FromRow<'r, sqlx::any::AnyRow> for $row {
            fn from_row(row: &'r sqlx::any::AnyRow) -> Result<Self, sqlx::Error> {
                Ok(Self {
                    $($field: sqlx::Row::try_get(row, stringify!($field))?,)*
                    $($inner: sqlx::FromRow::from_row(row)?,)?
                })
            }
        }
    };
}

pub(super) use from_row;
