//! How a servo answers: two explanations of the ball's motion along one axis,
//! weighed against each other as readings come.
//!
//! One Kalman filter ([`filter`]) believes the servo healthy: offset, gain and
//! delay are nearly those of the twin, and if not, steadily so. The other lets
//! them be anything that a broken servo may do, and lets them change within
//! seconds. The logarithm of the ratio of their likelihoods, added up and never
//! let below zero, is Page's CUSUM of a composite hypothesis: for true models
//! and white noise it passes h by chance less than once in eʰ blocks (Lorden
//! 1971, Basseville & Nikiforov 1993, 2.2 and 5.2). Multiple models: Magill
//! 1965; pushes as rival explanation: Willsky & Jones 1976.
//!
//! The open filter's parameters are the servo's effective offset, gain and
//! delay, which say of which kind a fault is. Beside them, [`path_error`] holds the
//! path itself against the twin's. Where a ball cannot answer - at
//! rest within its breakaway angle, at the edge, unseen - nothing is weighed.

mod answer;
mod block;
mod estimate;
mod filter;
mod path_error;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
pub use answer::Answer;
pub use block::Course;
pub use estimate::ServoEstimate;

use block::{Block, Gatherer};
use estimate::Session;
use filter::{Filter, PARAMETERS, Prior, Step};
use path_error::PathError;

use crate::vocabulary::SimTime;

/// What a broken servo may do: ±0.3 m/s² is a horn slipped by 2.5°, a gain
/// change of −0.7 lies between half dead and dead, 0.2 s is a servo slowed
/// down tenfold; and it may begin within seconds.
const OPEN: Prior = Prior { deviation: [0.3, 0.7, 0.2], memory_s: [5.0; PARAMETERS] };

/// What a healthy servo of a learnt rig does: offsets within 0.15° over the
/// plate, a gain learnt to 7 %, a delay learnt to 20 ms; all of them steady.
const LEARNT: Prior = Prior { deviation: [0.02, 0.07, 0.02], memory_s: [100.0; PARAMETERS] };

/// What is known of a servo before anything is learnt: plates 1.7° off level,
/// gains from 0.5 to 2 and lags from 80 to 300 ms have been seen on healthy
/// rigs. They are learnt on the way, within the first minutes.
const UNKNOWN: Prior = Prior { deviation: [0.2, 0.4, 0.1], memory_s: [1000.0; PARAMETERS] };

/// Correlation time of what the twin leaves out, s: turns a deviation over the
/// half second in which it is learnt into a spectral density.
const MODEL_ERROR_S: f64 = 0.5;
/// What the twin of a rig that is not learnt leaves out, m/s².
const UNKNOWN_ERROR_M_S2: f64 = 0.04;
/// How long after a change of its acceleration the twin may be wrong about it,
/// s: what a lag of the first order leaves out of a servo.
const SHAPE_S: f64 = 0.01;
/// Share of an acceleration beyond the familiar ones by which the twin may be
/// wrong: play takes a larger part of small motions, a servo turns only so fast,
/// and a circle tells dead time and lag apart as little as one sine can.
const UNFAMILIAR: f64 = 0.3;
/// Speed below which friction begins to hold the ball, m/s, and the time for
/// which it then acts one way, s: with 0.1 a ball that creeps to and fro within its
/// breakaway angle counted against its servo on real rigs, with 0.5 faults of gentle
/// motion are missed.
const STICKING_M_S: f64 = 0.02;
const STICKING_S: f64 = 0.3;
/// Time for which a lag that is not of the first order acts one way, s.
const LATE_S: f64 = 0.1;
/// Readings of a block that count as independent: sensors repeat themselves.
const INDEPENDENT: u32 = 4;
/// Motion after which the ball is followed well enough to weigh anything, s: a
/// hand lets it go, and its speed is not known yet.
const SETTLED_S: f64 = 1.0;
/// Memory of the offset that is this session's, s: many times what it takes to
/// confirm a fault.
const STEADY_S: f64 = 20.0;
/// Error of a block's mean that is always assumed, m: roughness of plate and
/// panel.
const ROUGHNESS_M: f64 = 1.4e-4;

/// Standard errors of the session's level that are allowed.
const LEVEL_ERRORS: f64 = 2.0;

/// Acceleration that moving air gives a ping-pong ball, m/s²: half of what a
/// fan at arm's length does.
const GUST_M_S2: f64 = 0.03;
/// How long a gust lasts, s.
const GUST_S: f64 = 2.0;

/// Most nats that a monitor keeps: how far it may run ahead of a servo that is
/// well again.
pub(super) const GATHERED_NATS: f64 = 40.0;

