//! The drift of a rig's servos over its sessions.

use crate::asset::{MAX_TREND_ROWS, TrendPoint, trend_points};
use crate::{Service, ServiceError};
use offbd_wire::trend::{TrendsView, trend_views};

impl Service {
    /// Returns the servo estimates of the sessions of `asset`, and the trends over those
    /// with the current calibration.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn trends(&self, asset: &str) -> Result<TrendsView, ServiceError> {
        let calibration_id = self.asset(asset).await?.calibration.map(|c| c.id);
        let points = trend_points(self.inner.handles.store.trend(asset, MAX_TREND_ROWS).await?);
        let calibrated = calibration_id.is_some();
        let current = points.iter().filter(|p| calibrated && p.calibration_id == calibration_id);
        let estimates: Vec<_> = current.map(|p| p.estimates).collect();
        Ok(TrendsView {
            asset: asset.to_owned(),
            calibration_id,
            trends: trend_views(&estimates),
            points: points.into_iter().map(TrendPoint::view).collect(),
        })
    }
}
