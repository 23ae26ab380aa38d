//! The recording of a fault: the samples in a time window around it, with measured and
//! predicted accelerations and limits, which are computed by evaluating the session again
//! up to the end of the window. Available until the session is deleted.

use std::ops::ControlFlow;

use crate::playback::play;
use crate::writing::Handles;
use crate::{ServiceError, snapshots, views};
use offbd_core::diagnosis::{Evidence, StatusByte};
use offbd_core::engine::{Input, Setup};
use offbd_core::vocabulary::{FaultCode, Invalid, Sample, TimeRange};
use offbd_store::{SessionRow, Store};
use offbd_wire::basis::Basis;
use offbd_wire::recording::{RecordingColumnsView, RecordingRow, RecordingView};
use offbd_wire::verdict::FaultView;
use offbd_wire::words::StatusWord;

/// Longest time before the onset or after the confirmation, s.
const MAX_WINDOW_S: f64 = 60.0;

/// Limit of the samples to evaluate: up to the end of the window, from the last snapshot
/// before it, or from the start of the session without one; a day at 100 Hz. Beyond it the
/// request is refused.
const MAX_EVALUATED: usize = 10_000_000;

/// Limit of rows: the longest window at 1 kHz, with margin. Beyond it the request is
/// refused.
const MAX_ROWS: usize = 200_000;

/// Transitions that are read per query, newest first.
const PAGE: u32 = 100;

/// Samples between two checks whether the service is shutting down.
const CHECK_EVERY: usize = 1024;

/// The time window of a fault recording.
#[derive(Clone, Copy, Debug)]
pub struct RecordingWindow {
    /// Time before the onset, 0 to 60 s.
    pub before_s: f64,
    /// Time after the confirmation, 0 to 60 s.
    pub after_s: f64,
}

impl RecordingWindow {
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        for (element, seconds) in [("?before_s", self.before_s), ("?after_s", self.after_s)] {
            if !(0.0..=MAX_WINDOW_S).contains(&seconds) {
                return Err(Invalid::new(
                    element,
                    format!("{seconds} is not in [0, {MAX_WINDOW_S}]"),
                ));
            }
        }
        Ok(())
    }
}

/// The times of one failure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FailureTimes {
    onset_s: Option<f64>,
    failed_s: f64,
    confirmed_s: Option<f64>,
}