/// What is known of an axis before the session; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisNature {
    /// Standard deviation of a reading, m.
    pub noise_m: f64,
    /// What was learnt; none if nothing was.
    pub learnt: Option<LearntNature>,
    /// Acceleration that a ball at rest resists, m/s².
    pub breakaway_m_s2: f64,
    /// How much moving air drives the ball, over what it does to a ping-pong ball, in
    /// [0, 1].
    pub sail_share: f64,
    /// Acceleration up to which gain and delay were learnt, m/s².
    pub familiar_m_s2: f64,
}

/// What was learnt of an axis from healthy sessions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearntNature {
    /// Acceleration that the twin leaves out, over half a second, m/s².
    pub model_error_m_s2: f64,
    /// Standard deviation of the offset from session to session, m/s².
    pub offset_spread_m_s2: f64,
    /// Standard deviation of the gain from session to session, as a share.
    pub gain_spread: f64,
}

impl AxisNature {
    fn prior(&self) -> Prior {
        let Some(learnt) = &self.learnt else { return UNKNOWN };
        let mut prior = LEARNT;
        let gust_m_s2 = GUST_M_S2 * self.sail_share;
        if gust_m_s2 > prior.deviation[0] {
            (prior.deviation[0], prior.memory_s[0]) = (gust_m_s2, GUST_S);
        }
        let spread = [learnt.offset_spread_m_s2, learnt.gain_spread, 0.0];
        for (k, spread) in spread.into_iter().enumerate() {
            let wander = prior.deviation[k];
            let deviation = wander.hypot(spread);
            // Whatever its spread, it wanders as fast within a session.
            prior.memory_s[k] *= (deviation / wander).powi(2);
            prior.deviation[k] = deviation;
        }
        prior
    }

    /// Spectral density of what the twin leaves out at a speed, at its own
    /// acceleration and at the rate of change of that, m/s³; in m²/s³.
    fn density(&self, speed_m_s: f64, pull_m_s2: f64, jerk_m_s3: f64) -> f64 {
        let error = self.learnt.map_or(UNKNOWN_ERROR_M_S2, |l| l.model_error_m_s2);
        let stuck = self.breakaway_m_s2 * (1.0 - speed_m_s / STICKING_M_S).max(0.0);
        let late = SHAPE_S * jerk_m_s3;
        let strange = UNFAMILIAR * (pull_m_s2 - self.familiar_m_s2).max(0.0);
        MODEL_ERROR_S * (error * error + strange * strange)
            + STICKING_S * stuck * stuck
            + LATE_S * late * late
    }

    fn variance(&self, n: u32) -> f64 {
        self.noise_m * self.noise_m / f64::from(n.clamp(1, INDEPENDENT)) + ROUGHNESS_M * ROUGHNESS_M
    }
}

/// The two explanations of one axis.
#[derive(Clone, Debug)]
pub struct Servo {
    nature: AxisNature,
    gatherer: Gatherer,
    last: Option<Block>,
    healthy: Filter,
    open: Filter,
    /// Evidence for a fault, nats, in [0, [`GATHERED_NATS`]].
    nats: f64,
    /// When it was last without any, s.
    rising_since: Option<f64>,
    /// How well the healthy explanation has foretold the readings, nats.
    foretold_nats: f64,
    /// Motion followed since the session began or a gap ended, s.
    followed_s: f64,
    steady_m_s2: f64,
    session: Session,
    path: PathError,
}

impl Servo {
    #[must_use]
    pub fn new(nature: AxisNature) -> Self {
        Self {
            nature,
            gatherer: Gatherer::default(),
            last: None,
            healthy: Filter::new(nature.prior()),
            open: Filter::new(OPEN),
            nats: 0.0,
            rising_since: None,
            foretold_nats: 0.0,
            followed_s: 0.0,
            steady_m_s2: 0.0,
            session: Session::default(),
            path: PathError::default(),
        }
    }

    /// Takes a reading at `t` s and the twin's course at the same moment.
    /// Returns whether that completed a block that could be weighed.
    pub fn take(&mut self, t: f64, measured_m: f64, course: &Course) -> bool {
        let Some(block) = self.gatherer.take(t, measured_m, course) else { return false };
        self.path.take(block.t, block.deviation_m());
        let Some(last) = self.last.replace(block) else {
            let variance = self.nature.variance(block.n);
            self.healthy.anchor(block.deviation_m(), variance);
            self.open.anchor(block.deviation_m(), variance);
            return false;
        };
        self.weigh(&last, &block);
        true
    }

