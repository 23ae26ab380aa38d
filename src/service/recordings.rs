//! The seconds around a fault: the recording of its session is judged again up
//! to there, and what was measured, predicted and allowed is kept beside the
//! samples. Nothing is stored for it and nothing changes; it is there for as
//! long as its session is.

use super::handles::Handles;
use super::playback::{Flow, play};
use super::{Service, ServiceError, views};
use crate::judging::Judging;
use crate::store::{SessionRow, Store};
use crate::wire::basis::Basis;
use crate::wire::recording::{ColumnsView, RecordingRow, RecordingView};
use crate::wire::verdict::FaultView;
use offbd_core::diagnosis::{Evidence, StatusByte};
use offbd_core::engine::{Input, Setup};
use offbd_core::vocabulary::{FaultCode, FaultStatus, Invalid, Sample};

/// Longest time before the onset or after the confirmation, s.
const MAX_AROUND_S: f64 = 60.0;

/// Samples that are judged for one recording: a day at 100 Hz. One whose end
/// lies further into its session is refused.
const MAX_JUDGED: usize = 10_000_000;

/// Rows of a recording: both sides at their longest at 1 kHz, with room. A
/// longer one is refused.
const MAX_ROWS: usize = 200_000;

/// Recordings that are made at a time; the next is told to come again.
pub(super) const MAX_AT_ONCE: usize = 2;

/// Transitions that are read at a time, from the latest back.
const PAGE: u32 = 100;

/// Samples between two looks at whether the service is closing.
const LOOK_EVERY: usize = 1024;

/// How much of it is wanted.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    /// Before the onset, in [0, 60] s.
    pub before_s: f64,
    /// After the confirmation, in [0, 60] s.
    pub after_s: f64,
}

impl Around {
    fn check(&self) -> Result<(), Invalid> {
        for (element, seconds) in [("?before_s", self.before_s), ("?after_s", self.after_s)] {
            if !(0.0..=MAX_AROUND_S).contains(&seconds) {
                return Err(Invalid::new(
                    element,
                    format!("{seconds} is not in [0, {MAX_AROUND_S}]"),
                ));
            }
        }
        Ok(())
    }
}

impl Service {
    /// The seconds around the last occurrence of a fault: what is known of it,
    /// with empty columns, and its rows.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`];
    /// [`ServiceError::NoRecording`] where nothing is on record or the session
    /// is gone; [`ServiceError::Invalid`] for how much of it;
    /// [`ServiceError::TooMany`] for a stretch too far into its session;
    /// [`ServiceError::Busy`].
    pub async fn fault_recording(
        &self,
        asset: &str,
        word: &str,
        around: Around,
    ) -> Result<(RecordingView, Vec<RecordingRow>), ServiceError> {
        around.check()?;
        let entry = self.fault(asset, word).await?;
        let gone = || ServiceError::NoRecording { asset: asset.to_owned(), code: word.to_owned() };
        let occurrence = entry.provenance.last_occurrence.ok_or_else(gone)?;
        let session =
            self.inner.handles.store.session(&occurrence.session_id).await?.ok_or_else(gone)?;
        let code: FaultCode = word.parse().map_err(ServiceError::UnknownCode)?;
        let failure =
            last_failure(&self.inner.handles.store, &session.id, code).await?.ok_or_else(gone)?;
        let busy = |_| ServiceError::Busy { what: "too many recordings are being made" };
        let permit = self.inner.recordings.clone().try_acquire_owned().map_err(busy)?;
        let handles = self.inner.handles.clone();
        let made = tokio::task::spawn_blocking(move || {
            let made = make(&handles, &session, code, &failure, around);
            drop(permit);
            made
        });
        let failed = ServiceError::Unavailable { what: "judging the recording has failed" };
        made.await.unwrap_or(Err(failed))
    }
}

/// The times of one failure.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Failure {
    onset_s: Option<f64>,
    failed_s: f64,
    confirmed_s: Option<f64>,
}

/// The last time that `code` failed anew in `session`.
async fn last_failure(
    store: &Store,
    session: &str,
    code: FaultCode,
) -> Result<Option<Failure>, ServiceError> {
    let (mut search, mut before) = (Backwards::default(), i64::MAX);
    loop {
        let rows = store.transitions_of(session, code.as_str(), before, PAGE).await?;
        let Some(last) = rows.last() else { return Ok(search.found) };
        before = last.ordinal;
        for row in &rows {
            if search.take(&views::from_json(&row.document)?) {
                return Ok(search.found);
            }
        }
    }
}

/// Goes back through the transitions of one code, to where it failed last.
#[derive(Default)]
struct Backwards {
    found: Option<Failure>,
}

impl Backwards {
    /// Takes the transition before the one taken last; returns whether that
    /// one was the first of the failure.
    fn take(&mut self, fault: &FaultView) -> bool {
        let bits = u8::from_str_radix(&fault.status_byte, 16).unwrap_or_default();
        if !StatusByte::from_bits(bits).test_failed() {
            return self.found.is_some();
        }
        let confirmed = fault.status == FaultStatus::Confirmed.as_str();
        let later = self.found.and_then(|found| found.confirmed_s);
        self.found = Some(Failure {
            onset_s: fault.onset_s,
            failed_s: fault.t_s,
            confirmed_s: if confirmed { Some(fault.t_s) } else { later },
        });
        false
    }
}

