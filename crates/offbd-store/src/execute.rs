//! Executing a statement with its values.

/// Executes a statement on a connection, with its values in their order.
macro_rules! execute {
    ($db:expr, $sql:expr; $($value:expr),+ $(,)?) => {
        sqlx::query($sql)
            $(.bind($value))+
            .execute($db)
            .await
            .map(drop)
            .map_err($crate::StoreError::from)
    };
}

pub(super) use execute;
