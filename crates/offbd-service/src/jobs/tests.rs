use tokio::sync::OwnedSemaphorePermit;

use crate::background::Priority;
use crate::job::{Job, JobQueues};
use crate::{Limits, Service, ServiceError, Workers};
use offbd_core::vocabulary::Sample;
use offbd_store::{Location, Store};
use offbd_wire::learning::LearningState;
use offbd_wire::service::{
    CalibrationJobView, JobWaitView, ReplaySettingsView, ReplayView, TrainingDataView,
};
use offbd_wire::telemetry::Batch;
use offbd_wire::words::{JobState, JobWaitReason};

/// A ball that circles for 70 s at 100 Hz, more than a rig needs to learn.
fn circles() -> impl Iterator<Item = Sample> {
    (0..7000).map(|i: u32| {
        let t_s = f64::from(i) / 100.0;
        let (sin, cos) = (2.0 * t_s).sin_cos();
        Sample {
            seq: Some(i.into()),
            t_s,
            cmd_qx_rad: Some(0.03 * sin),
            cmd_qy_rad: Some(0.03 * cos),
            x_m: Some(0.05 * cos),
            y_m: Some(0.05 * sin),
        }
    })
}

/// Sends `circles` of the asset `a`, which is new, and returns its calibration.
async fn learn(service: &Service) -> CalibrationJobView {
    service.create_asset(br#"{ "name": "a" }"#).await.unwrap();
    let rows = circles().map(Ok).collect();
    let batch = Batch { session: Some("s".to_owned()), rows, ..Batch::default() };
    service.submit("a", batch).unwrap().acknowledged().await.unwrap();
    let learning = service.learning("a").await.unwrap();
    assert_eq!(learning.state, LearningState::Learning, "{}", learning.summary);
    service.calibration("a", &learning.calibration.unwrap()).await.unwrap()
}

const fn is_finished(state: JobState) -> bool {
    matches!(state, JobState::Done | JobState::Failed)
}

async fn start(folder: &tempfile::TempDir) -> (Service, Workers) {
    let location = Location::File(folder.path().join("offbd.sqlite"));
    let (store, writer) = Store::open(&location).await.unwrap();
    Service::start(store, writer, Limits::default(), None).await.unwrap()
}

/// Takes permits for half of the samples that may be in flight, so that samples seem queued.
async fn queue_samples(service: &Service) -> OwnedSemaphorePermit {
    let half = u32::try_from(service.limits().requests.in_flight_samples / 2).unwrap();
    service.inner.in_flight.clone().acquire_many_owned(half).await.unwrap()
}

/// Returns the id of the only session of the asset `a`.
async fn session(service: &Service) -> String {
    service.learning("a").await.unwrap().sessions[0].id.clone()
}

/// Replays the session to the end.
async fn replay(service: &Service, session: &str) -> ReplayView {
    let replay = service.replay(session, ReplaySettingsView::default()).await.unwrap();
    loop {
        let replay = service.replay_state(&replay.id).await.unwrap();
        if is_finished(replay.state) {
            return replay;
        }
        tokio::task::yield_now().await;
    }
}

/// Waits until the calibration of the asset `a` `is` so.
async fn until(service: &Service, id: &str, is: impl Fn(JobState) -> bool) -> CalibrationJobView {
    loop {
        let calibration = service.calibration("a", id).await.unwrap();
        if is(calibration.state) {
            return calibration;
        }
        tokio::task::yield_now().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rig_does_not_learn_while_samples_are_queued_and_a_person_does_not_wait() {
    let folder = tempfile::tempdir().unwrap();
    let (service, workers) = start(&folder).await;
    let queued = queue_samples(&service).await;
    let calibration = learn(&service).await;

    let session = session(&service).await;
    replay(&service, &session).await;
    let waiting = service.calibration("a", &calibration.id).await.unwrap();
    assert_eq!(waiting.state, JobState::Queued);
    let reason = JobWaitView { reason: JobWaitReason::Samples, n_before: 0 };
    assert_eq!(waiting.waits, Some(reason));
    let summary = service.learning("a").await.unwrap().summary;
    assert!(summary.ends_with("It waits until fewer samples are queued."), "{summary}");

    drop(queued);
    let done = until(&service, &calibration.id, is_finished).await;
    assert_eq!(done.waits, None);
    drop(service);
    workers.finish().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_calibration_that_runs_stops_at_its_next_step_while_samples_are_queued() {
    let folder = tempfile::tempdir().unwrap();
    let (service, workers) = start(&folder).await;
    let calibration = learn(&service).await;
    until(&service, &calibration.id, |state| state == JobState::Running).await;
    let _queued = queue_samples(&service).await;
    let session = session(&service).await;
    // The calibration by a person of the same samples takes as long, and is not held back.
    let by_person = vec![TrainingDataView::Session(session)];
    let asked = service.calibrate("a", by_person, None).await.unwrap();
    until(&service, &asked.id, is_finished).await;
    let held = service.calibration("a", &calibration.id).await.unwrap();
    assert_eq!(held.state, JobState::Running);

    service.cancel_calibration("a", &calibration.id).await.unwrap();
    let cancelled = until(&service, &calibration.id, is_finished).await;
    assert_eq!(cancelled.error.as_deref(), Some("it was cancelled"));
    drop(service);
    workers.finish().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rig_whose_waiting_calibration_is_cancelled_gathers_more_motion() {
    let folder = tempfile::tempdir().unwrap();
    let (service, workers) = start(&folder).await;
    let _queued = queue_samples(&service).await;
    let calibration = learn(&service).await;
    let cancelled = service.cancel_calibration("a", &calibration.id).await.unwrap();
    assert_eq!((cancelled.state, cancelled.waits), (JobState::Failed, None));
    let learning = service.learning("a").await.unwrap();
    assert_eq!(learning.state, LearningState::Gathering);
    assert_eq!(learning.refused.as_deref(), Some("it was cancelled"));
    assert!(learning.wanted_s > learning.x_s.unwrap(), "{}", learning.summary);
    let again = service.cancel_calibration("a", &calibration.id).await;
    assert!(matches!(again, Err(ServiceError::JobEnded { .. })), "{again:?}");
    drop(service);
    workers.finish().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_replay_that_is_cancelled_while_it_runs_fails() {
    let folder = tempfile::tempdir().unwrap();
    let (service, workers) = start(&folder).await;
    let _queued = queue_samples(&service).await;
    learn(&service).await;
    let done = replay(&service, &session(&service).await).await;
    assert_eq!(done.state, JobState::Done);
    // Once more, by a worker that has begun it when it is cancelled.
    let queues = JobQueues::default();
    queues.asked.resume(Job::Replay(done.id.clone()));
    let running = queues.asked.begin(&service.inner.handles.closing).unwrap();
    assert!(queues.cancel(&done.id).is_some());
    super::replay::run(&service.inner.job_context, &running, Priority::Low).await.unwrap();
    let cancelled = service.replay_state(&done.id).await.unwrap();
    assert_eq!(cancelled.state, JobState::Failed);
    assert_eq!(cancelled.error.as_deref(), Some("it was cancelled"));
    drop(service);
    workers.finish().await;
}
