//! Starting, listing and activating calibrations.

use uuid::Uuid;

use crate::asset::AssetCommand;
use crate::clock::rfc3339;
use crate::job::{self, Job, NewJob};
use crate::jobs::calibration;
use crate::limits::MAX_CALIBRATION_SESSIONS;
use crate::{Service, ServiceError, views};
use offbd_core::vocabulary::Invalid;
use offbd_store::{CalibrationRow, Write};
use offbd_wire::service::{CalibrationJobView, Page, TrainingDataView};
use offbd_wire::words::JobState;

impl Service {
    /// Queues a job that calibrates `asset` from its `sessions`, or stretches of them, on
    /// request of the person `by`.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for a session of another asset or an empty stretch; [`ServiceError::Busy`].
    pub async fn calibrate(
        &self,
        asset: &str,
        sessions: Vec<TrainingDataView>,
        by: Option<String>,
    ) -> Result<CalibrationJobView, ServiceError> {
        self.check_known(asset).await?;
        if !(1..=MAX_CALIBRATION_SESSIONS).contains(&sessions.len()) {
            let reason = format!("must name 1 to {MAX_CALIBRATION_SESSIONS} sessions");
            return Err(Invalid::new("/sessions", reason).into());
        }
        let mut n_samples: i64 = 0;
        for (i, data) in sessions.iter().enumerate() {
            let (id, range) = (data.session(), data.range());
            if range.from_s > range.to_s {
                let reason = format!("must not be less than from_s, which is {}", range.from_s);
                return Err(Invalid::new(format!("/sessions/{i}/to_s"), reason).into());
            }
            let row = self.inner.handles.store.session(id).await?;
            let Some(row) = row.filter(|row| row.asset == asset) else {
                let reason = format!("asset `{asset}` has no session `{id}`");
                return Err(Invalid::new(format!("/sessions/{i}"), reason).into());
            };
            n_samples = n_samples.saturating_add(row.progress.n_samples);
        }
        let room = self.reserve_job()?;
        let row = CalibrationRow {
            id: Uuid::now_v7().to_string(),
            asset: asset.to_owned(),
            state: JobState::Queued.to_string(),
            sessions: views::to_json(&sessions)?,
            made_at: self.inner.handles.clock.now(),
            active: 0,
            document: None,
            error: None,
            made_by: by,
            activated_by: None,
            activated_at: None,
        };
        if let Err(error) =
            self.inner.handles.write(asset, vec![Write::PutCalibration(row.clone())]).await
        {
            // The asset may have been deleted meanwhile.
            self.check_known(&row.asset).await?;
            return Err(error);
        }
        let (job, cost) = (Job::Calibration(row.id.clone()), job::calibration_cost(n_samples));
        room.put(NewJob { job, asset: row.asset.clone(), cost });
        self.view_calibration(row)
    }

    /// Returns a calibration.
    ///
    /// # Errors
    /// [`ServiceError::UnknownCalibration`].
    pub async fn calibration(
        &self,
        asset: &str,
        id: &str,
    ) -> Result<CalibrationJobView, ServiceError> {
        self.view_calibration(self.calibration_row(asset, id).await?)
    }

    pub(crate) async fn calibration_row(
        &self,
        asset: &str,
        id: &str,
    ) -> Result<CalibrationRow, ServiceError> {
        let row = self.inner.handles.store.calibration(id).await?.filter(|row| row.asset == asset);
        let (asset, id) = (asset.to_owned(), id.to_owned());
        row.ok_or(ServiceError::UnknownCalibration { asset, id })
    }

    /// Returns a page of the calibrations of `asset`, newest first.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn calibrations(
        &self,
        asset: &str,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<CalibrationJobView>, ServiceError> {
        self.check_known(asset).await?;
        let before = cursor.map(views::cursor::<(i64, String)>).transpose()?;
        let before = before.as_ref().map(|(made_at, id)| (*made_at, id.as_str()));
        let rows = self.inner.handles.store.calibrations(asset, before, limit + 1).await?;
        views::page(
            rows,
            limit,
            |row| (row.made_at, row.id.clone()),
            |row| self.view_calibration(row),
        )
    }

    /// Writes a calibration to the asset file, on request of the person `by`. An open session
    /// keeps the calibration that it started with; the next one uses the new one.
    ///
    /// # Errors
    /// [`ServiceError::UnknownCalibration`]; [`ServiceError::NotDone`].
    pub async fn activate_calibration(
        &self,
        asset: &str,
        id: &str,
        by: Option<String>,
    ) -> Result<CalibrationJobView, ServiceError> {
        let row = self.calibration_row(asset, id).await?;
        let Some(document) = row.document else {
            return Err(ServiceError::NotDone { id: row.id, state: row.state });
        };
        let (id, calibration) = (row.id.clone(), Box::new(views::from_json(&document)?));
        let activate = |reply| AssetCommand::Activate { id, calibration, by, reply };
        self.inner.shards.call(asset, activate).await?;
        self.calibration(asset, &row.id).await
    }

    /// Cancels a calibration that waits or runs; one that runs may take a moment to stop. A rig
    /// whose own calibration is cancelled tries again with half as much motion again.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCalibration`];
    /// [`ServiceError::JobEnded`].
    pub async fn cancel_calibration(
        &self,
        asset: &str,
        id: &str,
    ) -> Result<CalibrationJobView, ServiceError> {
        let row = self.calibration_row(asset, id).await?;
        self.cancel_job(id, calibration::cancel_waiting(&self.inner.job_context, row)).await?;
        self.calibration(asset, id).await
    }

    fn view_calibration(&self, row: CalibrationRow) -> Result<CalibrationJobView, ServiceError> {
        let state = views::word(&row.state)?;
        Ok(CalibrationJobView {
            waits: self.inner.jobs.wait(&row.id).filter(|_| state == JobState::Queued),
            id: row.id,
            asset: row.asset,
            state,
            sessions: views::from_json(&row.sessions)?,
            made_at: rfc3339(row.made_at),
            made_by: row.made_by,
            active: row.active != 0,
            activated_by: row.activated_by,
            activated_at: row.activated_at.map(rfc3339),
            calibration: row.document.as_deref().map(views::from_json).transpose()?,
            error: row.error,
        })
    }
}
