//! Learning a rig from sessions that were recorded of it.

use data_encoding::HEXLOWER;
use sha2::{Digest, Sha256};
use tokio::runtime::Handle;
use uuid::Uuid;

use super::clock::rfc3339;
use super::jobs::{Job, JobContext};
use super::learning::{Record, Teaching};
use super::running::{Running, Work};
use super::shard::Context;
use super::{Service, ServiceError, views};
use crate::store::{CalibrationRow, JobState, Store, Write};
use crate::wire::asset::{self, CalibrationView};
use crate::wire::service::{CalibrationJobView, Page};
use crate::wire::session_csv;
use offbd_core::diagnosis::Calibration;
use offbd_core::engine::{Rig, Setup, calibrate_and_foresee};
use offbd_core::vocabulary::{Invalid, Sample};

/// Sessions that one calibration learns from; more are refused.
pub(super) const MAX_SESSIONS: usize = 32;

/// Samples that one calibration learns from; with more it fails, and says so.
pub(super) const MAX_SAMPLES: usize = 2_000_000;

impl Service {
    /// Begins to learn `asset` from `sessions` of it.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for a session that is none of the asset's;
    /// [`ServiceError::Busy`].
    pub async fn calibrate(
        &self,
        asset: &str,
        sessions: Vec<String>,
    ) -> Result<CalibrationJobView, ServiceError> {
        self.asset(asset).await?;
        if !(1..=MAX_SESSIONS).contains(&sessions.len()) {
            let reason = format!("must name 1 to {MAX_SESSIONS} sessions");
            return Err(Invalid::new("/sessions", reason).into());
        }
        for (i, id) in sessions.iter().enumerate() {
            let row = self.inner.handles.store.session(id).await?;
            if row.is_none_or(|row| row.asset != asset) {
                let reason = format!("asset `{asset}` has no session `{id}`");
                return Err(Invalid::new(format!("/sessions/{i}"), reason).into());
            }
        }
        let place = self.job_place()?;
        let row = CalibrationRow {
            id: Uuid::now_v7().to_string(),
            asset: asset.to_owned(),
            state: JobState::Queued.to_string(),
            sessions: views::to_json(&sessions)?,
            made_at: self.inner.handles.clock.now(),
            active: 0,
            document: None,
            error: None,
        };
        self.inner.handles.write(Write::PutCalibration(row.clone())).await?;
        place.send(Job::Calibration(row.id.clone()));
        view(row)
    }

    /// # Errors
    /// [`ServiceError::UnknownCalibration`].
    pub async fn calibration(
        &self,
        asset: &str,
        id: &str,
    ) -> Result<CalibrationJobView, ServiceError> {
        view(self.calibration_row(asset, id).await?)
    }

    pub(super) async fn calibration_row(
        &self,
        asset: &str,
        id: &str,
    ) -> Result<CalibrationRow, ServiceError> {
        let row = self.inner.handles.store.calibration(id).await?.filter(|row| row.asset == asset);
        let (asset, id) = (asset.to_owned(), id.to_owned());
        row.ok_or(ServiceError::UnknownCalibration { asset, id })
    }

