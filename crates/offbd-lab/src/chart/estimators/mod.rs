//! Estimators of acceleration: error against delay and cost.
//!
//! A known motion is sampled at several rates with noise of several sizes; each
//! estimator runs over a sweep of its tuning. Its delay is that by which the
//! truth agrees best with what it says of noiseless positions; its error is
//! taken against the truth so delayed, since the engine sends its prediction
//! through the same filter and loses the delay there. There it loses the
//! distortion too, which this chart counts: it judges estimators by themselves.

mod family;
mod measure;
mod record;
mod show;
mod signal;

use family::{DRAWN, FAMILIES, Family};
use measure::Recording;
use offbd_core::diagnosis::{Profile, Settings};
pub use record::Record;

use super::{Chart, ChartError, Effort, front};
use crate::timing::CpuTime;

/// What is measured.
struct Plan {
    rates_hz: &'static [f64],
    noises_m: &'static [f64],
    seconds: f64,
    /// Tunings of each family.
    n: usize,
    repeats: usize,
}

impl Plan {
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

/// Measures and draws.
///
/// # Errors
/// [`ChartError::Records`] if a record is no JSON.
pub fn make(effort: Effort) -> Result<Chart, ChartError> {
    let plan = Plan::of(effort);
    let records: Vec<Record> =
        plan.rates_hz.iter().flat_map(|&rate_hz| at_rate(&plan, rate_hz)).collect();
    let values = records.iter().map(serde_json::to_value).collect::<Result<_, _>>()?;
    Ok(Chart {
        name: "estimators",
        records: values,
        figures: show::figures(&records, measure::saying_nothing(plan.seconds)),
        table: show::table(&records),
        versions: Vec::new(),
    })
}

/// Every family at every tuning; the engine's own last.
fn configurations(plan: &Plan, period_s: f64) -> Vec<(Family, f64, bool)> {
    let sweep = |family: &Family| {
        let family = *family;
        family.sweep(plan.n, period_s).into_iter().map(move |value| (family, value, false))
    };
    let mut all: Vec<(Family, f64, bool)> = FAMILIES.iter().flat_map(sweep).collect();
    all.push((Family::SlidingFit, Settings::of(Profile::Default).window_s, true));
    all
}

fn at_rate(plan: &Plan, rate_hz: f64) -> Vec<Record> {
    let recording = |&noise_m: &f64| Recording::new(rate_hz, noise_m, plan.seconds, 1);
    let recordings: Vec<Recording> = plan.noises_m.iter().map(recording).collect();
    let Some(first) = recordings.first() else { return Vec::new() };
    let configurations = configurations(plan, 1.0 / rate_hz);
    // What an estimator costs does not depend on the noise.
    let costs: Vec<Option<CpuTime>> =
        configurations.iter().map(|c| first.cost(c.0, c.1, plan.repeats)).collect();
    let mut records = Vec::new();
    for recording in &recordings {
        let judge =
            |(c, cost): (&(Family, f64, bool), &Option<CpuTime>)| record(recording, *c, (*cost)?);
        let mut panel: Vec<Record> = configurations.iter().zip(&costs).filter_map(judge).collect();
        mark_front(&mut panel);
        records.append(&mut panel);
    }
    records
}

fn record(
    recording: &Recording,
    (family, value, offbd): (Family, f64, bool),
    cost: CpuTime,
) -> Option<Record> {
    let measured = recording.measure(family, value)?;
    Some(Record {
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

/// Marks the front among those of one rate and noise that are drawn.
fn mark_front(panel: &mut [Record]) {
    let drawn: Vec<String> = FAMILIES[..DRAWN].iter().map(|f| f.name()).collect();
    let point = |r: &Record| {
        let is_drawn = drawn.contains(&r.family);
        (if is_drawn { r.delay_s } else { f64::NAN }, r.error_m_s2)
    };
    let points: Vec<(f64, f64)> = panel.iter().map(point).collect();
    for on in front(&points) {
        panel[on.index].front = true;
    }
}
