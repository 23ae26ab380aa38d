//! Evidence against one servo: two hypotheses about the ball's motion along its axis,
//! compared as readings arrive.
//!
//! One Kalman filter ([`filter`]) assumes that the servo is healthy: its offset, gain and
//! delay are close to those of the twin and steady. The other lets them take any value
//! that a broken servo may have, and change within seconds. The log-likelihood ratio of
//! the two, accumulated and never below zero, is Page's CUSUM of a composite hypothesis:
//! for true models and white noise it exceeds h by chance less than once in eʰ blocks
//! (Lorden 1971, Basseville & Nikiforov 1993, 2.2 and 5.2). Multiple models: Magill 1965;
//! pushes as a rival explanation: Willsky & Jones 1976.
//!
//! The parameters of such a filter are the servo's effective offset, gain and delay. One that
//! begins with the evidence ([`staying`]) tells the kind of fault. Both hypotheses take the size
//! of the noise as learnt; the evidence of the [`path`] of the last two seconds does not depend
//! on it. While the ball cannot respond (at rest within its breakaway angle, at the edge, unseen)
//! nothing is compared.

mod answer;
mod block;
mod estimate;
mod filter;
mod least_squares;
mod path;
mod staying;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use answer::ServoAnswer;
pub(super) use block::BLOCK_S;
pub use block::TwinPath;
pub use estimate::ServoEstimate;
use serde::{Deserialize, Serialize};

use block::{BlockBuilder, ReadingBlock};
use filter::{FilterStep, PARAMETERS, ParameterEstimates, ParameterPrior, ServoFilter};
use least_squares::LeastSquares;
use path::PathEvidence;
use staying::StayingFault;

use super::calibration::MOST_MODEL_ERROR_M_S2;
use crate::vocabulary::SimTime;

/// Parameters of a broken servo: ±0.3 m/s² is a horn slipped by 2.5°, a gain change of
/// −0.7 lies between half dead and dead, 0.2 s is a servo slowed down tenfold; they may
/// change within seconds.
const FAULTY: ParameterPrior =
    ParameterPrior { deviation: [0.3, 0.7, 0.2], memory_s: [5.0; PARAMETERS] };

/// Parameters of a healthy servo of a learnt rig: offsets within 0.15° over the plate, a
/// gain known to 7 %, a delay known to 20 ms; all of them steady.
const HEALTHY_LEARNT: ParameterPrior =
    ParameterPrior { deviation: [0.02, 0.07, 0.02], memory_s: [100.0; PARAMETERS] };

/// Parameters of a healthy servo before anything is learnt: plates 1.7° off level, gains
/// from 0.5 to 2 and lags from 80 to 300 ms have been seen on healthy rigs. The filter
/// learns them within the first minutes.
const HEALTHY_UNKNOWN: ParameterPrior =
    ParameterPrior { deviation: [0.2, 0.4, 0.1], memory_s: [1000.0; PARAMETERS] };