/// Returns the last failure of `code` in `session`.
pub(crate) async fn last_failure(
    store: &Store,
    session: &str,
    code: FaultCode,
) -> Result<Option<FailureTimes>, ServiceError> {
    let (mut search, mut before) = (FailureSearch::default(), i64::MAX);
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

/// Searches the transitions of one code, newest first, for the last failure.
#[derive(Default)]
struct FailureSearch {
    found: Option<FailureTimes>,
}

impl FailureSearch {
    /// Adds the next older transition. Returns whether the search is complete, because the
    /// code had not failed yet at this transition.
    fn take(&mut self, fault: &FaultView) -> bool {
        let bits = u8::from_str_radix(&fault.status_byte, 16).unwrap_or_default();
        if !StatusByte::from_bits(bits).test_failed() {
            return self.found.is_some();
        }
        let confirmed = fault.status == StatusWord::Confirmed;
        let later = self.found.and_then(|found| found.confirmed_s);
        self.found = Some(FailureTimes {
            onset_s: fault.onset_s,
            failed_s: fault.t_s,
            confirmed_s: if confirmed { Some(fault.t_s) } else { later },
        });
        false
    }
}

/// Computes the recording of `failure` by evaluating the session again.
///
/// # Errors
/// [`ServiceError::TooMany`] beyond the limits; [`ServiceError::Store`];
/// [`ServiceError::Corrupt`].
pub(crate) fn fault_recording(
    handles: &Handles,
    session: &SessionRow,
    code: FaultCode,
    failure: &FailureTimes,
    window: RecordingWindow,
) -> Result<(RecordingView, Vec<RecordingRow>), ServiceError> {
    let setup = Setup::new(views::rig(&session.setup)?, None)?;
    let basis = Basis::of(&setup);
    let from_s =
        failure.onset_s.unwrap_or(failure.failed_s).min(failure.failed_s) - window.before_s;
    let to_s = failure.confirmed_s.unwrap_or(failure.failed_s) + window.after_s;
    let rows = evaluate(handles, session, setup, failure.failed_s, (from_s, to_s))?;
    let view = RecordingView {
        asset: session.asset.clone(),
        code: code.into(),
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
        columns: RecordingColumnsView::default(),
    };
    Ok((view, rows))
}

/// Returns the samples from `from_s` to `to_s` in order of time, each with the evidence of
/// its evaluation. The end of the range is reached after the failure at `failed_s`: the
/// clock may have passed these times before, and have been set back.
fn evaluate(
    handles: &Handles,
    session: &SessionRow,
    setup: Setup,
    failed_s: f64,
    (from_s, to_s): (f64, f64),
) -> Result<Vec<RecordingRow>, ServiceError> {
    let mut builder = RecordingBuilder::new(from_s, to_s);
    let range = TimeRange { from_s, to_s };
    let (first, _) = handles.wait(handles.store.indexes(session, range))?;
    let (first, mut judging) = snapshots::engine_before(handles, session, setup, first)?;
    let (mut n_evaluated, mut has_failed, mut ended) = (0, false, true);
    play(handles, session, first, |input| {
        if let Input::NewSample(sample) = &input {
            n_evaluated += 1;
            builder.sample(sample);
            let closing = n_evaluated % CHECK_EVERY == 0 && handles.closing.is_cancelled();
            let is_past = judging.engine().evidence().at.is_some_and(|at| at.seconds() > to_s);
            ended = !(closing || has_failed && is_past);
            if !ended || n_evaluated > MAX_EVALUATED || builder.samples.len() > MAX_ROWS {
                return ControlFlow::Break(());
            }
        }
        judging.observe(input, |evidence| builder.evidence(evidence));
        has_failed |= judging.transitions().iter().any(|t| t.at.seconds() == failed_s);
        ControlFlow::Continue(())
    })?;
    if n_evaluated > MAX_EVALUATED {
        let what = "samples to evaluate for this window";
        return Err(ServiceError::TooMany { what, limit: MAX_EVALUATED });
    }
    if builder.samples.len() > MAX_ROWS {
        return Err(ServiceError::TooMany { what: "samples in a recording", limit: MAX_ROWS });
    }
    if ended {
        // Evaluates the samples that are still in the reordering buffer.
        judging.observe(Input::End, |evidence| builder.evidence(evidence));
    }
    Ok(builder.rows())
}

/// Collects the samples and the evidence between two times.
struct RecordingBuilder {
    from_s: f64,
    to_s: f64,
    samples: Vec<Sample>,
    /// In order of time.
    evidence: Vec<(f64, Evidence)>,
}

impl RecordingBuilder {
    const fn new(from_s: f64, to_s: f64) -> Self {
        Self { from_s, to_s, samples: Vec::new(), evidence: Vec::new() }
    }

    fn contains(&self, t_s: f64) -> bool {
        (self.from_s..=self.to_s).contains(&t_s)
    }

    fn sample(&mut self, sample: &Sample) {
        if self.contains(sample.t_s) {
            self.samples.push(*sample);
        }
    }

    fn evidence(&mut self, evidence: &Evidence) {
        let Some(t_s) = evidence.at.map(|at| at.seconds()) else { return };
        let newer = self.evidence.last().is_none_or(|(last_s, _)| *last_s < t_s);
        if newer && self.contains(t_s) {
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
    use offbd_core::diagnosis::{Suspicion, Transition};
    use offbd_core::vocabulary::{FaultStatus, SimTime};
    use offbd_wire::verdict::fault_view;

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

    /// Returns the result of the search in `faults`, oldest first.
    fn found(faults: &[FaultView]) -> Option<FailureTimes> {
        let mut search = FailureSearch::default();
        let _ = faults.iter().rev().find(|fault| search.take(fault));
        search.found
    }

    #[test]
    fn the_search_finds_the_last_failure() {
        let x = FaultCode::XServo;
        let faults = [
            fault(x, 5.0, 0x27),
            fault(x, 5.5, 0x2F),
            fault(x, 9.0, 0x2E),
            fault(x, 20.0, 0x2F),
            fault(x, 30.0, 0x2E),
        ];
        let failure = |onset_s, failed_s, confirmed_s| {
            Some(FailureTimes { onset_s: Some(onset_s), failed_s, confirmed_s })
        };
        assert_eq!(found(&faults[..1]), failure(4.0, 5.0, None));
        assert_eq!(found(&faults[..2]), failure(4.0, 5.0, Some(5.5)));
        assert_eq!(found(&faults[..3]), failure(4.0, 5.0, Some(5.5)));
        assert_eq!(found(&faults), failure(19.0, 20.0, Some(20.0)));
        assert_eq!(found(&[]), None);
    }
}
