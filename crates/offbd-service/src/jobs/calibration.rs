//! The calibration job: learns a rig from recordings.

use data_encoding::HEXLOWER;
use sha2::{Digest, Sha256};

use super::CANCELLED;
use super::context::JobContext;
use super::quiet::Quiet;
use crate::asset::{AssetCommand, LearningRecord, MotionSeconds, Reply, TrainingSession};
use crate::background::Priority;
use crate::clock::rfc3339;
use crate::job::RunningJob;
use crate::limits::MAX_CALIBRATION_SAMPLES;
use crate::{ServiceError, views};
use offbd_core::diagnosis::{Calibration, CalibrationOrigin};
use offbd_core::engine::{Rig, Setup, UsableMotion, calibrate_with_prospects_while};
use offbd_core::vocabulary::Sample;
use offbd_store::{CalibrationRow, SessionRow, Store, Write};
use offbd_wire::asset;
use offbd_wire::service::TrainingDataView;
use offbd_wire::session_csv;
use offbd_wire::words::JobState;

/// Longest motion of a session that an automatic calibration learns from, as a multiple of the
/// motion that is wanted, by default 5 minutes. Chosen: a minute is enough, and what
/// comes first tells little about a rig that ages.
const LONGEST_MOTION: f64 = 5.0;

/// Runs a calibration to completion, with this `priority`, or until it is cancelled or the service
/// shuts down: then it restarts with the next start. `quiet` holds it back between its steps.
pub(super) async fn run(
    context: &JobContext,
    running: &RunningJob,
    priority: Priority,
    quiet: &Option<Quiet>,
) -> Result<(), ServiceError> {
    let row = context.handles.store.calibration(running.job.id()).await?;
    let Some(mut row) = row else { return Ok(()) };
    row.state = JobState::Running.to_string();
    context.handles.write(&row.asset, vec![Write::PutCalibration(row.clone())]).await?;
    let (cancelled, quiet) = (running.cancelled.clone(), quiet.clone());
    let go_on = move || {
        if let Some(quiet) = &quiet {
            quiet.pause(&cancelled);
        }
        !cancelled.is_cancelled()
    };
    let learning = learn(&context.handles.store, &row, priority, go_on);
    let learnt = context.handles.closing.run_until_cancelled(learning).await;
    let is_cancelled = running.cancelled.is_cancelled();
    // Afterwards: it also cancels the job.
    let is_closing = context.handles.closing.is_cancelled();
    let Some(learnt) = learnt.filter(|_| !is_closing) else { return Ok(()) };
    match learnt {
        _ if is_cancelled => cancel(&mut row),
        Ok(calibration) => {
            row.state = JobState::Done.to_string();
            row.document = Some(views::to_json(&asset::calibration_view(&calibration))?);
        }
        Err(reason) => {
            row.state = JobState::Failed.to_string();
            row.error = Some(reason);
        }
    }
    match finish(context, row).await {
        // The asset has been deleted meanwhile.
        Err(ServiceError::UnknownAsset { .. }) => Ok(()),
        outcome => outcome,
    }
}

/// Stores that the calibration `row`, which waited, is cancelled.
pub(crate) async fn cancel_waiting(
    context: &JobContext,
    mut row: CalibrationRow,
) -> Result<(), ServiceError> {
    cancel(&mut row);
    finish(context, row).await
}

fn cancel(row: &mut CalibrationRow) {
    row.state = JobState::Failed.to_string();
    row.error = Some(CANCELLED.to_owned());
}

/// Stores the outcome of the calibration `row`.
async fn finish(context: &JobContext, row: CalibrationRow) -> Result<(), ServiceError> {
    let asset = row.asset.clone();
    let (reply, answer) = Reply::new();
    let finish = AssetCommand::FinishCalibration { row: Box::new(row), reply };
    context.shards.send(&asset, finish).await?;
    answer.wait().await
}

/// Learns the calibration of `row`.
///
/// # Errors
/// A sentence that states why the recordings are not sufficient.
async fn learn(
    store: &Store,
    row: &CalibrationRow,
    priority: Priority,
    go_on: impl Fn() -> bool + Send + 'static,
) -> Result<Calibration, String> {
    let text = |error: ServiceError| error.to_string();
    let rig = rig(store, &row.asset).await.map_err(text)?;
    let Recordings { mut sessions, longest_s } =
        recordings(store, row, &rig).await.map_err(text)?;
    let made_at = rfc3339(row.made_at);
    let compute = move || {
        if let Some(longest_s) = longest_s {
            sessions.iter_mut().for_each(|samples| keep_last_motion(&rig, longest_s, samples));
        }
        calibration(&rig, &sessions, made_at, &go_on)
    };
    priority.compute(compute).await.map_err(text)?
}

