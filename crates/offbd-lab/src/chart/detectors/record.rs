//! All sessions together, as records.

use serde::{Deserialize, Serialize};

use super::cost::Cost;
use super::faults;
use super::method::Detector;
use super::tally::{Outcome, Tally};
use offbd_core::maths::quantile;

/// One line of what was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "of", rename_all = "kebab-case")]
pub enum Record {
    /// A method at one threshold, over all servo faults.
    Method(Curve),
    /// A method at its working point, over one fault.
    Fault(Kind),
    /// What a sample costs.
    Cost(Price),
}

/// A method at one threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    pub method: String,
    /// None for the engine's verdict, which has several.
    pub threshold: Option<f64>,
    /// Unit of the threshold, or the verdict's word.
    pub unit: String,
    /// A threshold that is somebody's choice.
    pub chosen: bool,
    /// The working point at which the faults are compared.
    pub working: bool,
    pub false_alarms: u32,
    /// Healthy time, h.
    pub healthy_h: f64,
    /// 95 % upper bound where there was none: 3/T (the rule of three).
    pub fewer_than_per_h: Option<f64>,
    #[serde(flatten)]
    pub found: Found,
}

/// A method at its working point over the sessions with one fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kind {
    pub method: String,
    /// As on the command line of `offbd simulate`, without onset.
    pub fault: String,
    #[serde(flatten)]
    pub found: Found,
}

/// What was found of faults that had a chance to be seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    pub n_faults: u32,
    pub n_detected: u32,
    /// Detected, and the first alarm accused what is broken.
    pub n_right: u32,
    /// Delay after the first chance, s; a missed fault counts as never found.
    pub median_s: Option<f64>,
    pub p90_s: Option<f64>,
}

/// CPU time per sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Price {
    pub what: String,
    /// The minimum over repeats, ns.
    pub cost_ns: f64,
    /// Over that of the whole pipeline by profile default.
    pub ratio: f64,
    /// Median over minimum of the repeats.
    pub spread: f64,
}

/// The engine's verdict in the records.
pub(super) const VERDICT: &str = "offbd, verdict";

impl Curve {
    pub(super) fn per_h(&self) -> f64 {
        f64::from(self.false_alarms) / self.healthy_h
    }
}

impl Found {
    pub(super) fn detected(&self) -> f64 {
        f64::from(self.n_detected) / f64::from(self.n_faults)
    }

    pub(super) fn right(&self) -> f64 {
        f64::from(self.n_right) / f64::from(self.n_faults)
    }
}

/// What a session came to for one detector or verdict.
type Pick<'a> = &'a dyn Fn(&Tally) -> Outcome;

/// All records: curves, faults at the working points, costs.
pub(super) fn gather(
    detectors: &[Detector],
    tallies: &[Tally],
    faults: &[&str],
    costs: Vec<Cost>,
) -> Vec<Record> {
    let mut curves: Vec<Curve> = detectors
        .iter()
        .enumerate()
        .map(|(i, d)| Curve {
            threshold: Some(d.threshold),
            chosen: d.chosen,
            ..curve(d.method.name(), d.method.unit(), tallies, &|t| t.outcomes[i])
        })
        .collect();
    for (i, word) in ["pending", "confirmed"].into_iter().enumerate() {
        let verdict = curve(VERDICT.to_owned(), word, tallies, &|t| t.verdicts[i]);
        curves.push(Curve { chosen: true, ..verdict });
    }
    mark_working(&mut curves);
    let mut kinds = Vec::new();
    for (i, at) in curves.iter().enumerate().filter(|(_, c)| c.working) {
        let pick = |t: &Tally| match i.checked_sub(detectors.len()) {
            None => t.outcomes[i],
            Some(k) => t.verdicts[k],
        };
        kinds.extend(faults.iter().map(|fault| Kind {
            method: at.method.clone(),
            fault: (*fault).to_owned(),
            found: found(tallies.iter().filter(|t| t.fault == Some(*fault)), &pick),
        }));
    }
    let prices = prices(costs).into_iter().map(Record::Cost);
    let curves = curves.into_iter().map(Record::Method);
    curves.chain(kinds.into_iter().map(Record::Fault)).chain(prices).collect()
}

fn curve(method: String, unit: &str, tallies: &[Tally], pick: Pick<'_>) -> Curve {
    let healthy = || tallies.iter().filter(|t| t.fault.is_none());
    let healthy_h = healthy().map(|t| t.seconds).sum::<f64>() / 3600.0;
    let false_alarms = healthy().map(|t| pick(t).alarms).sum();
    let servo = tallies.iter().filter(|t| t.fault.is_some_and(faults::is_servo));
    Curve {
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

fn found<'a>(tallies: impl Iterator<Item = &'a Tally>, pick: Pick<'_>) -> Found {
    let outcomes: Vec<Outcome> = tallies.filter(|t| t.counts).map(pick).collect();
    let mut delays: Vec<f64> =
        outcomes.iter().map(|o| o.delay_s.unwrap_or(f64::INFINITY)).collect();
    let count = |which: fn(&Outcome) -> bool| outcomes.iter().filter(|o| which(o)).count() as u32;
    let mut at = |share| quantile(&mut delays, share).filter(|s| s.is_finite());
    Found {
        n_faults: outcomes.len() as u32,
        n_detected: count(|o| o.delay_s.is_some()),
        n_right: count(|o| o.right),
        median_s: at(0.5),
        p90_s: at(0.9),
    }
}

/// The chapter's own limit, the confirmed verdict, and of every other method
/// the least threshold with as few false alarms as it has at all.
fn mark_working(curves: &mut [Curve]) {
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

fn prices(costs: Vec<Cost>) -> Vec<Price> {
    let whole_s = costs.first().map_or(f64::NAN, |c| c.time.minimum_s);
    let price = |cost: Cost| Price {
        what: cost.what,
        cost_ns: cost.time.minimum_s * 1e9,
        ratio: cost.time.minimum_s / whole_s,
        spread: cost.time.spread(),
    };
    costs.into_iter().map(price).collect()
}
