//! The background scrub: reads every recording now and then, so that damage is known before
//! the data are needed, and compares the snapshot of every open session, and the verdict of some
//! ended ones, with the recording, judged again from the start.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::verdict_check::VerdictCheck;
use crate::asset::{AssetCommand, Shards};
use crate::playback::play;
use crate::writing::Handles;
use crate::{ServiceError, snapshots, views};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Admission, Input, Setup, UsableMotion};
use offbd_store::{SessionRow, Snapshot};
use offbd_wire::judging::Judging;

/// Samples after which the scrub pauses.
const SAMPLES_AT_ONCE: i64 = 8192;

/// Duration of a pause, as a multiple of the work before it: a twentieth of a core. Chosen.
pub(super) const PAUSE_FACTOR: u32 = 19;

/// Longest pause within a session, so that it does not delay a shutdown.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// Pause after a session. Chosen.
const PAUSE_AFTER_SESSION: Duration = Duration::from_millis(50);

/// Pause after all sessions. Chosen: damage is rare.
pub(super) const PAUSE_AFTER_ALL: Duration = Duration::from_secs(3600);

/// Of the ended sessions, one in as many is judged again. Chosen: judging takes some twenty
/// times as long as reading, so that a round takes twice as long as without it.
const JUDGED_OF: i64 = 16;

/// The kinds of findings, as a label of a metric.
const RECORDING: &str = "recording";
const ENGINE: &str = "engine";
const VERDICT: &str = "verdict";

/// The background task of the scrub.
pub(crate) struct Scrubber {
    pub(crate) handles: Handles,
    pub(crate) shards: Shards,
}

/// What the scrub found in a session.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Finding {
    /// The recording cannot be read.
    Damage(String),
    /// The engine has another state than the recording gives.
    Snapshot,
    /// The recording gives another verdict than the stored one.
    Verdict,
}

impl Scrubber {
    /// Goes through all sessions again and again until the service shuts down.
    pub(crate) async fn run(self) {
        count_sessions(0);
        for kind in [RECORDING, ENGINE, VERDICT] {
            count_findings(kind, 0);
        }
        let closing = self.handles.closing.clone();
        closing.run_until_cancelled(self.forever()).await;
    }

    async fn forever(self) {
        let mut last = String::new();
        // Begins anywhere: other sessions are judged after each start.
        let mut n_ended = self.handles.clock.now() % JUDGED_OF;
        loop {
            let pause = match self.next(&mut last, &mut n_ended).await {
                Ok(true) => PAUSE_AFTER_SESSION,
                Ok(false) => PAUSE_AFTER_ALL,
                Err(error) => {
                    tracing::warn!(%error, "the scrub cannot read a session; it goes on later");
                    PAUSE_AFTER_ALL
                }
            };
            tokio::time::sleep(pause).await;
        }
    }

    /// Examines the session after `last`, which becomes `last`; `n_ended` counts the ended
    /// ones. Returns `false` after the last one.
    async fn next(&self, last: &mut String, n_ended: &mut i64) -> Result<bool, ServiceError> {
        let store = &self.handles.store;
        let Some(id) = store.session_after(last).await? else {
            last.clear();
            return Ok(false);
        };
        last.clone_from(&id);
        let Some(session) = store.session(&id).await? else { return Ok(true) };
        if !self.handles.ownership.owns(&session.asset) {
            return Ok(true);
        }
        *n_ended += i64::from(!session.is_open());
        let judges = *n_ended % JUDGED_OF == 0;
        let (asset, handles) = (session.asset.clone(), self.handles.clone());
        let examine = move || examine(&handles, &session, judges, pause);
        match tokio::task::spawn_blocking(examine).await {
            Ok(Ok(None)) => count_sessions(1),
            Ok(Ok(Some(finding))) => self.report(&id, &asset, finding).await,
            // It was deleted meanwhile.
            Ok(Err(ServiceError::UnknownSession { .. })) => {}
            Ok(Err(error)) => return Err(error),
            Err(_) => tracing::error!(session = id, "the scrub of a session panicked"),
        }
        Ok(true)
    }

