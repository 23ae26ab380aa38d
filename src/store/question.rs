//! A question put together from parts, with numbered placeholders that both
//! databases take.

use sqlx::any::{AnyArguments, AnyRow};
use sqlx::query::QueryAs;
use sqlx::{Any, Arguments, AssertSqlSafe, Encode, FromRow, Type};

use super::StoreError;

#[derive(Default)]
pub(super) struct Question {
    sql: String,
    arguments: AnyArguments,
}

impl Question {
    pub(super) fn new(sql: &'static str) -> Self {
        Self { sql: sql.to_owned(), ..Self::default() }
    }

    pub(super) fn push(&mut self, sql: &'static str) -> &mut Self {
        self.sql.push_str(sql);
        self
    }

    /// Puts `value` here.
    pub(super) fn bind<'v>(
        &mut self,
        value: impl Encode<'v, Any> + Type<Any>,
    ) -> Result<&mut Self, StoreError> {
        self.arguments.add(value).map_err(sqlx::Error::Encode)?;
        self.sql.push_str(&format!("${}", self.arguments.len()));
        Ok(self)
    }

    /// The question, whose text holds nothing but what this version says.
    pub(super) fn rows<T: for<'r> FromRow<'r, AnyRow>>(
        self,
    ) -> QueryAs<'static, Any, T, AnyArguments> {
        sqlx::query_as_with(AssertSqlSafe(self.sql), self.arguments)
    }
}
