//! The drive cycle of a rig. Nothing is stored.

use crate::background::Priority;
use crate::{Service, ServiceError, views};
use offbd_core::engine::{DriveCycle, drive_cycle};

impl Service {
    /// Returns the drive cycle of `asset` with its current calibration.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::NoDriveCycle`] with the reason;
    /// [`ServiceError::Busy`].
    pub async fn drive_cycle(&self, asset: &str) -> Result<DriveCycle, ServiceError> {
        let row = self.inner.handles.store.asset(asset).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: asset.to_owned() })?;
        let rig = views::rig(&row.document)?;
        let busy = |_| ServiceError::Busy { what: "another drive cycle is being computed" };
        let permit = self.inner.computing.drive_cycles.clone().try_acquire_owned().map_err(busy)?;
        let computed = Priority::Low.compute(move || {
            let cycle = drive_cycle(&rig);
            drop(permit);
            cycle
        });
        computed.await?.map_err(ServiceError::NoDriveCycle)
    }
}
