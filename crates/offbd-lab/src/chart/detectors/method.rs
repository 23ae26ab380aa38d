//! The detection methods: at each judged time, each returns the accused servo, if any.

use super::trace::{AxisMoment, Moment, Trace};
use offbd_core::diagnosis::{Debounce, DebounceTimes, Profile, Qualified, Settings, Test};
use offbd_core::vocabulary::{Axis, FaultCode, PerAxis};

/// Drifts of the CUSUM, in healthy standard deviations: half of the shift to be detected.
/// Page's for a shift of one deviation, and a larger one that tolerates the model errors
/// of healthy rigs.
const DRIFTS: [f64; 2] = [0.5, 3.0];

/// Maximum interval that one time counts for in the debounce, s; chosen: a gap in the log
/// is not evidence.
const LONGEST_S: f64 = 0.2;

/// A method that detects servo faults, with one threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum DetectionMethod {
    /// The chapter's rule: the current residual, with the chapter's window and gate.
    Chapter,
    /// The residual over a longer window, debounced.
    Debounced,
    /// A two-sided CUSUM of the residual in healthy standard deviations.
    Cusum { drift: f64 },
    /// The log-likelihood ratio of two models of the servo, faulty and healthy.
    Weighed,
}

/// All methods, in the order of the legend.
pub(super) const METHODS: [DetectionMethod; 5] = [
    DetectionMethod::Weighed,
    DetectionMethod::Chapter,
    DetectionMethod::Debounced,
    DetectionMethod::Cusum { drift: DRIFTS[0] },
    DetectionMethod::Cusum { drift: DRIFTS[1] },
];

impl DetectionMethod {
    pub(super) fn name(self) -> String {
        match self {
            Self::Chapter => "chapter's rule".to_owned(),
            Self::Debounced => "debounced residual".to_owned(),
            Self::Cusum { drift } => format!("CUSUM, drift {drift} σ"),
            Self::Weighed => "offbd, weighed".to_owned(),
        }
    }

    pub(super) const fn unit(self) -> &'static str {
        match self {
            Self::Chapter | Self::Debounced => "m/s²",
            Self::Cusum { .. } => "σ",
            Self::Weighed => "nats",
        }
    }

    /// Returns the least and the greatest threshold of the sweep: from constant alarms to
    /// none.
    const fn range(self) -> [f64; 2] {
        match self {
            Self::Chapter => [0.003, 10.0],
            Self::Debounced => [0.01, 3.0],
            Self::Cusum { .. } => [1.0, 10_000.0],
            Self::Weighed => [0.5, 40.0],
        }
    }

    /// Returns the thresholds in use: the chapter's or the engine's, in addition to the
    /// sweep.
    fn chosen(self) -> Vec<f64> {
        let settings = Settings::of(Profile::Default);
        match self {
            Self::Chapter => vec![CHAPTER_M_S2],
            Self::Weighed => vec![settings.suspect_nats, settings.confirm_nats],
            Self::Debounced | Self::Cusum { .. } => Vec::new(),
        }
    }
}

/// The chapter's limit of the residual, m/s² (application 3).
pub(super) const CHAPTER_M_S2: f64 = 0.01;

/// A method that reports a fault beyond a threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Detector {
    pub(super) method: DetectionMethod,
    pub(super) threshold: f64,
    /// Whether the threshold is in use, not part of the sweep.
    pub(super) chosen: bool,
}

/// Returns all methods at `n` thresholds each and at those in use, ascending within each
/// method.
pub(super) fn all(n: usize) -> Vec<Detector> {
    METHODS.iter().flat_map(|&method| sweep(method, n)).collect()
}

fn sweep(method: DetectionMethod, n: usize) -> Vec<Detector> {
    let [least, most] = method.range();
    let share = |i: usize| i as f64 / (n.max(2) - 1) as f64;
    let swept = (0..n).map(|i| (least * (most / least).powf(share(i)), false));
    let chosen = method.chosen().into_iter().map(|threshold| (threshold, true));
    let mut all: Vec<Detector> = swept
        .chain(chosen)
        .map(|(threshold, chosen)| Detector { method, threshold, chosen })
        .collect();
    all.sort_by(|a, b| a.threshold.total_cmp(&b.threshold));
    all
}

impl Detector {
    /// Returns the evidence that the method uses.
    pub(super) fn moments(self, trace: &Trace) -> &[Moment] {
        if self.method == DetectionMethod::Chapter { &trace.textbook } else { &trace.judged }
    }

    /// Returns the times of alarm with the accused servo; if both are suspect, the one with
    /// the stronger evidence.
    pub(super) fn alarms(
        self,
        trace: &Trace,
        healthy_m_s2: &PerAxis<f64>,
    ) -> impl Iterator<Item = (f64, Axis)> {
        let mut watch = DetectorState::new(self, *healthy_m_s2);
        self.moments(trace).iter().filter_map(move |m| Some((m.t_s, watch.take(m)?)))
    }
}

/// A detector with its state during a session.
#[derive(Clone, Debug)]
pub(super) struct DetectorState {
    detector: Detector,
    healthy_m_s2: PerAxis<f64>,
    pace: DebounceTimes,
    last_s: Option<f64>,
    axes: PerAxis<AxisDetectorState>,
}