/// Returns the calibration of `rig` from `sessions`.
fn calibration(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    made_at: String,
    go_on: &dyn Fn() -> bool,
) -> Result<Calibration, String> {
    let mut hash = Sha256::new();
    sessions.iter().for_each(|samples| hash.update(csv(samples)));
    let data_sha256 = HEXLOWER.encode(&hash.finalize());
    let calibration =
        calibrate_with_prospects_while(rig, sessions, go_on).map_err(|e| e.to_string())?;
    let origin = CalibrationOrigin { data_sha256, made_at };
    Ok(Calibration { origin, ..calibration })
}

/// What a calibration learns from.
struct Recordings {
    sessions: Vec<Vec<Sample>>,
    /// The motion of a session that is used, s; `None` for what a person chose, which is used as
    /// a whole.
    longest_s: Option<f64>,
}

/// Keeps only the last samples, in which the rig shows at most `longest_s` of usable motion
/// along the axis with less of it.
fn keep_last_motion(rig: &Rig, longest_s: f64, samples: &mut Vec<Sample>) {
    let mut whole = UsableMotion::new(rig);
    samples.iter().for_each(|sample| whole.take(sample));
    let (whole, mut before) = (MotionSeconds::from(whole.seconds()), UsableMotion::new(rig));
    let first = samples.iter().position(|sample| {
        let left = whole.after(before.seconds().into());
        before.take(sample);
        left.shortest().is_none_or(|left_s| left_s <= longest_s)
    });
    samples.drain(..first.unwrap_or_default());
}

/// Returns the recordings that a calibration learns from: the sessions and stretches that a
/// person chose, otherwise those in the rig's learning record. Deleted sessions are
/// omitted; a calibration that refines that of the `rig` fails instead.
async fn recordings(
    store: &Store,
    row: &CalibrationRow,
    rig: &Rig,
) -> Result<Recordings, ServiceError> {
    let record = store.learning(&row.asset).await?;
    let record: LearningRecord =
        record.as_deref().map(views::from_json).transpose()?.unwrap_or_default();
    let mut sessions = Vec::new();
    if let Some(training) = record.sessions_of(&row.id) {
        // Each has the same room: later sessions are not to be left out for long earlier ones.
        let room = MAX_CALIBRATION_SAMPLES / training.len().max(1);
        for session in training {
            if rig.calibration.is_none() && store.session(&session.id).await?.is_none() {
                continue;
            }
            sessions.push(latest(store, session, room).await?);
        }
        let longest_s = Some(LONGEST_MOTION * record.wanted_s());
        return Ok(Recordings { sessions, longest_s });
    }
    let mut room = MAX_CALIBRATION_SAMPLES;
    let chosen: Vec<TrainingDataView> = views::from_json(&row.sessions)?;
    for data in &chosen {
        let samples = recording(store, data, room).await?;
        room -= samples.len();
        sessions.push(samples);
    }
    Ok(Recordings { sessions, longest_s: None })
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball that circles at 100 Hz for the given seconds, then rests for as many as given.
    fn circles(parts: &[(f64, f64)]) -> Vec<Sample> {
        let mut samples: Vec<Sample> = Vec::new();
        for (seconds, radius_m) in parts {
            for _ in 0..(100.0 * seconds) as u32 {
                let t_s = samples.len() as f64 / 100.0;
                let (sin, cos) = (2.0 * t_s).sin_cos();
                samples.push(Sample {
                    t_s,
                    cmd_qx_rad: Some(0.03 * sin),
                    cmd_qy_rad: Some(0.03 * cos),
                    x_m: Some(radius_m * cos),
                    y_m: Some(radius_m * sin),
                    ..Sample::default()
                });
            }
        }
        samples
    }

    fn seconds_kept(longest_s: f64, mut samples: Vec<Sample>) -> f64 {
        keep_last_motion(&Rig::chapter("a"), longest_s, &mut samples);
        samples.len() as f64 / 100.0
    }

    #[test]
    fn the_last_motion_is_kept_and_rests_do_not_count() {
        let (moving, still) = (0.05, 0.0005);
        let short = circles(&[(50.0, moving)]);
        assert_eq!(seconds_kept(60.0, short.clone()), 50.0);
        // Motion is counted in pieces of 0.4 s, and from three of them on.
        let kept = seconds_kept(20.0, short);
        assert!((19.0..21.0).contains(&kept), "{kept} s");
        let kept = seconds_kept(20.0, circles(&[(50.0, moving), (30.0, still), (10.0, moving)]));
        assert!((49.0..51.5).contains(&kept), "{kept} s");
        assert_eq!(seconds_kept(20.0, circles(&[(50.0, still)])), 50.0);
    }

    #[test]
    fn the_axis_with_less_motion_counts() {
        let mut samples = circles(&[(50.0, 0.05)]);
        samples[..4000].iter_mut().for_each(|sample| sample.y_m = Some(0.0));
        assert_eq!(seconds_kept(20.0, samples.clone()), 50.0);
        samples.iter_mut().for_each(|sample| sample.y_m = None);
        let kept = seconds_kept(20.0, samples);
        assert!((19.0..21.0).contains(&kept), "{kept} s");
    }
}
