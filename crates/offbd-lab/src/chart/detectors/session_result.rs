//! The outcome of each detector, and of the engine's verdict, for one session.

use super::method::Detector;
use super::trace::{FaultReport, Trace, code_of};
use offbd_core::vocabulary::{FaultCode, PerAxis};

/// Time after a false alarm in which no further one is counted, s; chosen. An alarm that
/// lasts is counted once per such interval.
pub(super) const REARM_S: f64 = 10.0;

/// The outcome of one detector for a session.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DetectorOutcome {
    /// Number of false alarms in a healthy session.
    pub(super) alarms: u32,
    /// Time from the fault's first chance to the first alarm after its onset, s, at least
    /// 0; `None`: missed.
    pub(super) delay_s: Option<f64>,
    /// Whether that alarm accused the faulty component.
    pub(super) right: bool,
}

/// The outcomes of all detectors for one session.
#[derive(Clone, Debug)]
pub(super) struct SessionResult {
    /// The fault; `None`: healthy.
    pub(super) fault: Option<&'static str>,
    /// Whether the session is healthy or its fault had a chance to be detected.
    pub(super) counts: bool,
    pub(super) seconds: f64,
    /// The outcome of each detector.
    pub(super) outcomes: Vec<DetectorOutcome>,
    /// The outcome of the engine's verdict, counting pending faults, and confirmed ones
    /// only.
    pub(super) verdicts: [DetectorOutcome; 2],
}

impl SessionResult {
    pub(super) fn of(detectors: &[Detector], trace: &Trace, healthy_m_s2: &PerAxis<f64>) -> Self {
        let of = |detector: &Detector| {
            let alarms = detector.alarms(trace, healthy_m_s2);
            outcome(trace, alarms.map(|(t, axis)| (t, FaultCode::servo(axis))))
        };
        let verdict = |counts: fn(&FaultReport) -> bool| {
            let alarms = trace.verdicts.iter().filter(|v| counts(v));
            outcome(trace, alarms.map(|v| (v.t_s, v.code)))
        };
        Self {
            fault: trace.fault,
            counts: trace.fault.is_none() || trace.chance_s.is_some(),
            seconds: trace.seconds,
            outcomes: detectors.iter().map(of).collect(),
            verdicts: [verdict(|_| true), verdict(|v| v.confirmed)],
        }
    }
}

/// Returns the outcome of a detector from its alarms in order, with their codes.
fn outcome(trace: &Trace, mut alarms: impl Iterator<Item = (f64, FaultCode)>) -> DetectorOutcome {
    let Some(fault) = trace.fault else {
        return DetectorOutcome {
            alarms: separate(alarms.map(|(t, _)| t)),
            ..DetectorOutcome::default()
        };
    };
    let (Some(onset_s), Some(chance_s)) = (trace.onset_s, trace.chance_s) else {
        return DetectorOutcome::default();
    };
    let first = alarms.find(|(t, _)| *t >= onset_s);
    DetectorOutcome {
        alarms: 0,
        delay_s: first.map(|(t, _)| (t - chance_s).max(0.0)),
        right: first.is_some_and(|(_, code)| code_of(fault) == Some(code)),
    }
}

/// Counts the alarms that are at least [`REARM_S`] apart.
fn separate(moments: impl Iterator<Item = f64>) -> u32 {
    let (mut n, mut armed_s) = (0, f64::NEG_INFINITY);
    for t in moments {
        if t >= armed_s {
            (n, armed_s) = (n + 1, t + REARM_S);
        }
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::vocabulary::Axis;

    #[test]
    fn alarms_are_separate_after_a_while() {
        assert_eq!(separate([].into_iter()), 0);
        assert_eq!(separate([1.0, 2.0, 10.9, 11.0, 40.0].into_iter()), 3);
        assert_eq!(separate((0..720).map(|i| f64::from(i) * 0.05)), 4);
    }

    #[test]
    fn a_delay_counts_from_the_first_chance_and_an_alarm_from_the_onset() {
        let trace = Trace {
            fault: Some("y_servo:dead"),
            onset_s: Some(20.0),
            chance_s: Some(22.0),
            ..Trace::default()
        };
        let of = |alarms: &[(f64, Axis)]| {
            let coded = alarms.iter().map(|&(t, axis)| (t, FaultCode::servo(axis)));
            let found = outcome(&trace, coded);
            (found.delay_s, found.right)
        };
        assert_eq!(of(&[(19.0, Axis::X), (23.5, Axis::Y)]), (Some(1.5), true));
        assert_eq!(of(&[(21.0, Axis::Y)]), (Some(0.0), true));
        assert_eq!(of(&[(23.0, Axis::X), (23.5, Axis::Y)]), (Some(1.0), false));
        assert_eq!(of(&[(19.0, Axis::Y)]), (None, false));
    }
}