/// Correlation time of the acceleration that the twin does not explain, s: converts a
/// standard deviation over the half second in which it is learnt into a spectral density.
const MODEL_ERROR_S: f64 = 0.5;
/// Acceleration that the twin of a rig that is not learnt does not explain, m/s².
/// Assumed: that of the worst simulated rigs.
const UNKNOWN_ERROR_M_S2: f64 = MOST_MODEL_ERROR_M_S2;
/// Error of the twin's delay after a change of its acceleration, s: that of a first-order
/// lag as a model of a servo.
const SHAPE_S: f64 = 0.01;
/// Error of the twin for an acceleration beyond the familiar range, as a fraction of the
/// excess: play matters more in small motions, the rate of a servo is limited, and a
/// circle determines dead time and lag no better than a single sine.
const UNFAMILIAR_SHARE: f64 = 0.3;
/// Speed below which friction begins to hold the ball, m/s.
const STICKING_M_S: f64 = 0.02;
/// Time for which friction then acts in one direction, s. Chosen: less than the half second over
/// which the model error is learnt. On 27 simulated rigs with the properties of real ones 0.1, 0.3
/// and 0.5 s find 336, 332 and 333 of 530 faults, with one false alarm in 54 h each.
const STICKING_S: f64 = 0.3;
/// Time for which a servo that differs from a first-order lag deviates in one direction,
/// s. Chosen.
const LATE_S: f64 = 0.1;
/// Readings of a block that count as independent, at most: sensors repeat themselves.
/// Chosen.
const INDEPENDENT_READINGS: u32 = 4;
/// Time of motion after which evidence is accumulated, s: when a hand lets the ball go
/// its speed is not known at first. Chosen.
const SETTLED_S: f64 = 1.0;
/// Time constant of the session's offset, s: many times the time that confirms a fault.
/// Chosen.
const STEADY_S: f64 = 20.0;
/// Least standard deviation of a block's mean, m: roughness of plate and touch panel.
const ROUGHNESS_M: f64 = 1.4e-4;

/// Evidence from which on the kind of fault is determined from all that follows, nats. Chosen: well
/// below what makes a servo suspected.
const CLASSIFIED_NATS: f64 = 4.0;

/// Allowance for the session's level, in standard errors. Chosen.
const LEVEL_ERRORS: f64 = 2.0;

/// Acceleration of a ping-pong ball by moving air, m/s²: half of what a fan at arm's
/// length causes.
const GUST_M_S2: f64 = 0.03;
/// Duration of a gust, s.
const GUST_S: f64 = 2.0;

/// Evidence from which on a servo is broken beyond doubt, as a multiple of what confirms a fault. The
/// healthy hypothesis then begins again with the parameters from before the fault, as it does whenever
/// the evidence is at its largest: otherwise it learns an offset as the level of the session, the test
/// passes while the fault lasts, and its repair is a new fault. It does not keep these parameters:
/// those of a session that has just begun are hardly known, and a repaired servo would never seem
/// healthy. Chosen: 19.5 nats if 13 confirm a fault.
const BROKEN_SHARE: f64 = 1.5;

/// Largest accumulated evidence, nats: limits how long it takes to fall after a servo has
/// recovered. Chosen.
pub(super) const MAX_NATS: f64 = 40.0;

/// What is known of an axis before a session; immutable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisPrior {
    /// Standard deviation of a reading, m.
    pub noise_m: f64,
    /// What was learnt; `None` if nothing was.
    pub learnt: Option<LearntPrior>,
    /// Acceleration that a ball at rest withstands, m/s².
    pub breakaway_m_s2: f64,
    /// Effect of moving air on the ball relative to a ping-pong ball, in [0, 1].
    pub air_drag_ratio: f64,
    /// Largest acceleration with which gain and delay were learnt, m/s².
    pub familiar_m_s2: f64,
    /// Evidence that confirms a fault, nats; infinite if none does.
    pub confirm_nats: f64,
}

/// What was learnt of an axis from healthy sessions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntPrior {
    /// Acceleration that the twin does not explain, over half a second, m/s².
    pub model_error_m_s2: f64,
    /// Standard deviation of the offset from session to session, m/s².
    pub offset_spread_m_s2: f64,
    /// Standard deviation of the gain from session to session, as a fraction.
    pub gain_spread: f64,
}

impl AxisPrior {
    fn parameters(&self) -> ParameterPrior {
        let Some(learnt) = &self.learnt else { return HEALTHY_UNKNOWN };
        let mut prior = HEALTHY_LEARNT;
        let gust_m_s2 = GUST_M_S2 * self.air_drag_ratio;
        if gust_m_s2 > prior.deviation[0] {
            (prior.deviation[0], prior.memory_s[0]) = (gust_m_s2, GUST_S);
        }
        let spread = [learnt.offset_spread_m_s2, learnt.gain_spread, 0.0];
        for (k, spread) in spread.into_iter().enumerate() {
            let wander = prior.deviation[k];
            let deviation = wander.hypot(spread);
            // The rate of change within a session does not depend on the spread.
            prior.memory_s[k] *= (deviation / wander).powi(2);
            prior.deviation[k] = deviation;
        }
        prior
    }