    /// The calibrations of `asset`, newest first.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Invalid`] cursor.
    pub async fn calibrations(
        &self,
        asset: &str,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<CalibrationJobView>, ServiceError> {
        self.asset(asset).await?;
        let before = cursor.map(views::cursor::<(i64, String)>).transpose()?;
        let before = before.as_ref().map(|(made_at, id)| (*made_at, id.as_str()));
        let rows = self.inner.handles.store.calibrations(asset, before, limit + 1).await?;
        views::page(rows, limit, |row| (row.made_at, row.id.clone()), view)
    }

    /// Puts a calibration into the asset file. An open session goes on with
    /// what it began with; the next one uses it.
    ///
    /// # Errors
    /// [`ServiceError::UnknownCalibration`]; [`ServiceError::NotDone`].
    pub async fn activate_calibration(
        &self,
        asset: &str,
        id: &str,
    ) -> Result<CalibrationJobView, ServiceError> {
        let row = self.calibration_row(asset, id).await?;
        let Some(document) = row.document else {
            return Err(ServiceError::NotDone { id: row.id, state: row.state });
        };
        let learnt: CalibrationView = views::from_json(&document)?;
        let id = row.id.clone();
        self.call(asset, move |_, running, work| running.activate(learnt, &id, work)).await?;
        self.calibration(asset, &row.id).await
    }
}

fn view(row: CalibrationRow) -> Result<CalibrationJobView, ServiceError> {
    Ok(CalibrationJobView {
        id: row.id,
        asset: row.asset,
        state: row.state,
        sessions: views::from_json(&row.sessions)?,
        made_at: rfc3339(row.made_at),
        active: row.active != 0,
        calibration: row.document.as_deref().map(views::from_json).transpose()?,
        error: row.error,
    })
}

/// Runs a calibration to its end, or until the service closes: then it begins anew
/// with the next start.
pub(super) async fn run(context: &JobContext, id: &str) -> Result<(), ServiceError> {
    let Some(mut row) = context.handles.store.calibration(id).await? else { return Ok(()) };
    row.state = JobState::Running.to_string();
    context.handles.write(Write::PutCalibration(row.clone())).await?;
    let (store, runtime, job) =
        (context.handles.store.clone(), context.handles.runtime.clone(), row.clone());
    let learning = tokio::task::spawn_blocking(move || learn(&store, &runtime, &job));
    let learnt = tokio::select! {
        () = context.handles.closing.cancelled() => return Ok(()),
        learnt = learning => learnt,
    };
    match learnt.unwrap_or_else(|_| Err("the calibration has failed".to_owned())) {
        Ok(calibration) => {
            row.state = JobState::Done.to_string();
            row.document = Some(views::to_json(&asset::calibration_view(&calibration))?);
        }
        Err(reason) => {
            row.state = JobState::Failed.to_string();
            row.error = Some(reason);
        }
    }
    let asset = row.asset.clone();
    let settled = move |context: &Context, running: &mut Running, work: &mut Work| {
        running.calibrated(context, row, work)
    };
    match context.shards.call_in_turn(&asset, settled).await {
        // It has been deleted meanwhile.
        Err(ServiceError::UnknownAsset { .. }) => Ok(()),
        settled => settled,
    }
}

/// What is learnt, or the sentence that says what is missing.
fn learn(store: &Store, runtime: &Handle, row: &CalibrationRow) -> Result<Calibration, String> {
    let say = |error: ServiceError| error.to_string();
    let rig = runtime.block_on(rig(store, &row.asset)).map_err(say)?;
    let refines = rig.calibration.is_some();
    let sessions = runtime.block_on(recordings(store, row, refines)).map_err(say)?;
    let mut hash = Sha256::new();
    sessions.iter().for_each(|samples| hash.update(csv(samples)));
    let sha256 = HEXLOWER.encode(&hash.finalize());
    let made_at = rfc3339(row.made_at);
    calibrate_and_foresee(&rig, &sessions, &sha256, &made_at).map_err(|e| e.to_string())
}

/// The recordings that a calibration learns from: whole sessions where somebody asked
/// for them, else what the rig's own record says of each. One that is deleted is left
/// out, but nothing `refines` what was learnt from sessions of which one is gone.
async fn recordings(
    store: &Store,
    row: &CalibrationRow,
    refines: bool,
) -> Result<Vec<Vec<Sample>>, ServiceError> {
    let record = store.learning(&row.asset).await?;
    let record: Record = record.as_deref().map(views::from_json).transpose()?.unwrap_or_default();
    let (mut room, mut sessions) = (MAX_SAMPLES, Vec::new());
    if let Some(lesson) = record.lesson(&row.id) {
        for teaching in lesson {
            if !refines && store.session(&teaching.id).await?.is_none() {
                continue;
            }
            let samples = latest(store, teaching, room).await?;
            room -= samples.len();
            sessions.push(samples);
        }
        return Ok(sessions);
    }
    let ids: Vec<String> = views::from_json(&row.sessions)?;
    for id in &ids {
        let samples = recording(store, id, room).await?;
        room -= samples.len();
        sessions.push(samples);
    }
    Ok(sessions)
}

/// The last samples, at most `room`, of what of a session teaches.
///
/// # Errors
/// [`ServiceError::UnknownSession`] if it has been deleted.
async fn latest(
    store: &Store,
    teaching: &Teaching,
    room: usize,
) -> Result<Vec<Sample>, ServiceError> {
    let Teaching { id, n_samples, .. } = teaching;
    if store.session(id).await?.is_none() {
        return Err(ServiceError::UnknownSession { id: id.clone() });
    }
    let mut next = (n_samples - i64::try_from(room).unwrap_or(i64::MAX)).max(0);
    let mut samples: Vec<Sample> = Vec::new();
    while let Some(chunk) = store.samples_from(id, next).await?.filter(|_| next < *n_samples) {
        let wanted = usize::try_from(n_samples - next).unwrap_or(usize::MAX);
        next += i64::try_from(chunk.len()).unwrap_or(i64::MAX);
        samples.extend(chunk.into_iter().take(wanted));
    }
    Ok(samples)
}

/// The asset's rig, of which the set-up can be made.
async fn rig(store: &Store, asset: &str) -> Result<Rig, ServiceError> {
    let row = store.asset(asset).await?;
    let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: asset.to_owned() })?;
    let rig = views::rig(&row.document)?;
    Setup::new(rig.clone(), None)?;
    Ok(rig)
}

async fn recording(store: &Store, id: &str, room: usize) -> Result<Vec<Sample>, ServiceError> {
    let mut samples: Vec<Sample> = Vec::new();
    let next = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
    while let Some(chunk) = store.samples_from(id, next(samples.len())).await? {
        samples.extend(chunk);
        if samples.len() > room {
            let (what, limit) = ("samples in the sessions of a calibration", MAX_SAMPLES);
            return Err(ServiceError::TooMany { what, limit });
        }
    }
    Ok(samples)
}

/// The session file of `samples`, as it is exported: its hash names the data.
fn csv(samples: &[Sample]) -> Vec<u8> {
    let mut text = Vec::new();
    // A vector takes everything that is written to it.
    let _ = session_csv::write(&mut text, samples);
    text
}