fn make(
    handles: &Handles,
    session: &SessionRow,
    code: FaultCode,
    failure: &Failure,
    around: Around,
) -> Result<(RecordingView, Vec<RecordingRow>), ServiceError> {
    let setup = Setup::new(views::rig(&session.setup)?, None)?;
    let basis = Basis::of(&setup);
    let from_s =
        failure.onset_s.unwrap_or(failure.failed_s).min(failure.failed_s) - around.before_s;
    let to_s = failure.confirmed_s.unwrap_or(failure.failed_s) + around.after_s;
    let rows = judged(handles, session, setup, from_s, to_s)?;
    let view = RecordingView {
        asset: session.asset.clone(),
        code: code.to_string(),
        session: session.name.clone(),
        session_id: session.id.clone(),
        onset_s: failure.onset_s,
        failed_s: failure.failed_s,
        confirmed_s: failure.confirmed_s,
        from_s,
        to_s,
        complete: !session.is_open() || session.progress.last_t_s.is_some_and(|t_s| t_s > to_s),
        calibration_id: basis.calibration_id,
        settings_id: basis.settings_id,
        columns: ColumnsView::default(),
    };
    Ok((view, rows))
}

/// The samples from `from_s` to `to_s` in order of time, each with what it was
/// judged on.
fn judged(
    handles: &Handles,
    session: &SessionRow,
    setup: Setup,
    from_s: f64,
    to_s: f64,
) -> Result<Vec<RecordingRow>, ServiceError> {
    // A sample is judged when none before it can come any more.
    let enough_s = to_s + 2.0 * setup.settings.reorder_s;
    let mut stretch = Stretch::new(from_s, to_s);
    let mut judging = Judging::new(setup, views::memory(&session.baseline)?);
    let (mut n_judged, mut ended) = (0, true);
    play(handles, &session.id, |input| {
        if let Input::Sample(sample) = &input {
            n_judged += 1;
            stretch.sample(sample);
            let closing = n_judged % LOOK_EVERY == 0 && handles.closing.is_cancelled();
            ended = sample.t_s <= enough_s && !closing;
            if !ended || n_judged > MAX_JUDGED || stretch.samples.len() > MAX_ROWS {
                return Flow::Enough;
            }
        }
        judging.observe(input, |evidence| stretch.evidence(evidence));
        Flow::More
    })?;
    if n_judged > MAX_JUDGED {
        let what = "samples from the beginning of the session to the end of the recording";
        return Err(ServiceError::TooMany { what, limit: MAX_JUDGED });
    }
    if stretch.samples.len() > MAX_ROWS {
        return Err(ServiceError::TooMany { what: "samples in a recording", limit: MAX_ROWS });
    }
    if ended {
        // An open session's last samples wait to be judged; here they need not.
        judging.observe(Input::End, |evidence| stretch.evidence(evidence));
    }
    Ok(stretch.rows())
}

/// What is kept of a session between two times.
struct Stretch {
    from_s: f64,
    to_s: f64,
    samples: Vec<Sample>,
    /// In order of time.
    evidence: Vec<(f64, Evidence)>,
}

impl Stretch {
    const fn new(from_s: f64, to_s: f64) -> Self {
        Self { from_s, to_s, samples: Vec::new(), evidence: Vec::new() }
    }

    fn wants(&self, t_s: f64) -> bool {
        (self.from_s..=self.to_s).contains(&t_s)
    }

    fn sample(&mut self, sample: &Sample) {
        if self.wants(sample.t_s) {
            self.samples.push(*sample);
        }
    }

    fn evidence(&mut self, evidence: &Evidence) {
        let Some(t_s) = evidence.at.map(|at| at.seconds()) else { return };
        let newer = self.evidence.last().is_none_or(|(last_s, _)| *last_s < t_s);
        if newer && self.wants(t_s) {
            self.evidence.push((t_s, evidence.clone()));
        }
    }

    fn rows(mut self) -> Vec<RecordingRow> {
        self.samples.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        let row = |sample: &Sample| {
            let at = self.evidence.binary_search_by(|(t_s, _)| t_s.total_cmp(&sample.t_s));
            RecordingRow::new(sample, at.ok().map(|at| &self.evidence[at].1))
        };
        self.samples.iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::verdict::fault_view;
    use offbd_core::diagnosis::{Suspicion, Transition};
    use offbd_core::vocabulary::SimTime;

    fn fault(code: FaultCode, t_s: f64, bits: u8) -> FaultView {
        let byte = StatusByte::from_bits(bits);
        let transition = Transition {
            at: SimTime::new(t_s).unwrap(),
            code,
            status: if byte.confirmed() { FaultStatus::Confirmed } else { FaultStatus::Pending },
            byte,
            suspicion: Suspicion { onset: SimTime::new(t_s - 1.0), ..Suspicion::default() },
            evidence: Evidence::default(),
        };
        fault_view("s", &Basis::default(), &transition)
    }

    /// What the search finds that meets these, the latest last.
    fn found(faults: &[FaultView]) -> Option<Failure> {
        let mut search = Backwards::default();
        let _ = faults.iter().rev().find(|fault| search.take(fault));
        search.found
    }

    #[test]
    fn the_last_failure_is_found_from_the_latest_back() {
        let x = FaultCode::XServo;
        let faults = [
            fault(x, 5.0, 0x27),
            fault(x, 5.5, 0x2F),
            fault(x, 9.0, 0x2E),
            fault(x, 20.0, 0x2F),
            fault(x, 30.0, 0x2E),
        ];
        let failure = |onset_s, failed_s, confirmed_s| {
            Some(Failure { onset_s: Some(onset_s), failed_s, confirmed_s })
        };
        assert_eq!(found(&faults[..1]), failure(4.0, 5.0, None));
        assert_eq!(found(&faults[..2]), failure(4.0, 5.0, Some(5.5)));
        assert_eq!(found(&faults[..3]), failure(4.0, 5.0, Some(5.5)));
        assert_eq!(found(&faults), failure(19.0, 20.0, Some(20.0)));
        assert_eq!(found(&[]), None);
    }
}