    /// Returns the evidence from which on a servo is broken beyond doubt, nats; infinite if none
    /// confirms a fault.
    fn broken_nats(&self) -> f64 {
        let nats = BROKEN_SHARE * self.confirm_nats;
        if nats.is_finite() { nats.min(MAX_NATS) } else { nats }
    }

    /// Returns the spectral density of the acceleration that the twin does not explain,
    /// m²/s³, at a speed, an acceleration of the twin and its rate of change, m/s³.
    fn density(&self, speed_m_s: f64, pull_m_s2: f64, jerk_m_s3: f64) -> f64 {
        let error = self.learnt.map_or(UNKNOWN_ERROR_M_S2, |l| l.model_error_m_s2);
        let stuck = self.breakaway_m_s2 * (1.0 - speed_m_s / STICKING_M_S).max(0.0);
        let late = SHAPE_S * jerk_m_s3;
        let strange = UNFAMILIAR_SHARE * (pull_m_s2 - self.familiar_m_s2).max(0.0);
        MODEL_ERROR_S * (error * error + strange * strange)
            + STICKING_S * stuck * stuck
            + LATE_S * late * late
    }

    fn variance(&self, n: u32) -> f64 {
        self.noise_m * self.noise_m / f64::from(n.clamp(1, INDEPENDENT_READINGS))
            + ROUGHNESS_M * ROUGHNESS_M
    }
}

/// The two hypotheses about one axis, each a Kalman filter.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ServoFilterBank {
    prior: AxisPrior,
    builder: BlockBuilder,
    last: Option<ReadingBlock>,
    healthy: ServoFilter,
    /// Parameters of the healthy servo when neither kind of evidence last spoke for a fault.
    unaccused: ParameterEstimates,
    faulty: ServoFilter,
    /// The servo since there is evidence for a fault; `None` without.
    staying: Option<Box<StayingFault>>,
    /// Evidence for a fault, nats, in [0, [`MAX_NATS`]].
    nats: f64,
    /// When the evidence last was zero, s.
    rising_since: Option<f64>,
    /// Log-likelihood of the readings under the healthy hypothesis, nats.
    log_likelihood_nats: f64,
    /// Time of motion followed since the session began or a gap ended, s.
    followed_s: f64,
    steady_m_s2: f64,
    least_squares: LeastSquares,
    path: PathEvidence,
}

impl ServoFilterBank {
    #[must_use]
    pub fn new(prior: AxisPrior) -> Self {
        let healthy = ServoFilter::new(prior.parameters());
        Self {
            prior,
            builder: BlockBuilder::default(),
            last: None,
            unaccused: healthy.parameters(),
            healthy,
            faulty: ServoFilter::new(FAULTY),
            staying: None,
            nats: 0.0,
            rising_since: None,
            log_likelihood_nats: 0.0,
            followed_s: 0.0,
            steady_m_s2: 0.0,
            least_squares: LeastSquares::default(),
            path: PathEvidence::default(),
        }
    }

    /// Takes a reading at `t` s and the twin's path at the same time. Returns whether it
    /// completed a block that could be evaluated.
    pub fn take(&mut self, t: f64, measured_m: f64, path: &TwinPath) -> bool {
        let Some(block) = self.builder.take(t, measured_m, path) else { return false };
        self.least_squares.take(&block);
        let Some(last) = self.last.replace(block) else {
            let variance = self.prior.variance(block.n);
            self.healthy.anchor(block.deviation_m(), variance);
            self.faulty.anchor(block.deviation_m(), variance);
            if let Some(staying) = &mut self.staying {
                staying.anchor(block.deviation_m(), variance);
            }
            return false;
        };
        self.weigh(&last, &block);
        true
    }

