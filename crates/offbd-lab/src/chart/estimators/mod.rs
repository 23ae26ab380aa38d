//! Estimators of acceleration: error against delay and cost.
//!
//! A known motion is sampled at several rates with noise of several sizes; each estimator
//! runs over a sweep of its tuning. Its delay is that of the truth at which it agrees best
//! with the estimates from noiseless positions. Its error is measured against the truth so
//! delayed, because the engine passes its prediction through the same filter, which
//! cancels the delay. That cancels the distortion as well, which this chart counts: it
//! compares the estimators alone.

mod family;
mod measure;
mod record;
mod show;
mod signal;

use family::{DRAWN, FAMILIES, Family};
use measure::TestSignal;
use offbd_core::diagnosis::{Profile, Settings};
pub use record::EstimatorRecord;

use super::{Chart, ChartError, Effort, front};
use crate::timing::CpuTime;

/// The extent of the measurement.
struct EstimatorPlan {
    rates_hz: &'static [f64],
    noises_m: &'static [f64],
    seconds: f64,
    /// Number of tunings of each family.
    n: usize,
    /// Number of timed measurements.
    repeats: usize,
}

impl EstimatorPlan {
    const fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                rates_hz: &[30.0, 100.0, 1000.0],
                noises_m: &[1e-4, 5e-4, 2e-3],
                seconds: 65.0,
                n: 14,
                repeats: 7,
            },
            Effort::Quick => {
                Self { rates_hz: &[100.0], noises_m: &[5e-4], seconds: 17.0, n: 4, repeats: 1 }
            }
        }
    }
}

/// Measures, and returns the chart.
///
/// # Errors
/// [`ChartError::Records`] if a record cannot be written as JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let plan = EstimatorPlan::of(effort);
    let records: Vec<EstimatorRecord> =
        plan.rates_hz.iter().flat_map(|&rate_hz| at_rate(&plan, rate_hz)).collect();
    let values = records.iter().map(serde_json::to_value).collect::<Result<_, _>>()?;
    Ok(Chart {
        name: "estimators",
        records: values,
        figures: show::figures(&records, measure::error_of_zero(plan.seconds)),
        table: show::table(&records),
        versions: Vec::new(),
    })
}

/// Returns every family at every tuning; the engine's own estimator last, marked by
/// `true`.
fn configurations(plan: &EstimatorPlan, period_s: f64) -> Vec<(Family, f64, bool)> {
    let sweep = |family: &Family| {
        let family = *family;
        family.sweep(plan.n, period_s).into_iter().map(move |value| (family, value, false))
    };
    let mut all: Vec<(Family, f64, bool)> = FAMILIES.iter().flat_map(sweep).collect();
    all.push((Family::SlidingFit, Settings::of(Profile::Default).window_s, true));
    all
}

fn at_rate(plan: &EstimatorPlan, rate_hz: f64) -> Vec<EstimatorRecord> {
    let recording = |&noise_m: &f64| TestSignal::new(rate_hz, noise_m, plan.seconds, 1);
    let recordings: Vec<TestSignal> = plan.noises_m.iter().map(recording).collect();
    let Some(first) = recordings.first() else { return Vec::new() };
    let configurations = configurations(plan, 1.0 / rate_hz);
    // The cost of an estimator does not depend on the noise.
    let costs: Vec<Option<CpuTime>> =
        configurations.iter().map(|c| first.cost(c.0, c.1, plan.repeats)).collect();
    let mut records = Vec::new();
    for recording in &recordings {
        let judge =
            |(c, cost): (&(Family, f64, bool), &Option<CpuTime>)| record(recording, *c, (*cost)?);
        let mut panel: Vec<EstimatorRecord> =
            configurations.iter().zip(&costs).filter_map(judge).collect();
        mark_front(&mut panel);
        records.append(&mut panel);
    }
    records
}

fn record(
    recording: &TestSignal,
    (family, value, offbd): (Family, f64, bool),
    cost: CpuTime,
) -> Option<EstimatorRecord> {
    let measured = recording.measure(family, value)?;
    Some(EstimatorRecord {
        rate_hz: recording.rate_hz,
        noise_m: recording.noise_m,
        family: family.name(),
        setting: family.setting().to_owned(),
        value,
        delay_s: measured.delay_s,
        error_m_s2: measured.error,
        undelayed_error_m_s2: measured.undelayed,
        distortion_m_s2: measured.distortion,
        noise_m_s2: measured.noise,
        cost_ns: cost.minimum_s * 1e9,
        spread: cost.spread(),
        front: false,
        offbd,
    })
}

/// Marks the Pareto front among the drawn families at one rate and noise.
fn mark_front(panel: &mut [EstimatorRecord]) {
    let drawn: Vec<String> = FAMILIES[..DRAWN].iter().map(|f| f.name()).collect();
    let point = |r: &EstimatorRecord| {
        let is_drawn = drawn.contains(&r.family);
        (if is_drawn { r.delay_s } else { f64::NAN }, r.error_m_s2)
    };
    let points: Vec<(f64, f64)> = panel.iter().map(point).collect();
    for on in front(&points) {
        panel[on.index].front = true;
    }
}
