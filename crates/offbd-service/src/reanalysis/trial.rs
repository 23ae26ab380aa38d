//! Counts the alarms that other limits and debounce times raise on a recorded session: judges
//! the whole recording by itself with them, and keeps nothing but the counts.

use std::ops::ControlFlow;

use crate::ServiceError;
use crate::background::Priority;
use crate::playback::play_in_background;
use crate::replay_settings;
use crate::writing::Handles;
use offbd_core::diagnosis::{FaultMemory, MemoryRules, Transition};
use offbd_core::engine::{Engine, Input, Trial};
use offbd_core::vocabulary::FaultCode;
use offbd_store::SessionRow;
use offbd_wire::service::ReplaySettingsView;
use offbd_wire::trace::ThresholdsView;
use offbd_wire::trial::{TrialView, TriedMonitorView};

/// Limit of the samples of the session, which take several seconds of one core. A longer one
/// is refused.
const MAX_TRIED_SAMPLES: i64 = 2_000_000;

/// Limit of the times of alarms for each monitor; further ones are only counted.
const MAX_ALARM_TIMES: usize = 500;

/// Tries other limits and debounce times on `session`; ends early if the service shuts down.
///
/// # Errors
/// [`ServiceError::TooMany`] if the session is too long; [`ServiceError::Invalid`] for
/// invalid settings.
pub(crate) fn try_out(
    handles: &Handles,
    session: &SessionRow,
    settings: &ReplaySettingsView,
    trial: &Trial,
) -> Result<TrialView, ServiceError> {
    if session.progress.n_samples > MAX_TRIED_SAMPLES {
        let limit = usize::try_from(MAX_TRIED_SAMPLES).unwrap_or(usize::MAX);
        return Err(ServiceError::TooMany { what: "samples in the session", limit });
    }
    let mut setup = replay_settings::setup(session, settings, None)?;
    // A fault that must occur in several sessions to be confirmed would never be in one.
    setup.settings.memory = MemoryRules::default();
    let mut engine = Engine::new(setup, FaultMemory::default()).with_trial(trial);
    let (mut transitions, mut counter) = (Vec::new(), AlarmCounter::default());
    play_in_background(handles, session, Priority::Low, |input| {
        engine.handle(input, &mut transitions);
        transitions.drain(..).for_each(|transition| counter.take(&transition));
        match handles.closing.is_cancelled() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    })?;
    engine.handle(Input::End, &mut transitions);
    transitions.iter().for_each(|transition| counter.take(transition));
    Ok(counter.view(ThresholdsView::of(&engine)))
}

/// What was counted of one code.
#[derive(Clone, Debug, Default)]
struct CodeCount {
    is_failing: bool,
    is_alarm: bool,
    n_failures: u64,
    n_alarms: u64,
    alarms_t_s: Vec<f64>,
}

/// Counts failures and alarms in the changes of faults.
#[derive(Debug, Default)]
struct AlarmCounter([CodeCount; FaultCode::COUNT]);

impl AlarmCounter {
    fn take(&mut self, transition: &Transition) {
        let count = &mut self.0[transition.code as usize];
        let is_failing = transition.byte.test_failed();
        let is_alarm = is_failing && transition.byte.confirmed();
        count.n_failures += u64::from(is_failing && !count.is_failing);
        if is_alarm && !count.is_alarm {
            count.n_alarms += 1;
            if count.alarms_t_s.len() < MAX_ALARM_TIMES {
                count.alarms_t_s.push(transition.at.seconds());
            }
        }
        (count.is_failing, count.is_alarm) = (is_failing, is_alarm);
    }

    /// Returns the counts; `thresholds` are in the order of the codes.
    fn view(self, thresholds: Vec<ThresholdsView>) -> TrialView {
        let monitor = |(count, thresholds): (CodeCount, ThresholdsView)| TriedMonitorView {
            thresholds,
            failures: count.n_failures,
            alarms: count.n_alarms,
            alarms_t_s: count.alarms_t_s,
        };
        TrialView { monitors: self.0.into_iter().zip(thresholds).map(monitor).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::{Evidence, StatusByte, Suspicion};
    use offbd_core::vocabulary::{FaultStatus, SimTime};

    #[test]
    fn an_alarm_is_counted_when_it_begins_and_not_while_it_lasts() {
        let mut counter = AlarmCounter::default();
        let changes = [(1.0, 0x27), (2.0, 0x2F), (2.5, 0x2F), (3.0, 0x2E), (4.0, 0x2F)];
        for (t_s, bits) in changes {
            counter.take(&Transition {
                at: SimTime::new(t_s).unwrap(),
                code: FaultCode::YServo,
                status: FaultStatus::Confirmed,
                byte: StatusByte::from_bits(bits),
                suspicion: Suspicion::default(),
                evidence: Evidence::default(),
            });
        }
        let count = &counter.0[FaultCode::YServo as usize];
        assert_eq!((count.n_failures, count.n_alarms), (2, 2));
        assert_eq!(count.alarms_t_s, [2.0, 4.0]);
        assert_eq!(counter.0[FaultCode::XServo as usize].n_failures, 0);
    }
}