    fn weigh(&mut self, last: &ReadingBlock, block: &ReadingBlock) {
        let dt = block.t - last.t;
        let speed = (block.measured_m - last.measured_m).abs() / dt;
        let jerk = (block.path.acceleration_m_s2 - last.path.acceleration_m_s2) / dt;
        let pull = last.path.acceleration_m_s2.abs().max(block.path.acceleration_m_s2.abs());
        let density = self.prior.density(speed, pull, jerk);
        let step = FilterStep { dt, forcing: forcing(last, block), density };
        let (y, variance) = (block.deviation_m(), self.prior.variance(block.n));
        self.path.take(block, variance, density, self.healthy.prior());
        self.healthy.predict(&step);
        self.faulty.predict(&step);
        let faulty = self.faulty.correct(y, variance, dt);
        let healthy = self.healthy.correct(y, variance, dt);
        self.log_likelihood_nats += healthy;
        self.followed_s += dt;
        let share = dt / self.followed_s.min(STEADY_S);
        self.steady_m_s2 += share * (self.healthy.parameter(0).0 - self.steady_m_s2);
        if self.followed_s < SETTLED_S {
            return;
        }
        if self.followed_s - dt < SETTLED_S {
            self.healthy.forget_unlikely();
        }
        let before = self.nats;
        self.nats = (before + faulty - healthy).clamp(0.0, MAX_NATS);
        if self.nats == 0.0 {
            if self.path.nats().is_some_and(|nats| nats <= 0.0) {
                self.unaccused = self.healthy.parameters();
            }
            self.rising_since = None;
        } else {
            self.rising_since = self.rising_since.or(Some(last.t));
        }
        let broken_nats = self.prior.broken_nats();
        let rises = before < broken_nats || self.nats >= MAX_NATS;
        if self.nats >= broken_nats && rises {
            self.healthy.set_parameters(&self.unaccused);
        }
        self.stay(&step, (y, variance), healthy);
    }

    /// Follows a broken servo while there is evidence, from [`CLASSIFIED_NATS`] on.
    /// A repair ends the evidence of the path too.
    fn stay(&mut self, step: &FilterStep, reading: (f64, f64), healthy: f64) {
        match &mut self.staying {
            Some(staying) if self.nats == 0.0 => {
                if staying.most_nats() >= self.prior.broken_nats() {
                    self.path.exonerate();
                }
                self.staying = None;
            }
            Some(staying) => staying.follow(step, reading, self.nats, healthy),
            None if self.nats >= CLASSIFIED_NATS => {
                self.staying = Some(Box::new(StayingFault::new(reading)));
            }
            None => {}
        }
    }

    /// Stops following the ball, which cannot respond or was not seen. The estimates of
    /// the servo are kept.
    pub fn pause(&mut self) {
        self.builder.drop();
        self.path.pause();
        self.least_squares.pause();
        self.last = None;
    }

    /// Restarts after a gap, in which anything may have happened to the ball, and at the
    /// edge: what comes before and after a bounce is not one path, and at first the speed
    /// of the ball is not known. The estimates of the servo and the evidence are kept.
    pub fn restart(&mut self) {
        self.pause();
        self.path.clear();
        self.followed_s = 0.0;
    }

    /// Resets the evidence: another cause explains it.
    pub fn exonerate(&mut self) {
        self.pause();
        self.path.exonerate();
        (self.faulty, self.staying) = (ServoFilter::new(FAULTY), None);
        (self.nats, self.rising_since) = (0.0, None);
    }

