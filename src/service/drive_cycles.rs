//! The drive cycle of a rig, computed where nothing waits for it. Nothing is stored.

use super::{Service, ServiceError, views};
use offbd_core::engine::{DriveCycle, drive_cycle};

/// Drive cycles that are computed at a time; the next is told to come again. Each takes
/// up to some seconds of a core.
pub(super) const MAX_AT_ONCE: usize = 1;

impl Service {
    /// The drive cycle of `asset` as it is learnt now.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::NoDriveCycle`], which says why;
    /// [`ServiceError::Busy`].
    pub async fn drive_cycle(&self, asset: &str) -> Result<DriveCycle, ServiceError> {
        let row = self.inner.handles.store.asset(asset).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: asset.to_owned() })?;
        let rig = views::rig(&row.document)?;
        let busy = |_| ServiceError::Busy { what: "another drive cycle is being computed" };
        let permit = self.inner.drive_cycles.clone().try_acquire_owned().map_err(busy)?;
        let made = tokio::task::spawn_blocking(move || {
            let cycle = drive_cycle(&rig);
            drop(permit);
            cycle
        });
        let failed = ServiceError::Unavailable { what: "computing the drive cycle has failed" };
        made.await.map_err(|_| failed)?.map_err(ServiceError::NoDriveCycle)
    }
}
