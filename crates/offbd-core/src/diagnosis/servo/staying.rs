//! Tells the kind of a fault from everything that the servo did since the fault began.
//!
//! The other filter of a broken servo forgets within seconds, so that it follows whatever the servo
//! does. What it knows when a fault is confirmed is in part from before the fault. This one begins
//! with the evidence and hardly forgets.

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

/// Nats by which a healthy servo explains the readings better than this broken one from which on the
/// likelihoods do not change: what follows a repair does not tell what was broken. Chosen on 216 servo
/// faults of 130 s of three simulated rigs, looked at 40 s after their repair: without a limit 41
/// of their kinds are wrong, 26 of these above 0.8, and 148 right; with 1, 2, 4 and 8 nats 13, 7, 4 and 4
/// are wrong, none above 0.8, and 143, 144, 145 and 144 right. Of 288 others of 3 to 60 s with other
/// seeds, 53 wrong and 145 right become 31 and 122.
const HEALTHIER_NATS: f64 = 8.0;

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
    /// Evidence that the servo is healthy again, nats: Page's CUSUM, as for the fault.
    healthier_nats: f64,
}

impl StayingFault {
    /// Begins with the deviation `y` of variance `variance`.
    pub(super) fn new((y, variance): (f64, f64)) -> Self {
        let mut filter = ServoFilter::new(STAYING);
        filter.anchor(y, variance);
        Self {
            filter,
            followed_s: 0.0,
            likelihoods: [0.0; KINDS],
            most_nats: 0.0,
            healthier_nats: 0.0,
        }
    }

    /// Follows the ball to the deviation `y` of variance `variance`, whose log-likelihood is `healthy`
    /// for a healthy servo, with the evidence `nats` for a fault.
    pub(super) fn follow(
        &mut self,
        step: &FilterStep,
        (y, variance): (f64, f64),
        nats: f64,
        healthy: f64,
    ) {
        self.most_nats = self.most_nats.max(nats);
        self.filter.predict(step);
        let broken = self.filter.correct(y, variance, step.dt);
        self.healthier_nats = (self.healthier_nats + healthy - broken).max(0.0);
        if self.healthier_nats > HEALTHIER_NATS {
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

    /// The response since the fault began; `None` before anything was followed.
    pub(super) fn answer(&self) -> Option<ServoAnswer> {
        let answer =
            || ServoAnswer { likelihoods: self.likelihoods, ..ServoAnswer::of(&self.filter) };
        (self.followed_s > 0.0).then(answer)
    }
}
