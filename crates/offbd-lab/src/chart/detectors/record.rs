//! Summarises all sessions as records.

use serde::{Deserialize, Serialize};

use super::cost::SampleCost;
use super::faults;
use super::method::Detector;
use super::session_result::{DetectorOutcome, SessionResult};
use offbd_core::maths::quantile;

/// One record of the chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "of", rename_all = "kebab-case")]
pub enum DetectorRecord {
    /// A method at one threshold, over all servo faults.
    Method(ThresholdResult),
    /// A method at its operating point, over one fault.
    Fault(FaultResult),
    /// CPU time per sample.
    Cost(CostResult),
}

/// The result of a method at one threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThresholdResult {
    pub method: String,
    /// `None` for the engine's verdict, which has several thresholds.
    pub threshold: Option<f64>,
    /// Unit of the threshold, or the status that counts: `pending` or `confirmed`.
    pub unit: String,
    /// Whether the threshold is in use.
    pub chosen: bool,
    /// Whether it is the operating point at which the faults are compared.
    pub working: bool,
    pub false_alarms: u32,
    /// Healthy time, h.
    pub healthy_h: f64,
    /// Upper 95 % confidence limit if there was no false alarm: 3/T (rule of three).
    pub fewer_than_per_h: Option<f64>,
    #[serde(flatten)]
    pub found: DetectionStatistics,
}

/// The result of a method at its operating point over the sessions with one fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultResult {
    pub method: String,
    /// As on the command line of `offbd simulate`, without onset.
    pub fault: String,
    #[serde(flatten)]
    pub found: DetectionStatistics,
}

/// Detection statistics of faults that had a chance to be detected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectionStatistics {
    pub n_faults: u32,
    pub n_detected: u32,
    /// Number of faults detected whose first alarm accused the faulty component.
    pub n_right: u32,
    /// Median delay after the first chance, s; a missed fault counts as infinite, `None`
    /// if the median is.
    pub median_s: Option<f64>,
    /// 90 % quantile of the delay, s, likewise.
    pub p90_s: Option<f64>,
}

/// CPU time per sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostResult {
    pub what: String,
    /// Minimum over the repeated measurements, ns.
    pub cost_ns: f64,
    /// Ratio to the cost of the whole pipeline with the profile `default`.
    pub ratio: f64,
    /// Median over minimum of the repeated measurements.
    pub spread: f64,
}

/// Name of the engine's verdict in the records.
pub(super) const VERDICT: &str = "offbd, verdict";

impl ThresholdResult {
    pub(super) fn per_h(&self) -> f64 {
        f64::from(self.false_alarms) / self.healthy_h
    }
}

impl DetectionStatistics {
    pub(super) fn detected(&self) -> f64 {
        f64::from(self.n_detected) / f64::from(self.n_faults)
    }

    pub(super) fn right(&self) -> f64 {
        f64::from(self.n_right) / f64::from(self.n_faults)
    }
}

/// Selects the outcome of one detector or verdict in a session's result.
type OutcomeSelector<'a> = &'a dyn Fn(&SessionResult) -> DetectorOutcome;

/// Returns all records: thresholds, faults at the operating points, costs.
pub(super) fn gather(
    detectors: &[Detector],
    tallies: &[SessionResult],
    faults: &[&str],
    costs: Vec<SampleCost>,
) -> Vec<DetectorRecord> {
    let mut curves: Vec<ThresholdResult> = detectors
        .iter()
        .enumerate()
        .map(|(i, d)| ThresholdResult {
            threshold: Some(d.threshold),
            chosen: d.chosen,
            ..curve(d.method.name(), d.method.unit(), tallies, &|t| t.outcomes[i])
        })
        .collect();
    for (i, word) in ["pending", "confirmed"].into_iter().enumerate() {
        let verdict = curve(VERDICT.to_owned(), word, tallies, &|t| t.verdicts[i]);
        curves.push(ThresholdResult { chosen: true, ..verdict });
    }
    mark_working(&mut curves);
    let mut kinds = Vec::new();
    for (i, at) in curves.iter().enumerate().filter(|(_, c)| c.working) {
        let pick = |t: &SessionResult| match i.checked_sub(detectors.len()) {
            None => t.outcomes[i],
            Some(k) => t.verdicts[k],
        };
        kinds.extend(faults.iter().map(|fault| FaultResult {
            method: at.method.clone(),
            fault: (*fault).to_owned(),
            found: found(tallies.iter().filter(|t| t.fault == Some(*fault)), &pick),
        }));
    }
    let prices = prices(costs).into_iter().map(DetectorRecord::Cost);
    let curves = curves.into_iter().map(DetectorRecord::Method);
    curves.chain(kinds.into_iter().map(DetectorRecord::Fault)).chain(prices).collect()
}

fn curve(
    method: String,
    unit: &str,
    tallies: &[SessionResult],
    pick: OutcomeSelector<'_>,
) -> ThresholdResult {
    let healthy = || tallies.iter().filter(|t| t.fault.is_none());
    let healthy_h = healthy().map(|t| t.seconds).sum::<f64>() / 3600.0;
    let false_alarms = healthy().map(|t| pick(t).alarms).sum();
    let servo = tallies.iter().filter(|t| t.fault.is_some_and(faults::is_servo));
    ThresholdResult {
        method,
        threshold: None,
        unit: unit.to_owned(),
        chosen: false,
        working: false,
        false_alarms,
        healthy_h,
        fewer_than_per_h: (false_alarms == 0).then_some(3.0 / healthy_h),
        found: found(servo, pick),
    }
}

fn found<'a>(
    tallies: impl Iterator<Item = &'a SessionResult>,
    pick: OutcomeSelector<'_>,
) -> DetectionStatistics {
    let outcomes: Vec<DetectorOutcome> = tallies.filter(|t| t.counts).map(pick).collect();
    let mut delays: Vec<f64> =
        outcomes.iter().map(|o| o.delay_s.unwrap_or(f64::INFINITY)).collect();
    let count =
        |which: fn(&DetectorOutcome) -> bool| outcomes.iter().filter(|o| which(o)).count() as u32;
    let mut at = |share| quantile(&mut delays, share).filter(|s| s.is_finite());
    DetectionStatistics {
        n_faults: outcomes.len() as u32,
        n_detected: count(|o| o.delay_s.is_some()),
        n_right: count(|o| o.right),
        median_s: at(0.5),
        p90_s: at(0.9),
    }
}

/// Marks the operating points: the greatest threshold in use of the methods that have one,
/// which is the chapter's limit and the confirmed verdict; of the others, the least
/// threshold with their minimum of false alarms.
fn mark_working(curves: &mut [ThresholdResult]) {
    let n = curves.len();
    let mut first = 0;
    while first < n {
        let of = curves[first..].iter().take_while(|c| c.method == curves[first].method).count();
        let group = &mut curves[first..first + of];
        let fewest = group.iter().map(|c| c.false_alarms).min();
        let own = group.iter().rposition(|c| c.chosen);
        let at = own.or_else(|| group.iter().position(|c| Some(c.false_alarms) == fewest));
        if let Some(curve) = at.and_then(|i| group.get_mut(i)) {
            curve.working = true;
        }
        first += of;
    }
}

fn prices(costs: Vec<SampleCost>) -> Vec<CostResult> {
    let whole_s = costs.first().map_or(f64::NAN, |c| c.time.minimum_s);
    let price = |cost: SampleCost| CostResult {
        what: cost.what,
        cost_ns: cost.time.minimum_s * 1e9,
        ratio: cost.time.minimum_s / whole_s,
        spread: cost.time.spread(),
    };
    costs.into_iter().map(price).collect()
}