    /// Follows a rebase of the twin by the line through `position` m at `t` with slope
    /// `velocity` m/s.
    pub fn rebase(&mut self, t: f64, position: f64, velocity: f64) {
        self.builder.drop();
        self.least_squares.pause();
        self.path.rebase(t, position, velocity);
        let Some(last) = &mut self.last else { return };
        let at_last = position + velocity * (last.t - t);
        last.path.position_m -= at_last;
        last.path.velocity_m_s -= velocity;
        self.healthy.shift(at_last, velocity);
        self.faulty.shift(at_last, velocity);
        if let Some(staying) = &mut self.staying {
            staying.shift(at_last, velocity);
        }
    }

    /// Evidence for a fault, nats: the log-likelihood ratio of a broken to a healthy
    /// servo.
    #[must_use]
    pub const fn nats(&self) -> f64 {
        self.nats
    }

    /// Evidence of the path of the last two seconds and of what came before, nats, in which
    /// the scale of the misfit is the session's own; negative if the path speaks for a
    /// healthy servo, `None` if unknown.
    #[must_use]
    pub const fn path_nats(&self) -> Option<f64> {
        self.path.nats()
    }

    /// Largest such evidence so far, nats.
    #[must_use]
    pub const fn most_path_nats(&self) -> f64 {
        self.path.most_nats()
    }

    /// Log-likelihood of all readings under the healthy hypothesis, nats, up to a
    /// constant.
    #[must_use]
    pub const fn log_likelihood_nats(&self) -> f64 {
        self.log_likelihood_nats
    }

    /// Returns the acceleration that the plate demands of the ball, m/s², of the least size that the
    /// twin's acceleration `twin_m_s2` and the uncertainty of the session's level allow.
    #[must_use]
    pub fn least_pull_m_s2(&self, twin_m_s2: f64) -> f64 {
        let (offset, variance) = self.healthy.parameter(0);
        let pull = twin_m_s2 + offset;
        (pull.abs() - LEVEL_ERRORS * variance.sqrt()).max(0.0).copysign(pull)
    }

    /// The offset of this session, averaged over 20 s, m/s²; a fault that has just begun
    /// hardly affects it.
    #[must_use]
    pub const fn steady_m_s2(&self) -> f64 {
        self.steady_m_s2
    }

    /// Standard error of the offset of this session, m/s².
    #[must_use]
    pub fn steady_error_m_s2(&self) -> f64 {
        self.healthy.parameter(0).1.sqrt()
    }

    /// When the evidence began to accumulate: Page's estimate of the onset.
    #[must_use]
    pub fn rising_since(&self) -> Option<SimTime> {
        self.rising_since.and_then(SimTime::new)
    }

    /// The response of the servo relative to the twin's: since there is evidence for a fault, or else
    /// the recent response. The recent one has kinds only if the servo's monitor is `suspicious`,
    /// because the residual may confirm a fault before there is enough evidence to follow it.
    #[must_use]
    pub fn answer(&self, suspicious: bool) -> ServoAnswer {
        match self.staying.as_ref().and_then(|staying| staying.answer()) {
            Some(answer) => answer,
            None if suspicious => ServoAnswer {
                likelihoods: answer::likelihoods(&self.faulty),
                ..ServoAnswer::of(&self.faulty)
            },
            None => ServoAnswer::of(&self.faulty),
        }
    }

    /// The response over the session; `None` if too little was seen.
    #[must_use]
    pub fn estimate(&self) -> Option<ServoEstimate> {
        self.least_squares.estimate()
    }
}

/// Returns what one unit of each parameter adds to the deviation and its rate from one
/// block to the next: the offset, the twin's acceleration, and its rate of change.
fn forcing(last: &ReadingBlock, block: &ReadingBlock) -> [[f64; 2]; PARAMETERS] {
    let (dt, a, b) = (block.t - last.t, &last.path, &block.path);
    let gained = b.velocity_m_s - a.velocity_m_s;
    let moved = b.position_m - a.position_m - a.velocity_m_s * dt;
    let bent = gained - a.acceleration_m_s2 * dt;
    [[dt * dt / 2.0, dt], [moved, gained], [-bent, a.acceleration_m_s2 - b.acceleration_m_s2]]
}