#[derive(Clone, Copy, Debug, Default)]
struct AxisDetectorState {
    debounce: Debounce,
    /// Sums upward and downward, in healthy deviations.
    sums: [f64; 2],
}

impl DetectorState {
    pub(super) fn new(detector: Detector, healthy_m_s2: PerAxis<f64>) -> Self {
        let pace =
            DebounceTimes::of(FaultCode::XServo, None, false, &Settings::of(Profile::Default));
        Self { detector, healthy_m_s2, pace, last_s: None, axes: PerAxis::default() }
    }

    /// Takes the evidence of one time; returns the accused servo, if any.
    pub(super) fn take(&mut self, moment: &Moment) -> Option<Axis> {
        let dt = self.last_s.map_or(0.0, |last| (moment.t_s - last).min(LONGEST_S));
        self.last_s = Some(moment.t_s);
        let weight = PerAxis::from_fn(|axis| self.weight(axis, &moment.axes[axis], dt));
        match (weight.x, weight.y) {
            (None, None) => None,
            (x, y) if x >= y => Some(Axis::X),
            _ => Some(Axis::Y),
        }
    }

    /// Returns the strength of the evidence against the servo of `axis`; `None` below the
    /// threshold.
    fn weight(&mut self, axis: Axis, e: &AxisMoment, dt: f64) -> Option<f64> {
        let (threshold, watch) = (self.detector.threshold, &mut self.axes[axis]);
        let beyond = |value: f64| (value >= threshold).then_some(value);
        match self.detector.method {
            DetectionMethod::Chapter => beyond(e.residual_m_s2?.abs()),
            DetectionMethod::Weighed => beyond(e.nats),
            DetectionMethod::Debounced => {
                let test = match e.residual_m_s2 {
                    None => Test::NotTested,
                    Some(r) if r.abs() >= threshold => Test::Prefailed,
                    Some(_) => Test::Prepassed,
                };
                let failed = watch.debounce.update(test, dt, &self.pace) >= Qualified::Failed;
                e.residual_m_s2.filter(|_| failed).map(f64::abs)
            }
            DetectionMethod::Cusum { drift } => {
                let z = e.residual_m_s2? / self.healthy_m_s2[axis];
                for (sum, z) in watch.sums.iter_mut().zip([z, -z]) {
                    *sum = (*sum + z - drift).max(0.0);
                }
                let alarm = beyond(watch.sums[0].max(watch.sums[1]))?;
                // Restart after an alarm, as in Page's test.
                watch.sums = [0.0; 2];
                Some(alarm)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the index of the first alarm of the x servo, for residuals 0.05 s apart.
    fn first(method: DetectionMethod, threshold: f64, residuals: &[Option<f64>]) -> Option<usize> {
        let detector = Detector { method, threshold, chosen: false };
        let mut watch = DetectorState::new(detector, PerAxis { x: 0.1, y: 0.1 });
        residuals.iter().enumerate().position(|(i, &residual_m_s2)| {
            let x = AxisMoment { residual_m_s2, nats: i as f64 };
            let axes = PerAxis { x, y: AxisMoment::default() };
            watch.take(&Moment { t_s: 0.05 * i as f64, axes }) == Some(Axis::X)
        })
    }

    /// Calculated by hand: a step to 0.2 at index 10 is detected at once by the chapter's
    /// rule, 0.6 s later with the debounce, and by the CUSUM once n·(2 − 0.5) ≥ 12, n = 8;
    /// likewise for a negative step.
    #[test]
    fn validate_when_a_step_is_seen() {
        let step = |size: f64| -> Vec<Option<f64>> {
            (0..60).map(|i| Some(if i < 10 { 0.0 } else { size })).collect()
        };
        let cusum = DetectionMethod::Cusum { drift: 0.5 };
        for size in [0.2, -0.2] {
            assert_eq!(first(DetectionMethod::Chapter, 0.15, &step(size)), Some(10));
            let debounced = first(DetectionMethod::Debounced, 0.15, &step(size));
            assert!(matches!(debounced, Some(21 | 22)), "{debounced:?}");
            assert_eq!(first(cusum, 12.0, &step(size)), Some(10 + 8 - 1));
            assert_eq!(first(DetectionMethod::Weighed, 12.0, &step(size)), Some(12));
        }
        assert_eq!(first(DetectionMethod::Chapter, 0.25, &step(0.2)), None);
        assert_eq!(first(cusum, 12.0, &step(0.04)), None);
    }

    #[test]
    fn what_may_not_be_judged_accuses_nobody() {
        let now_and_then: Vec<_> = (0..60).map(|i| (i % 12 == 0).then_some(9.0)).collect();
        assert_eq!(first(DetectionMethod::Debounced, 1.0, &now_and_then), None);
        assert_eq!(first(DetectionMethod::Chapter, 1.0, &now_and_then[1..12]), None);
    }

    #[test]
    fn thresholds_rise_and_choices_are_among_them() {
        let detectors = all(5);
        for pair in detectors.windows(2).filter(|w| w[0].method == w[1].method) {
            assert!(pair[0].threshold < pair[1].threshold);
        }
        let chosen = detectors.iter().filter(|d| d.chosen).map(|d| d.threshold);
        let settings = Settings::default();
        assert!(chosen.eq([settings.suspect_nats, settings.confirm_nats, 0.01]));
    }
}
