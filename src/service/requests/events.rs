//! Subscriptions to events.

use crate::service::{EventFeed, Service, ServiceError};

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
}
