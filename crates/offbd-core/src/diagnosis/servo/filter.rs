//! A Kalman filter of the deviation from the twin along one axis, under one hypothesis
//! about its servo.
//!
//! State: deviation y of the measured from the twin's path (m), its rate ẏ
//! (m/s), and three parameters θ of the servo: offset b (m/s²), gain change m
//! (1) and extra delay d (s),
//!
//! ```text
//! ÿ = b + m·a(t) − d·ȧ(t) + w,
//! ```
//!
//! where a is the twin's acceleration and w white noise. The hypotheses differ in how far
//! θ may be from zero and how soon it may change: each θ is a first-order Gauss–Markov
//! process with a standard deviation and a time constant.
//!
//! A push is a step of ẏ at an unknown time. Each correction therefore also evaluates the
//! explanation that the ball was pushed since the last reading, and takes the likelier
//! one: a push costs both hypotheses the same and is evidence for neither.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use serde::{Deserialize, Serialize};

/// Number of parameters of a servo, in the order offset, gain, delay.
pub(super) const PARAMETERS: usize = 3;
const STATES: usize = 2 + PARAMETERS;

/// The prior distribution of the parameters under a hypothesis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ParameterPrior {
    /// Standard deviation of each parameter: m/s², 1, s.
    pub(super) deviation: [f64; PARAMETERS],
    /// Time constant of each parameter, s.
    pub(super) memory_s: [f64; PARAMETERS],
}

/// Each pair of parameters once.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Estimates of the parameters, with the covariance of each of the [`PAIRS`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct ParameterEstimates {
    values: [f64; PARAMETERS],
    covariance: [f64; PAIRS.len()],
}

/// The interval between two readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FilterStep {
    /// Its duration, s.
    pub(super) dt: f64,
    /// What one unit of each parameter adds to the deviation (m) and to its rate (m/s).
    pub(super) forcing: [[f64; 2]; PARAMETERS],
    /// Spectral density of the acceleration that no parameter explains, m²/s³.
    pub(super) density: f64,
}

/// Velocity given by a push by hand, m/s: one standard deviation. Chosen.
pub(super) const PUSH_DEVIATION_M_S: f64 = 0.15;
/// Cost of the explanation that the ball was pushed, nats. The prior odds of a push
/// within a twentieth of a second would be five or more. A lower cost makes the judgement
/// later and more certain, above all if one push follows another; at equally few false
/// alarms in `offbd soak`, 0.2 m/s at 1.5 nats find as much.
const PUSH_NATS: f64 = 1.0;
/// Standard deviations within which a gain and a delay are kept that were learnt while no evidence
/// was accumulated. On 25 simulated rigs with the properties of real ones 297 of 490 faults are
/// found with 2 and 280 without this, of those that are there from the start with half the gain 10
/// and 2 of 49, each with one false alarm in 50 h.
const LIKELY_DEVIATIONS: f64 = 2.0;
/// Standard deviation of the deviation's rate at the start, m/s. Chosen.
const START_DEVIATION_M_S: f64 = 0.5;

/// The filter. The covariance is in m, m/s and the units of the parameters.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct ServoFilter {
    prior: ParameterPrior,
    state: [f64; STATES],
    covariance: [[f64; STATES]; STATES],
}

impl ServoFilter {
    /// Builds a filter with the prior of the servo; call [`anchor`](Self::anchor) before
    /// use, since the ball's motion is unknown.
    pub(super) fn new(prior: ParameterPrior) -> Self {
        let mut covariance = [[0.0; STATES]; STATES];
        for (k, deviation) in prior.deviation.into_iter().enumerate() {
            covariance[2 + k][2 + k] = deviation * deviation;
        }
        Self { prior, state: [0.0; STATES], covariance }
    }

    /// Starts from the deviation `y` with variance `variance`, after a time without
    /// readings; the estimate of the servo is kept.
    pub(super) fn anchor(&mut self, y: f64, variance: f64) {
        for i in 0..2 {
            for j in 0..STATES {
                (self.covariance[i][j], self.covariance[j][i]) = (0.0, 0.0);
            }
        }
        (self.state[0], self.state[1]) = (y, 0.0);
        self.covariance[0][0] = variance;
        self.covariance[1][1] = START_DEVIATION_M_S * START_DEVIATION_M_S;
    }

    /// Adds a straight line to the deviation, as when the twin is rebased.
    pub(super) fn shift(&mut self, position: f64, velocity: f64) {
        self.state[0] += position;
        self.state[1] += velocity;
    }

    /// The prior of the parameters.
    pub(super) const fn prior(&self) -> &ParameterPrior {
        &self.prior
    }

    /// Estimate and variance of parameter `k`.
    pub(super) const fn parameter(&self, k: usize) -> (f64, f64) {
        (self.state[2 + k], self.covariance[2 + k][2 + k])
    }

