//! One map: the fate of a method over the step size and one parameter of the contact.

use super::measure::{BallOnHeldPlate, Fate};
use super::{StabilityLimitRecord, StabilityRecord};
use crate::chart::Effort;
use crate::scene::{Method, StepLimits};
use offbd_core::plant::{Ball, Contact};

/// The parameter of the contact that is swept; the others are the chapter's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sweep {
    Threshold,
    /// Stiffness, with the damping changed so that the damping ratio is the chapter's.
    Stiffness,
    Damping,
}

/// Returns the chapter's damping ratio D/(2·√(K·m)).
pub(super) fn chapter_ratio() -> f64 {
    let contact = Contact::CHAPTER;
    let critical = 2.0 * (contact.stiffness_n_per_m() * Ball::default().mass_kg()).sqrt();
    contact.damping_n_s_per_m() / critical
}

impl Sweep {
    pub(super) const ALL: [Self; 3] = [Self::Threshold, Self::Stiffness, Self::Damping];

    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Threshold => "threshold",
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
        }
    }

    /// Returns the range of the parameter, in SI units, and that of the steps, s.
    pub(super) const fn ranges(self) -> [(f64, f64); 2] {
        match self {
            Self::Threshold => [(1e-6, 1e-1), (1e-7, 1e-2)],
            Self::Stiffness => [(1e3, 1e9), (1e-6, 1e-2)],
            Self::Damping => [(3.0, 1.2e5), (1e-7, 1e-2)],
        }
    }

    pub(super) fn held(self, value: f64) -> BallOnHeldPlate {
        let c = Contact::CHAPTER;
        let critical = 2.0 * (value * Ball::default().mass_kg()).sqrt();
        let (k, d, threshold) = match self {
            Self::Threshold => (c.stiffness_n_per_m(), c.damping_n_s_per_m(), value),
            Self::Stiffness => (value, chapter_ratio() * critical, c.slip_threshold_m_s()),
            Self::Damping => (c.stiffness_n_per_m(), value, c.slip_threshold_m_s()),
        };
        let contact = Contact::new(k, d, c.friction(), threshold);
        BallOnHeldPlate::new(contact.unwrap_or(Contact::CHAPTER))
    }
}

/// The largest stable step for one value of the parameter, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredLimit {
    /// Value of the parameter.
    pub value: f64,
    pub predicted: f64,
    pub measured: f64,
}

/// One method's map.
pub(super) struct StabilityMap {
    pub sweep: Sweep,
    pub method: Method,
    pub values: Vec<f64>,
    pub steps: Vec<f64>,
    /// Fate and final slip error of cell (i, j) at `j · columns + i`.
    pub cells: Vec<(Fate, f64)>,
    /// Empty for methods that are stable at any step in theory.
    pub limits: Vec<MeasuredLimit>,
}

impl StabilityMap {
    pub(super) fn measure(sweep: Sweep, method: Method, effort: Effort) -> Self {
        let (columns, rows) = match effort {
            Effort::Full => (30, 30),
            Effort::Quick => (9, 9),
        };
        let [values, steps] = sweep.ranges();
        let (values, steps) = (spread(values, columns), spread(steps, rows));
        let held: Vec<BallOnHeldPlate> = values.iter().map(|&value| sweep.held(value)).collect();
        let cells = steps.iter().flat_map(|&h| held.iter().map(move |held| held.fate(method, h)));
        let cells = cells.collect();
        let limits = values.iter().zip(&held).filter_map(|(&value, held)| {
            let predicted = StepLimits::of(method, &held.model, held.normal_m_s2())?.least_s();
            Some(MeasuredLimit { value, predicted, measured: measured(held, method, predicted)? })
        });
        let limits = limits.collect();
        Self { sweep, method, values, steps, cells, limits }
    }

    pub(super) fn count(&self, fate: Fate) -> usize {
        self.cells.iter().filter(|cell| cell.0 == fate).count()
    }

    /// Returns the largest slip of the cells that chatter, as a multiple of the change of
    /// slip by full friction in one step.
    pub(super) fn chatter_over_clamp(&self) -> f64 {
        let each = self.cells.iter().enumerate().filter(|(_, cell)| cell.0 == Fate::Chatter);
        let over = each.map(|(cell, (_, off))| {
            let (i, j) = (cell % self.values.len(), cell / self.values.len());
            off / self.sweep.held(self.values[i]).full_friction(self.steps[j])
        });
        over.fold(0.0, f64::max)
    }

    /// Returns the largest relative difference of measured and predicted limit.
    pub(super) fn worst_off(&self) -> Option<f64> {
        let off = |limit: &MeasuredLimit| (limit.measured / limit.predicted - 1.0).abs();
        self.limits.iter().map(off).reduce(f64::max)
    }

    pub(super) fn records(&self) -> impl Iterator<Item = StabilityRecord> {
        self.cells.iter().enumerate().map(|(cell, &(fate, off))| {
            let (i, j) = (cell % self.values.len(), cell / self.values.len());
            let contact = self.sweep.held(self.values[i]).model.contact;
            StabilityRecord {
                sweep: self.sweep.word(),
                method: self.method.name(),
                stiffness_n_per_m: contact.stiffness_n_per_m(),
                damping_n_s_per_m: contact.damping_n_s_per_m(),
                slip_threshold_m_s: contact.slip_threshold_m_s(),
                step_s: self.steps[j],
                fate,
                slip_off: off.is_finite().then_some(off),
            }
        })
    }

    pub(super) fn limit_records(&self) -> impl Iterator<Item = StabilityLimitRecord> {
        self.limits.iter().map(|limit| StabilityLimitRecord {
            sweep: self.sweep.word(),
            method: self.method.name(),
            swept: limit.value,
            predicted_s: limit.predicted,
            measured_s: limit.measured,
        })
    }
}

/// Returns `n` logarithmically spaced values from `low` to `high`.
fn spread((low, high): (f64, f64), n: usize) -> Vec<f64> {
    let share = |i: usize| i as f64 / (n - 1) as f64;
    (0..n).map(|i| low * (high / low).powf(share(i))).collect()
}

/// Ratio of the ends of the interval at which the bisection stops; chosen.
const CLOSE: f64 = 1.002;

/// Returns the largest step at which a disturbance decays, by bisection around the
/// prediction; `None` if it is not between a tenth and ten times the prediction.
fn measured(held: &BallOnHeldPlate, method: Method, predicted: f64) -> Option<f64> {
    let (mut low, mut high) = (predicted / 10.0, predicted * 10.0);
    if !held.dies_out(method, low) || held.dies_out(method, high) {
        return None;
    }
    while high / low > CLOSE {
        let middle = (low * high).sqrt();
        if held.dies_out(method, middle) { low = middle } else { high = middle }
    }
    Some((low * high).sqrt())
}
