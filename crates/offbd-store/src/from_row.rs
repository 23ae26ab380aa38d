//! Conversion of database rows to structs.

/// Implements `sqlx::FromRow`: each field is read from the column of its name, and the
/// field in brackets is a struct that is read from further columns of the same row.
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
