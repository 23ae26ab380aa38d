//! Tells the kind of a fault from everything that the servo did since the fault began.
//!
//! The other filter of a broken servo forgets within seconds, so that it follows whatever the servo
//! does. What it knows when a fault is confirmed is in part from before the fault. This one begins
//! with the evidence and hardly forgets.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use serde::{Deserialize, Serialize};

use super::FAULTY;
use super::answer::{KINDS, ServoAnswer, likelihoods};
use super::filter::{FilterStep, PARAMETERS, ParameterPrior, ServoFilter};

/// Parameters as [`FAULTY`], but hardly any of them changes within a minute.
const STAYING: ParameterPrior = ParameterPrior { memory_s: [60.0; PARAMETERS], ..FAULTY };

/// Time over which the likelihoods of the kinds are averaged, s: one moment's estimate of a servo
/// that no kind describes exactly favours now one kind and now another. Chosen by averaging the
/// likelihoods of 132 servo faults of 20 simulated rigs afterwards: without an average 76 kinds
/// reach 0.8, of which 55 are right; with 2 s 49 of 57, with 5 s 43 of 48.
const MEAN_S: f64 = 2.0;

/// Fall of the evidence below its largest from which on the likelihoods do not change, nats: what
/// follows a repair does not tell what was broken. Chosen on 240 servo faults of three simulated
/// rigs, each repaired after 140 s: with 2, 4, 8 nats and without a limit 5, 8, 16 and 18 kinds above
/// 0.8 are wrong when the test passes again, and 56, 59, 60 and 62 are right at the repair.
const FALLEN_NATS: f64 = 4.0;

/// A servo for which there is evidence of a fault.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct StayingFault {
    filter: ServoFilter,
    /// Time of motion followed, s.
    followed_s: f64,
    /// Mean likelihoods of the kinds; zero at first.
    likelihoods: [f64; KINDS],
    /// The largest evidence, nats.
    most_nats: f64,
}

impl StayingFault {
    /// Begins with the deviation `y` of variance `variance`.
    pub(super) fn new(y: f64, variance: f64) -> Self {
        let mut filter = ServoFilter::new(STAYING);
        filter.anchor(y, variance);
        Self { filter, followed_s: 0.0, likelihoods: [0.0; KINDS], most_nats: 0.0 }
    }

    /// Follows the ball to the deviation `y` of variance `variance`, with the evidence `nats` for a
    /// fault.
    pub(super) fn follow(&mut self, step: &FilterStep, y: f64, variance: f64, nats: f64) {
        self.most_nats = self.most_nats.max(nats);
        self.filter.predict(step);
        self.filter.correct(y, variance, step.dt);
        if nats < self.most_nats - FALLEN_NATS {
            return;
        }
        self.followed_s += step.dt;
        let share = step.dt / self.followed_s.min(MEAN_S);
        for (mean, now) in self.likelihoods.iter_mut().zip(likelihoods(&self.filter)) {
            *mean += share * (now - *mean);
        }
    }

    /// Starts from the deviation `y` again, after a time without readings.
    pub(super) fn anchor(&mut self, y: f64, variance: f64) {
        self.filter.anchor(y, variance);
    }

    /// Adds a straight line to the deviation, as when the twin is rebased.
    pub(super) fn shift(&mut self, position: f64, velocity: f64) {
        self.filter.shift(position, velocity);
    }

    /// The largest evidence, nats.
    pub(super) const fn most_nats(&self) -> f64 {
        self.most_nats
    }

    pub(super) fn answer(&self) -> ServoAnswer {
        ServoAnswer { likelihoods: self.likelihoods, ..ServoAnswer::of(&self.filter) }
    }
}
