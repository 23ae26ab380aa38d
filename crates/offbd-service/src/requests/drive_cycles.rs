//! The drive cycle of a rig. The last one is kept, since the page and its files are asked for one
//! after the other. Nothing is stored.

use std::sync::{Arc, PoisonError};

use crate::background::Priority;
use crate::{Service, ServiceError, views};
use offbd_core::engine::{DriveCycle, NoDriveCycle, Rig, drive_cycle};

/// What a search for a drive cycle found.
type FoundCycle = Result<Arc<DriveCycle>, NoDriveCycle>;

/// The last search for a drive cycle: for the same rig, it finds the same.
pub(crate) type LastSearch = Option<(Rig, FoundCycle)>;

impl Service {
    /// Returns the drive cycle of `asset` with its current calibration.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::NoDriveCycle`] with the reason;
    /// [`ServiceError::Busy`].
    pub async fn drive_cycle(&self, asset: &str) -> Result<Arc<DriveCycle>, ServiceError> {
        let row = self.inner.handles.store.asset(asset).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: asset.to_owned() })?;
        let rig = views::rig(&row.document)?;
        let found = match self.last_drive_cycle(&rig) {
            Some(found) => found,
            None => self.search_drive_cycle(rig).await?,
        };
        found.map_err(ServiceError::NoDriveCycle)
    }

    fn last_drive_cycle(&self, rig: &Rig) -> Option<FoundCycle> {
        let last = self.inner.computing.last_drive_cycle.lock();
        let last = last.unwrap_or_else(PoisonError::into_inner);
        last.as_ref().filter(|(of, _)| of == rig).map(|(_, found)| found.clone())
    }

    async fn search_drive_cycle(&self, rig: Rig) -> Result<FoundCycle, ServiceError> {
        let busy = |_| ServiceError::Busy { what: "another drive cycle is being computed" };
        let permit = self.inner.computing.drive_cycles.clone().try_acquire_owned().map_err(busy)?;
        let computed = Priority::Low.compute(move || {
            let found = drive_cycle(&rig).map(Arc::new);
            drop(permit);
            (rig, found)
        });
        let (rig, found) = computed.await?;
        let last = &self.inner.computing.last_drive_cycle;
        *last.lock().unwrap_or_else(PoisonError::into_inner) = Some((rig, found.clone()));
        Ok(found)
    }
}
