//! Notifications of PostgreSQL: that a partition has another owner, or that there are events.

use sqlx::postgres::PgListener;

use super::{EVENTS, Location, Store, StoreError, TRANSFERS};

/// What has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notification {
    Transfer,
    Event,
    /// Anything may have changed.
    Unknown,
}

/// A connection that receives notifications.
#[derive(Debug)]
pub struct Notifications(PgListener);

impl Notifications {
    /// Waits for the next notification. Cancel safe.
    ///
    /// # Errors
    /// [`StoreError`] as soon as the connection is lost.
    pub async fn next(&mut self) -> Result<Notification, StoreError> {
        Ok(match self.0.try_recv().await? {
            Some(received) if received.channel() == TRANSFERS => Notification::Transfer,
            Some(_) => Notification::Event,
            None => return Err(sqlx::Error::PoolClosed.into()),
        })
    }
}

impl Store {
    /// Tells the other nodes of a cluster that there are events. Not in the transaction that has
    /// them: such commits would wait for one another, over all databases of the server.
    ///
    /// # Errors
    /// [`StoreError`] if the database is unavailable.
    pub async fn announce_events(&self) -> Result<(), StoreError> {
        sqlx::query("SELECT pg_notify($1, '')").bind(EVENTS).execute(&self.pool).await?;
        Ok(())
    }

    /// Subscribes to the notifications of a PostgreSQL database; `None` for SQLite.
    ///
    /// # Errors
    /// [`StoreError`] if the database is unavailable.
    pub async fn notifications(&self) -> Result<Option<Notifications>, StoreError> {
        let Location::Server(url) = &self.location else { return Ok(None) };
        let mut listener = PgListener::connect(url).await?;
        listener.eager_reconnect(false);
        listener.listen_all([TRANSFERS, EVENTS]).await?;
        Ok(Some(Notifications(listener)))
    }
}