    fn weigh(&mut self, last: &Block, block: &Block) {
        let dt = block.t - last.t;
        let speed = (block.measured_m - last.measured_m).abs() / dt;
        let jerk = (block.course.acceleration_m_s2 - last.course.acceleration_m_s2) / dt;
        let pull = last.course.acceleration_m_s2.abs().max(block.course.acceleration_m_s2.abs());
        let density = self.nature.density(speed, pull, jerk);
        let step = Step { dt, forcing: forcing(last, block), density };
        let (y, variance) = (block.deviation_m(), self.nature.variance(block.n));
        self.healthy.predict(&step);
        self.open.predict(&step);
        let open = self.open.correct(y, variance, dt);
        let healthy = self.healthy.correct(y, variance, dt);
        self.foretold_nats += healthy;
        self.followed_s += dt;
        let share = dt / self.followed_s.min(STEADY_S);
        self.steady_m_s2 += share * (self.healthy.parameter(0).0 - self.steady_m_s2);
        if self.followed_s < SETTLED_S {
            return;
        }
        self.nats = (self.nats + open - healthy).clamp(0.0, GATHERED_NATS);
        self.rising_since = match self.nats > 0.0 {
            true => self.rising_since.or(Some(last.t)),
            false => None,
        };
        self.session.take(dt, &self.open, &OPEN);
    }

    /// Stops following the ball: it cannot answer, or was not seen. What is
    /// known of the servo stays.
    pub fn pause(&mut self) {
        self.gatherer.drop();
        self.path.pause();
        self.last = None;
    }

    /// Begins anew after a gap, in which anything may have happened to the ball.
    pub fn restart(&mut self) {
        self.pause();
        self.path.clear();
        self.followed_s = 0.0;
    }

    /// Forgets all evidence: another cause accounts for it.
    pub fn exonerate(&mut self) {
        self.pause();
        self.path.clear();
        self.open = Filter::new(OPEN);
        (self.nats, self.rising_since) = (0.0, None);
    }

    /// The twin was moved by the line through `position` m at `t` with slope
    /// `velocity` m/s.
    pub fn rebase(&mut self, t: f64, position: f64, velocity: f64) {
        self.gatherer.drop();
        self.path.rebase(t, position, velocity);
        let Some(last) = &mut self.last else { return };
        let at_last = position + velocity * (last.t - t);
        last.course.position_m -= at_last;
        last.course.velocity_m_s -= velocity;
        self.healthy.shift(at_last, velocity);
        self.open.shift(at_last, velocity);
    }

    /// Evidence for a fault, nats: the logarithm of how much likelier the
    /// readings are if the servo is broken.
    #[must_use]
    pub const fn nats(&self) -> f64 {
        self.nats
    }

    /// How far the path of the last two seconds bends from the twin's, root mean
    /// square, m; none where the ball could not answer all the time.
    #[must_use]
    pub const fn path_error_m(&self) -> Option<f64> {
        self.path.error_m()
    }

    /// The most that it has bent so far, m.
    #[must_use]
    pub const fn most_path_error_m(&self) -> f64 {
        self.path.most_m()
    }

    /// Log-likelihood of all readings under the healthy explanation, nats, up to a
    /// constant.
    #[must_use]
    pub const fn foretold_nats(&self) -> f64 {
        self.foretold_nats
    }

    /// Acceleration that the plate asks of the ball at least, m/s², where the twin's is
    /// `twin_m_s2`, for all that is known of the level of this session.
    #[must_use]
    pub fn least_pull_m_s2(&self, twin_m_s2: f64) -> f64 {
        let (offset, variance) = self.healthy.parameter(0);
        ((twin_m_s2 + offset).abs() - LEVEL_ERRORS * variance.sqrt()).max(0.0)
    }

    /// The offset of this session over the last 20 s, m/s²: a fault that
    /// has just begun is hardly in it.
    #[must_use]
    pub const fn steady_m_s2(&self) -> f64 {
        self.steady_m_s2
    }

    /// When the evidence began to gather: Page's estimate of the onset.
    #[must_use]
    pub fn rising_since(&self) -> Option<SimTime> {
        self.rising_since.and_then(SimTime::new)
    }

    /// How the servo answers now, against the twin's.
    #[must_use]
    pub fn answer(&self) -> Answer {
        Answer::new(&self.open, self.nats)
    }

    /// How it has answered over the session; none where too little was seen.
    #[must_use]
    pub fn estimate(&self) -> Option<ServoEstimate> {
        self.session.estimate()
    }
}

/// What one unit of each parameter adds to the deviation and its rate from one
/// block to the next: of the offset, of the twin's own acceleration, and of its
/// rate of change.
fn forcing(last: &Block, block: &Block) -> [[f64; 2]; PARAMETERS] {
    let (dt, a, b) = (block.t - last.t, &last.course, &block.course);
    let gained = b.velocity_m_s - a.velocity_m_s;
    let moved = b.position_m - a.position_m - a.velocity_m_s * dt;
    let bent = gained - a.acceleration_m_s2 * dt;
    [[dt * dt / 2.0, dt], [moved, gained], [-bent, a.acceleration_m_s2 - b.acceleration_m_s2]]
}
