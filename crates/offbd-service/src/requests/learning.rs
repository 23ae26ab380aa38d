//! Automatic calibration: its progress, accepting and discarding it.

use crate::asset::{Asset, AssetCommand};
use crate::{Service, ServiceError, views};
use offbd_wire::learning::{LearningState, LearningView};
use offbd_wire::words::JobWaitReason;

impl Service {
    /// Returns the progress of the automatic calibration of `asset`, including samples that
    /// are not durable yet; as it was stored last if the asset is not loaded.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn learning(&self, asset: &str) -> Result<LearningView, ServiceError> {
        let mut view = self.look(asset, Asset::learning).await?;
        let id = view.calibration.as_ref().filter(|_| view.state == LearningState::Learning);
        if let Some(wait) = id.and_then(|id| self.inner.jobs.wait(id)) {
            view.summary += &match wait.reason {
                JobWaitReason::Jobs => {
                    format!(" Rigs to be calibrated before it: {}.", wait.n_before)
                }
                JobWaitReason::Samples => " It waits until fewer samples are queued.".to_owned(),
            };
        }
        Ok(view)
    }

    /// Accepts the offered calibration on request of the person `by`, because the rig was
    /// healthy. An open session does not use it; the next one does.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::NothingOffered`].
    pub async fn accept_learning(
        &self,
        asset: &str,
        by: Option<String>,
    ) -> Result<LearningView, ServiceError> {
        let nothing = || ServiceError::NothingOffered { asset: asset.to_owned() };
        let shards = &self.inner.shards;
        // The reply implies that the offered calibration is durable.
        let offered = shards.call(asset, |reply| AssetCommand::OfferedCalibration { reply });
        let id = offered.await?.ok_or_else(nothing)?;
        let document = self.calibration_row(asset, &id).await?.document.ok_or_else(nothing)?;
        let calibration = Box::new(views::from_json(&document)?);
        let accept = |reply| AssetCommand::AcceptLearning { id, calibration, by, reply };
        shards.call(asset, accept).await?;
        self.learning(asset).await
    }

    /// Discards the gathered motion, including that of the open session, because the rig
    /// was not healthy, and starts again.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::AlreadyLearnt`].
    pub async fn discard_learning(&self, asset: &str) -> Result<LearningView, ServiceError> {
        self.inner.shards.call(asset, |reply| AssetCommand::DiscardLearning { reply }).await?;
        self.learning(asset).await
    }
}