    /// Covariance of the parameters.
    pub(super) fn spread(&self) -> [[f64; PARAMETERS]; PARAMETERS] {
        core::array::from_fn(|i| core::array::from_fn(|j| self.covariance[2 + i][2 + j]))
    }

    /// Estimates of all parameters.
    pub(super) fn parameters(&self) -> ParameterEstimates {
        let values = core::array::from_fn(|k| self.state[2 + k]);
        let covariance = PAIRS.map(|(i, j)| self.covariance[2 + i][2 + j]);
        ParameterEstimates { values, covariance }
    }

    /// Replaces the estimates of the parameters; those of the ball's motion are kept, and are
    /// independent of the new ones.
    pub(super) fn set_parameters(&mut self, parameters: &ParameterEstimates) {
        for i in 0..2 {
            for j in 2..STATES {
                (self.covariance[i][j], self.covariance[j][i]) = (0.0, 0.0);
            }
        }
        self.state[2..].copy_from_slice(&parameters.values);
        for ((i, j), covariance) in PAIRS.into_iter().zip(parameters.covariance) {
            self.covariance[2 + i][2 + j] = covariance;
            self.covariance[2 + j][2 + i] = covariance;
        }
    }

    /// Replaces the parameters by those of the prior if gain or delay are unlikely: a servo that is
    /// broken while no evidence is accumulated would otherwise be a healthy one with other
    /// parameters. Not for the offset, which a plate that was moved has too.
    pub(super) fn forget_unlikely(&mut self) {
        let is_unlikely =
            |k: usize| self.state[2 + k].abs() > LIKELY_DEVIATIONS * self.prior.deviation[k];
        if (1..PARAMETERS).any(is_unlikely) {
            self.set_parameters(&Self::new(self.prior).parameters());
        }
    }

