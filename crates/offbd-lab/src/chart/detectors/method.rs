//! The methods: each says at every judged moment which servo it accuses.

use super::trace::{AxisMoment, Moment, Trace};
use offbd_core::diagnosis::{Debounce, Pace, Profile, Qualified, Settings, Test};
use offbd_core::vocabulary::{Axis, FaultCode, PerAxis};

/// Drift of the CUSUM, in healthy deviations: half of the shift to be found;
/// Page's for a shift by one, and one that forgives what healthy rigs do.
const DRIFTS: [f64; 2] = [0.5, 3.0];

/// Longest time that one moment stands for, s: a gap is not evidence.
const LONGEST_S: f64 = 0.2;

/// A way to tell a sick servo, with one threshold to set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// The chapter's: the residual at a moment, through its window and gate.
    Chapter,
    /// The residual through a longer window, for a while.
    Debounced,
    /// The residual in healthy deviations, added up on both sides.
    Cusum { drift: f64 },
    /// Two explanations of the motion, weighed.
    Weighed,
}

/// All, in the order of the legend.
pub(super) const METHODS: [Method; 5] = [
    Method::Weighed,
    Method::Chapter,
    Method::Debounced,
    Method::Cusum { drift: DRIFTS[0] },
    Method::Cusum { drift: DRIFTS[1] },
];

impl Method {
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

    /// Thresholds swept, least and most: from crying always to never.
    const fn range(self) -> [f64; 2] {
        match self {
            Self::Chapter => [0.003, 10.0],
            Self::Debounced => [0.01, 3.0],
            Self::Cusum { .. } => [1.0, 10_000.0],
            Self::Weighed => [0.5, 40.0],
        }
    }

    /// Thresholds that are somebody's choice, beside the sweep.
    fn chosen(self) -> Vec<f64> {
        let settings = Settings::of(Profile::Default);
        match self {
            Self::Chapter => vec![CHAPTER_M_S2],
            Self::Weighed => vec![settings.suspect_nats, settings.confirm_nats],
            Self::Debounced | Self::Cusum { .. } => Vec::new(),
        }
    }
}

/// The chapter's own limit, m/s² (application 3).
pub(super) const CHAPTER_M_S2: f64 = 0.01;

/// A method at a threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Detector {
    pub(super) method: Method,
    pub(super) threshold: f64,
    /// Somebody's choice.
    pub(super) chosen: bool,
}

/// All methods at `n` thresholds each and those chosen, ascending by method.
pub(super) fn all(n: usize) -> Vec<Detector> {
    METHODS.iter().flat_map(|&method| sweep(method, n)).collect()
}

fn sweep(method: Method, n: usize) -> Vec<Detector> {
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
    /// The evidence that it looks at.
    pub(super) fn moments(self, trace: &Trace) -> &[Moment] {
        if self.method == Method::Chapter { &trace.textbook } else { &trace.judged }
    }

    /// Moments at which a servo is accused, and which: the worse, if both are.
    pub(super) fn alarms(
        self,
        trace: &Trace,
        healthy_m_s2: &PerAxis<f64>,
    ) -> impl Iterator<Item = (f64, Axis)> {
        let mut watch = Watch::new(self, *healthy_m_s2);
        self.moments(trace).iter().filter_map(move |m| Some((m.t_s, watch.take(m)?)))
    }
}

/// A detector over a session.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    detector: Detector,
    healthy_m_s2: PerAxis<f64>,
    pace: Pace,
    last_s: Option<f64>,
    axes: PerAxis<AxisWatch>,
}

#[derive(Clone, Copy, Debug, Default)]
struct AxisWatch {
    debounce: Debounce,
    /// Sums upward and downward, in healthy deviations.
    sums: [f64; 2],
}

impl Watch {
    pub(super) fn new(detector: Detector, healthy_m_s2: PerAxis<f64>) -> Self {
        let pace = Pace::of(FaultCode::XServo, None, false, &Settings::of(Profile::Default));
        Self { detector, healthy_m_s2, pace, last_s: None, axes: PerAxis::default() }
    }

    /// Takes a moment and returns the servo accused, if one is.
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

    /// How much speaks against the servo of `axis`; none below the threshold.
    fn weight(&mut self, axis: Axis, e: &AxisMoment, dt: f64) -> Option<f64> {
        let (threshold, watch) = (self.detector.threshold, &mut self.axes[axis]);
        let beyond = |value: f64| (value >= threshold).then_some(value);
        match self.detector.method {
            Method::Chapter => beyond(e.residual_m_s2?.abs()),
            Method::Weighed => beyond(e.nats),
            Method::Debounced => {
                let test = match e.residual_m_s2 {
                    None => Test::NotTested,
                    Some(r) if r.abs() >= threshold => Test::Prefailed,
                    Some(_) => Test::Prepassed,
                };
                let failed = watch.debounce.update(test, dt, &self.pace) >= Qualified::Failed;
                e.residual_m_s2.filter(|_| failed).map(f64::abs)
            }
            Method::Cusum { drift } => {
                let z = e.residual_m_s2? / self.healthy_m_s2[axis];
                for (sum, z) in watch.sums.iter_mut().zip([z, -z]) {
                    *sum = (*sum + z - drift).max(0.0);
                }
                let alarm = beyond(watch.sums[0].max(watch.sums[1]))?;
                // It starts anew, as Page's does.
                watch.sums = [0.0; 2];
                Some(alarm)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments 0.05 s apart with residuals of the x servo.
    fn first(method: Method, threshold: f64, residuals: &[Option<f64>]) -> Option<usize> {
        let detector = Detector { method, threshold, chosen: false };
        let mut watch = Watch::new(detector, PerAxis { x: 0.1, y: 0.1 });
        residuals.iter().enumerate().position(|(i, &residual_m_s2)| {
            let x = AxisMoment { residual_m_s2, nats: i as f64 };
            let axes = PerAxis { x, y: AxisMoment::default() };
            watch.take(&Moment { t_s: 0.05 * i as f64, axes }) == Some(Axis::X)
        })
    }

    /// By hand: a step to 0.2 at moment 10 is seen at once by the chapter's
    /// rule, 0.6 s later with the debounce, and by the CUSUM once
    /// n·(2 − 0.5) ≥ 12, n = 8; on the lower side likewise.
    #[test]
    fn validate_when_a_step_is_seen() {
        let step = |size: f64| -> Vec<Option<f64>> {
            (0..60).map(|i| Some(if i < 10 { 0.0 } else { size })).collect()
        };
        let cusum = Method::Cusum { drift: 0.5 };
        for size in [0.2, -0.2] {
            assert_eq!(first(Method::Chapter, 0.15, &step(size)), Some(10));
            let debounced = first(Method::Debounced, 0.15, &step(size));
            assert!(matches!(debounced, Some(21 | 22)), "{debounced:?}");
            assert_eq!(first(cusum, 12.0, &step(size)), Some(10 + 8 - 1));
            assert_eq!(first(Method::Weighed, 12.0, &step(size)), Some(12));
        }
        assert_eq!(first(Method::Chapter, 0.25, &step(0.2)), None);
        assert_eq!(first(cusum, 12.0, &step(0.04)), None);
    }

    #[test]
    fn what_may_not_be_judged_accuses_nobody() {
        let now_and_then: Vec<_> = (0..60).map(|i| (i % 12 == 0).then_some(9.0)).collect();
        assert_eq!(first(Method::Debounced, 1.0, &now_and_then), None);
        assert_eq!(first(Method::Chapter, 1.0, &now_and_then[1..12]), None);
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
