//! A builder for queries that depend on filters, with numbered placeholders, which both
//! SQLite and PostgreSQL understand.

use sqlx::any::{AnyArguments, AnyRow};
use sqlx::query::QueryAs;
use sqlx::{Any, Arguments, AssertSqlSafe, Encode, FromRow, Type};

use super::{PartitionId, StoreError};

/// Lengths of bound lists. Few, so that few statements are prepared; a list in between is
/// filled up with NULL, which equals nothing. A longer one is bound as it is.
const LIST_LENGTHS: [usize; 5] = [1, 4, 16, 64, 256];

#[derive(Default)]
pub(super) struct QueryBuilder {
    sql: String,
    arguments: AnyArguments,
}

impl QueryBuilder {
    pub(super) fn new(sql: &'static str) -> Self {
        Self { sql: sql.to_owned(), ..Self::default() }
    }

    /// Appends constant SQL.
    pub(super) fn push(&mut self, sql: &'static str) -> &mut Self {
        self.sql.push_str(sql);
        self
    }

    /// Appends a placeholder and binds `value` to it.
    pub(super) fn bind<'v>(
        &mut self,
        value: impl Encode<'v, Any> + Type<Any>,
    ) -> Result<&mut Self, StoreError> {
        self.arguments.add(value).map_err(sqlx::Error::Encode)?;
        self.sql.push_str(&format!("${}", self.arguments.len()));
        Ok(self)
    }

    /// Appends a placeholder for each of `values`, separated by commas.
    pub(super) fn bind_list(&mut self, values: &[String]) -> Result<&mut Self, StoreError> {
        for i in 0..list_length(values.len()) {
            self.push(if i == 0 { "" } else { ", " }).bind(values.get(i).cloned())?;
        }
        Ok(self)
    }

    /// Appends rows of two placeholders for `VALUES`, one for each of `rows`.
    pub(super) fn bind_rows(&mut self, rows: &[(String, i64)]) -> Result<&mut Self, StoreError> {
        for i in 0..list_length(rows.len()) {
            let (text, number) = rows.get(i).cloned().unzip();
            self.push(if i == 0 { "(" } else { ", (" }).bind(text)?;
            self.push(", ").bind(number)?.push(")");
        }
        Ok(self)
    }

    /// Appends the condition that the column `asset` is in one of the partitions `owned`;
    /// nothing for all partitions.
    pub(super) fn push_owned(
        &mut self,
        owned: Option<&[PartitionId]>,
    ) -> Result<&mut Self, StoreError> {
        let Some(owned) = owned else { return Ok(self) };
        self.push(" AND asset IN (SELECT name FROM asset WHERE partition IN (-1");
        for partition in owned {
            self.push(", ").bind(partition.bound())?;
        }
        Ok(self.push("))"))
    }

    /// The finished query. Its SQL consists of constants and placeholders only.
    pub(super) fn rows<T: for<'r> FromRow<'r, AnyRow>>(
        self,
    ) -> QueryAs<'static, Any, T, AnyArguments> {
        sqlx::query_as_with(AssertSqlSafe(self.sql), self.arguments)
    }
}

fn list_length(n: usize) -> usize {
    LIST_LENGTHS.into_iter().find(|&length| length >= n).unwrap_or(n)
}