    async fn report(&self, session: &str, asset: &str, finding: Finding) {
        let kind = match finding {
            Finding::Damage(what) => {
                tracing::error!(session, asset, what, "a recording is damaged");
                RECORDING
            }
            Finding::Snapshot => {
                tracing::error!(session, asset, "an engine differs from its recording");
                let rebuilt = self.shards.call(asset, |reply| AssetCommand::Rebuild { reply });
                if let Err(error) = rebuilt.await {
                    tracing::error!(session, asset, %error, "the engine cannot be rebuilt");
                }
                ENGINE
            }
            Finding::Verdict => {
                tracing::error!(session, asset, "a verdict differs from its recording");
                VERDICT
            }
        };
        count_findings(kind, 1);
    }
}

fn count_sessions(n: u64) {
    metrics::counter!("offbd_scrub_sessions_total").increment(n);
}

pub(super) fn count_findings(kind: &'static str, n: u64) {
    metrics::counter!("offbd_scrub_findings_total", "kind" => kind).increment(n);
}

/// Waits for a multiple of the time that the work before took.
fn pause(worked: Duration) {
    std::thread::sleep((worked * PAUSE_FACTOR).min(LONGEST_PAUSE));
}

/// Reads the recording of `session`, and judges it again if there is a snapshot to compare
/// with or, if it `judges` ended ones, a verdict. Calls `pause` now and then, and at the end,
/// with the duration of the work since the last call. Returns `None` also if the service shuts
/// down. Blocks on the store.
#[expect(clippy::disallowed_methods, reason = "pauses are a multiple of the work")]
fn examine(
    handles: &Handles,
    session: &SessionRow,
    judges: bool,
    pause: impl Fn(Duration),
) -> Result<Option<Finding>, ServiceError> {
    let (mut comparison, mut n, mut since) = (None, 0, Instant::now());
    let played = Comparison::start(handles, session, judges).and_then(|started| {
        comparison = started;
        play(handles, session, 0, |input| {
            if let Some(comparison) = &mut comparison {
                comparison.take(input, n);
            }
            n += i64::from(matches!(input, Input::NewSample(_)));
            if n % SAMPLES_AT_ONCE == 0 {
                pause(since.elapsed());
                since = Instant::now();
            }
            match handles.closing.is_cancelled() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        })
    });
    pause(since.elapsed());
    match played {
        Err(ServiceError::Corrupt { what }) => return Ok(Some(Finding::Damage(what))),
        played => played?,
    }
    if handles.closing.is_cancelled() {
        return Ok(None);
    }
    Ok(comparison.and_then(Comparison::end))
}

/// What the recording of a session is compared with.
enum Comparison {
    Snapshot(Box<SnapshotCheck>),
    Verdict(Box<VerdictCheck>),
}

impl Comparison {
    /// Returns `None` if there is nothing to compare `session` with, or if it has ended and is
    /// not one that is judged.
    fn start(
        handles: &Handles,
        session: &SessionRow,
        judges: bool,
    ) -> Result<Option<Self>, ServiceError> {
        Ok(match (session.is_open(), judges) {
            (true, _) => SnapshotCheck::start(handles, session)?.map(Box::new).map(Self::Snapshot),
            (false, true) => VerdictCheck::start(session)?.map(Box::new).map(Self::Verdict),
            (false, false) => None,
        })
    }

    /// Takes the next input, after `n` samples.
    fn take(&mut self, input: Input, n: i64) {
        match self {
            Self::Snapshot(check) => check.take(input, n),
            Self::Verdict(check) => check.take(input),
        }
    }

    /// Returns the finding at the end of the recording.
    fn end(self) -> Option<Finding> {
        match self {
            Self::Snapshot(check) => (check.differs == Some(true)).then_some(Finding::Snapshot),
            Self::Verdict(check) => check.differs().then_some(Finding::Verdict),
        }
    }
}

