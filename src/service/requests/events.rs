//! Subscriptions to events.

use crate::service::{EventFeed, Service, ServiceError};
use crate::store::Write;

impl Service {
    /// Subscribes to the events from now on, or to those after the id `after`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Store`].
    pub async fn events(
        &self,
        asset: Option<String>,
        after: Option<i64>,
    ) -> Result<EventFeed, ServiceError> {
        if let Some(name) = &asset {
            self.asset(name).await?;
        }
        self.inner.events.feed(asset, after).await
    }

    /// Returns the id of the last event that was published on a bus; 0 before the first one.
    ///
    /// # Errors
    /// [`ServiceError::Store`].
    pub async fn published(&self, bus: &'static str) -> Result<i64, ServiceError> {
        Ok(self.inner.handles.store.published(bus).await?.unwrap_or(0))
    }

    /// Stores the id of the last event that was published on a bus.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] or [`ServiceError::NotStored`].
    pub async fn set_published(&self, bus: &'static str, event: i64) -> Result<(), ServiceError> {
        self.inner.handles.write_as_leader(vec![Write::Published { bus, event }]).await
    }
}
