//! The calibration job: learns a rig from recordings.

use data_encoding::HEXLOWER;
use sha2::{Digest, Sha256};
use tokio::runtime::Handle;

use super::context::JobContext;
use crate::asset::{AssetCommand, LearningRecord, Reply, TrainingSession};
use crate::clock::rfc3339;
use crate::limits::MAX_CALIBRATION_SAMPLES;
use crate::{ServiceError, views};
use offbd_core::diagnosis::{Calibration, CalibrationOrigin};
use offbd_core::engine::{Rig, Setup, calibrate_with_prospects};
use offbd_core::vocabulary::Sample;
use offbd_store::{CalibrationRow, SessionRow, Store, Write};
use offbd_wire::asset;
use offbd_wire::service::TrainingDataView;
use offbd_wire::session_csv;
use offbd_wire::words::JobState;

/// Runs a calibration to completion, or until the service shuts down: then it restarts with
/// the next start.
pub(super) async fn run(context: &JobContext, id: &str) -> Result<(), ServiceError> {
    let Some(mut row) = context.handles.store.calibration(id).await? else { return Ok(()) };
    row.state = JobState::Running.to_string();
    context.handles.write(&row.asset, vec![Write::PutCalibration(row.clone())]).await?;
    let (store, runtime, job) =
        (context.handles.store.clone(), context.handles.runtime.clone(), row.clone());
    let learning = tokio::task::spawn_blocking(move || learn(&store, &runtime, &job));
    let learnt = tokio::select! {
        () = context.handles.closing.cancelled() => return Ok(()),
        learnt = learning => learnt,
    };
    match learnt.unwrap_or_else(|_| Err("the calibration failed with an internal error".to_owned()))
    {
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
    let (reply, answer) = Reply::new();
    let finish = AssetCommand::FinishCalibration { row: Box::new(row), reply };
    context.shards.send(&asset, finish).await?;
    match answer.wait().await {
        // The asset has been deleted meanwhile.
        Err(ServiceError::UnknownAsset { .. }) => Ok(()),
        outcome => outcome,
    }
}

/// Learns the calibration of `row`.
///
/// # Errors
/// A sentence that states why the recordings are not sufficient.
fn learn(store: &Store, runtime: &Handle, row: &CalibrationRow) -> Result<Calibration, String> {
    let text = |error: ServiceError| error.to_string();
    let rig = runtime.block_on(rig(store, &row.asset)).map_err(text)?;
    let refines = rig.calibration.is_some();
    let sessions = runtime.block_on(recordings(store, row, refines)).map_err(text)?;
    let mut hash = Sha256::new();
    sessions.iter().for_each(|samples| hash.update(csv(samples)));
    let data_sha256 = HEXLOWER.encode(&hash.finalize());
    let calibration = calibrate_with_prospects(&rig, &sessions).map_err(|e| e.to_string())?;
    let origin = CalibrationOrigin { data_sha256, made_at: rfc3339(row.made_at) };
    Ok(Calibration { origin, ..calibration })
}

/// Returns the recordings that a calibration learns from: the sessions and stretches that a
/// person chose, otherwise those in the rig's learning record. Deleted sessions are
/// omitted; a calibration that `refines` another one fails instead.
async fn recordings(
    store: &Store,
    row: &CalibrationRow,
    refines: bool,
) -> Result<Vec<Vec<Sample>>, ServiceError> {
    let record = store.learning(&row.asset).await?;
    let record: LearningRecord =
        record.as_deref().map(views::from_json).transpose()?.unwrap_or_default();
    let (mut room, mut sessions) = (MAX_CALIBRATION_SAMPLES, Vec::new());
    if let Some(training) = record.sessions_of(&row.id) {
        for session in training {
            if !refines && store.session(&session.id).await?.is_none() {
                continue;
            }
            let samples = latest(store, session, room).await?;
            room -= samples.len();
            sessions.push(samples);
        }
        return Ok(sessions);
    }
    let chosen: Vec<TrainingDataView> = views::from_json(&row.sessions)?;
    for data in &chosen {
        let samples = recording(store, data, room).await?;
        room -= samples.len();
        sessions.push(samples);
    }
    Ok(sessions)
}

/// Returns the last samples, at most `room`, of the part of a session to learn from.
///
/// # Errors
/// [`ServiceError::UnknownSession`] if it has been deleted.
async fn latest(
    store: &Store,
    session: &TrainingSession,
    room: usize,
) -> Result<Vec<Sample>, ServiceError> {
    let TrainingSession { id, n_samples, .. } = session;
    let first = (n_samples - i64::try_from(room).unwrap_or(i64::MAX)).max(0);
    let wanted = usize::try_from(n_samples - first).unwrap_or_default();
    let mut reader = store.recording(&session_row(store, id).await?, first);
    let mut samples: Vec<Sample> = Vec::new();
    while samples.len() < wanted
        && let Some(chunk) = reader.next().await?
    {
        samples.extend(chunk);
    }
    samples.truncate(wanted);
    Ok(samples)
}

/// Returns the rig of the asset, after checking that its set-up is valid.
async fn rig(store: &Store, asset: &str) -> Result<Rig, ServiceError> {
    let row = store.asset(asset).await?;
    let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: asset.to_owned() })?;
    let rig = views::rig(&row.document)?;
    Setup::new(rig.clone(), None)?;
    Ok(rig)
}

async fn session_row(store: &Store, id: &str) -> Result<SessionRow, ServiceError> {
    let row = store.session(id).await?;
    row.ok_or_else(|| ServiceError::UnknownSession { id: id.to_owned() })
}

/// Returns the samples of `data`.
///
/// # Errors
/// [`ServiceError::TooMany`] if there are more than `room`; [`ServiceError::UnknownSession`]
/// if the session has been deleted.
async fn recording(
    store: &Store,
    data: &TrainingDataView,
    room: usize,
) -> Result<Vec<Sample>, ServiceError> {
    let row = session_row(store, data.session()).await?;
    let mut reader = store.stretch(&row, data.range()).await?;
    let mut samples: Vec<Sample> = Vec::new();
    while let Some(chunk) = reader.next().await? {
        samples.extend(chunk);
        if samples.len() > room {
            let (what, limit) =
                ("samples in the sessions of a calibration", MAX_CALIBRATION_SAMPLES);
            return Err(ServiceError::TooMany { what, limit });
        }
    }
    Ok(samples)
}

/// Returns `samples` as an exported session file, whose hash identifies the data.
fn csv(samples: &[Sample]) -> Vec<u8> {
    let mut text = Vec::new();
    // Writing to a vector cannot fail.
    let _ = session_csv::write(&mut text, samples);
    text
}