/// Compares a snapshot with the engine that evaluates the recording from its start.
struct SnapshotCheck {
    snapshot: Snapshot,
    judging: Judging,
    motion: Option<UsableMotion>,
    /// The result, once the sample of the snapshot is reached.
    differs: Option<bool>,
}

impl SnapshotCheck {
    /// Returns `None` if the open `session` has no snapshot of its present settings.
    fn start(handles: &Handles, session: &SessionRow) -> Result<Option<Self>, ServiceError> {
        let setup = Setup::new(views::rig(&session.setup)?, None)?;
        let Some((snapshot, restored)) = snapshots::last(handles, session, &setup, i64::MAX)?
        else {
            return Ok(None);
        };
        let motion = restored.motion.map(|_| UsableMotion::new(&setup.rig));
        let baseline: FaultMemory = views::memory(&session.baseline)?;
        let judging = Judging::new(setup, baseline);
        Ok(Some(Self { snapshot, judging, motion, differs: None }))
    }

    /// Takes the next input, after `n` samples.
    fn take(&mut self, input: Input, n: i64) {
        if self.differs.is_some() {
            return;
        }
        let admission = self.judging.input(input);
        let Input::NewSample(sample) = input else { return };
        if let (Some(Admission::Accepted), Some(motion)) = (admission, &mut self.motion) {
            motion.take(&sample);
        }
        if n + 1 == self.snapshot.n_samples {
            let state = snapshots::state(&self.judging, self.motion.as_ref());
            self.differs = Some(state.is_ok_and(|state| state != self.snapshot.state));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::{Clock, Limits, Service};
    use offbd_core::vocabulary::Sample;
    use offbd_store::ChangeSet;
    use offbd_store::{AssetRow, Location, SessionEnd, SessionProgress, Store, Write};

    /// The lengths of the work between the pauses in a session of `n_samples`.
    async fn works(n_samples: usize) -> Vec<Duration> {
        let folder = tempfile::tempdir().unwrap();
        let location = Location::File(folder.path().join("offbd.sqlite"));
        let (store, mut writer) = Store::open(&location).await.unwrap();
        let asset = AssetRow { name: "a".to_owned(), ..AssetRow::default() };
        let row = SessionRow { id: "s".to_owned(), asset: "a".to_owned(), ..SessionRow::default() };
        let samples =
            (0..n_samples).map(|i| Sample { t_s: i as f64, ..Sample::default() }).collect();
        let progress = SessionProgress { n_samples: n_samples as i64, ..Default::default() };
        let append = Write::Append { session: "s".to_owned(), first_index: 0, samples, progress };
        let (session, verdict) = ("s".to_owned(), "{}".to_owned());
        let end = Write::EndSession(SessionEnd { session, verdict, ..SessionEnd::default() });
        let mut set = vec![Write::CreateAsset(asset), Write::OpenSession(row), append, end];
        writer.commit(&mut [ChangeSet::unpartitioned(&mut set)]).await.unwrap();
        let session = store.session("s").await.unwrap().unwrap();
        let (service, _parts) =
            Service::assemble(store, writer, Limits::default(), None, None, Clock::System);
        let handles = service.inner.handles.clone();
        tokio::task::spawn_blocking(move || {
            let works = Mutex::new(Vec::new());
            let found = examine(&handles, &session, false, |work| works.lock().unwrap().push(work));
            assert_eq!(found.unwrap(), None);
            works.into_inner().unwrap()
        })
        .await
        .unwrap()
    }

    /// Without a pause after each, many short sessions would take more than their share of a core.
    #[tokio::test(flavor = "multi_thread")]
    async fn all_work_is_followed_by_a_pause() {
        assert_eq!(works(100).await.len(), 1);
        assert_eq!(works(20_000).await.len(), 3);
        assert!(works(100).await.iter().all(|work| !work.is_zero()));
    }
}