    /// Predicts the state over `step`.
    pub(super) fn predict(&mut self, step: &FilterStep) {
        let FilterStep { dt, forcing, density } = *step;
        let keep = self.prior.memory_s.map(|memory_s| memory_s / (memory_s + dt));
        let x = &mut self.state;
        let forced = |row: usize, of: &dyn Fn(usize) -> f64| -> f64 {
            (0..PARAMETERS).map(|k| forcing[k][row] * of(2 + k)).sum()
        };
        let (push, pull) = (forced(0, &|k| x[k]), forced(1, &|k| x[k]));
        x[0] += dt * x[1] + push;
        x[1] += pull;
        for (value, keep) in x[2..].iter_mut().zip(keep) {
            *value *= keep;
        }
        // Φ P, then (Φ P) Φᵀ; only the first two rows of Φ are not diagonal.
        let p = &mut self.covariance;
        for j in 0..STATES {
            let (push, pull) = (forced(0, &|k| p[k][j]), forced(1, &|k| p[k][j]));
            p[0][j] += dt * p[1][j] + push;
            p[1][j] += pull;
            for (row, keep) in p[2..].iter_mut().zip(keep) {
                row[j] *= keep;
            }
        }
        for row in p.iter_mut() {
            let (push, pull) = (forced(0, &|k| row[k]), forced(1, &|k| row[k]));
            row[0] += dt * row[1] + push;
            row[1] += pull;
            for (value, keep) in row[2..].iter_mut().zip(keep) {
                *value *= keep;
            }
        }
        p[0][0] += density * dt * dt * dt / 3.0;
        p[0][1] += density * dt * dt / 2.0;
        p[1][0] += density * dt * dt / 2.0;
        p[1][1] += density * dt;
        // Restores the symmetry that rounding would destroy.
        let upper = *p;
        for (i, row) in p.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate().take(i) {
                *value = upper[j][i];
            }
        }
        for k in 0..PARAMETERS {
            let deviation = self.prior.deviation[k];
            p[2 + k][2 + k] += (1.0 - keep[k] * keep[k]) * deviation * deviation;
        }
    }

    /// The Kalman update for an innovation of variance `s` whose covariance with the
    /// state is `row`.
    fn update(&mut self, row: &[f64; STATES], innovation: f64, s: f64) {
        for i in 0..STATES {
            let gain = row[i] / s;
            self.state[i] += gain * innovation;
            for (covariance, shared) in self.covariance[i].iter_mut().zip(row) {
                *covariance -= gain * shared;
            }
        }
    }

    /// Corrects with the deviation `y` of variance `variance`, `dt` after the last.
    /// Returns the log-likelihood of the reading, nats, up to a constant.
    pub(super) fn correct(&mut self, y: f64, variance: f64, dt: f64) -> f64 {
        let p = &mut self.covariance;
        let innovation = y - self.state[0];
        let likelihood = |s: f64| -0.5 * (innovation * innovation / s + s.ln());
        let reach = PUSH_DEVIATION_M_S * PUSH_DEVIATION_M_S;
        let plain = likelihood(p[0][0] + variance);
        // For a smaller innovation a push cannot be the likelier explanation.
        let far = innovation * innovation > 2.0 * PUSH_NATS * (p[0][0] + variance);
        let wide = reach * dt * dt / 3.0;
        let pushed = if far { likelihood(p[0][0] + wide + variance) - PUSH_NATS } else { plain };
        if pushed > plain {
            p[0][0] += wide;
            p[0][1] += reach * dt / 2.0;
            p[1][0] += reach * dt / 2.0;
            p[1][1] += reach;
        }
        let row = p[0];
        self.update(&row, innovation, row[0] + variance);
        plain.max(pushed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEADY_FAULTY: ParameterPrior =
        ParameterPrior { deviation: [0.3, 0.7, 0.2], memory_s: [1e9; 3] };

    /// Follows `path` with a twin that accelerates by sin(2 t).
    fn follow(prior: ParameterPrior, path: impl Fn(f64) -> f64) -> ServoFilter {
        let twin = |t: f64| (-(2.0 * t).sin() / 4.0, -(2.0 * t).cos() / 2.0, (2.0 * t).sin());
        let (dt, variance) = (0.05, 1e-8);
        let mut filter = ServoFilter::new(prior);
        filter.anchor(path(0.0), variance);
        for i in 0..200 {
            let (t, next) = (f64::from(i) * dt, f64::from(i + 1) * dt);
            let ((p, v, a), (p1, v1, a1)) = (twin(t), twin(next));
            let forcing =
                [[dt * dt / 2.0, dt], [p1 - p - v * dt, v1 - v], [-(v1 - v - a * dt), -(a1 - a)]];
            filter.predict(&FilterStep { dt, forcing, density: 1e-9 });
            filter.correct(path(next), variance, dt);
        }
        filter
    }

    /// A servo with another offset, gain or delay: ÿ is b, m·sin 2t or sin 2(t − d) − sin
    /// 2t.
    #[test]
    fn validate_parameters_against_closed_forms() {
        let late = |t: f64| ((2.0 * t).sin() - (2.0 * (t - 0.01)).sin()) / 4.0;
        let cases = [
            (follow(STEADY_FAULTY, |t| 0.1 * t * t), [0.2, 0.0, 0.0]),
            (follow(STEADY_FAULTY, |t| (2.0 * t).sin() / 8.0 + 0.3 * t), [0.0, -0.5, 0.0]),
            (follow(STEADY_FAULTY, late), [0.0, 0.0, 0.01]),
        ];
        for (filter, wanted) in cases {
            for (k, wanted) in wanted.into_iter().enumerate() {
                let found = filter.parameter(k).0;
                assert!((found - wanted).abs() < 2e-3, "{k}: {found}, not {wanted}");
            }
        }
    }

    /// A gain that is off by 0.3 is unlikely if gains differ by 0.1, and not if they differ by
    /// 0.7; an offset is kept in any case.
    #[test]
    fn an_unlikely_parameter_is_forgotten() {
        for (deviation, forgotten) in [(0.1, true), (0.7, false)] {
            let prior = ParameterPrior { deviation: [0.3, deviation, 0.2], memory_s: [1e9; 3] };
            let mut filter = follow(prior, |t| 0.3 * (2.0 * t).sin() / 4.0 + 0.6 * t);
            let learnt = filter.parameter(1);
            assert!(learnt.0 < -0.25, "{learnt:?}");
            filter.forget_unlikely();
            let wanted = if forgotten { (0.0, deviation * deviation) } else { learnt };
            assert_eq!(filter.parameter(1), wanted);
        }
        let prior = ParameterPrior { deviation: [0.01, 0.7, 0.2], memory_s: [1e9; 3] };
        let mut filter = follow(prior, |t| 0.1 * t * t);
        let learnt = filter.parameter(0);
        assert!(learnt.0 > 0.1, "{learnt:?}");
        filter.forget_unlikely();
        assert_eq!(filter.parameter(0), learnt);
    }

    #[test]
    fn a_push_is_not_a_parameter() {
        let filter = follow(STEADY_FAULTY, |t| 0.25 * (t - 4.01).max(0.0));
        for k in 0..PARAMETERS {
            assert!(filter.parameter(k).0.abs() < 0.03, "{k}: {:?}", filter.parameter(k));
        }
    }

    #[test]
    fn the_covariance_stays_one() {
        let p = follow(STEADY_FAULTY, |t| 0.01 * (7.0 * t).sin()).covariance;
        for i in 0..STATES {
            assert!(p[i][i] > 0.0, "{i}: {}", p[i][i]);
            for j in 0..STATES {
                assert!((p[i][j] - p[j][i]).abs() <= 1e-9 * (p[i][i] * p[j][j]).sqrt());
            }
        }
    }
}
