//! Subscriptions to events.

use crate::{Event, EventFeed, Service, ServiceError};
use offbd_store::{PresentFaultRow, Write};

/// Faults on record that are read at a time.
const PAGE: u32 = 64;

/// A fault on record, or lost communication.
#[derive(Clone, Debug)]
pub struct PresentFault {
    pub asset: String,
    /// A fault code, or `communication_lost`.
    pub code: String,
    pub status: String,
    /// The last event about it; `None` if it was deleted with its session. One of an earlier
    /// session has another status, and one of a later change may have.
    pub last: Option<Event>,
}

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
            self.check_known(name).await?;
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

    /// Returns a page of the faults on record and lost communications of the fleet, in the order
    /// of assets and codes, after an asset and a code. After the last one the page is empty.
    ///
    /// # Errors
    /// [`ServiceError::Store`].
    pub async fn present_faults(
        &self,
        after: (&str, &str),
    ) -> Result<Vec<PresentFault>, ServiceError> {
        let store = &self.inner.handles.store;
        let mut page = Vec::new();
        for row in store.present_faults(after, PAGE).await? {
            let PresentFaultRow { asset, code, status } = row;
            let last = store.last_event_of(&asset, &code).await?.map(Event::from);
            page.push(PresentFault { asset, code, status, last });
        }
        Ok(page)
    }
}
