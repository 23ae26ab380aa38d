//! Model selection for the lockstep twin: each step uses the cheapest model that is
//! accurate enough for the current motion.
//!
//! | model | used while |
//! | --- | --- |
//! | planar | the terms that it neglects stay below the wanted accuracy |
//! | rolling | friction and the plate's normal force can hold the ball without slip |
//! | sliding | they cannot: the ball slips or leaves the plate |
//!
//! Both criteria use only the angles and rates of the plate, not its acceleration: in a
//! servo modelled as a first-order lag the rate jumps with each command, which no real
//! servo's does, and the resulting acceleration would throw the ball off.
//!
//! A more accurate model is selected at once, a cheaper one after the motion has been
//! calm for `CALM_S`. The compliant model is not offered: it changes the acceleration of
//! a rolling ball by sag times α, 1e-6 m/s² with the chapter's contact.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::fmt;
use serde::{Deserialize, Serialize};

use nalgebra::{Vector2, Vector3};

use super::contact::{Body, Ground, Motion};
use super::planar::Planar;
use super::rolling::{Rolling, RollingState};
use super::sliding::{Phase, Sliding};
use super::tilt::{PlateMotion, Tilt};
use super::{Ball, Plate};

/// Duration of calm motion before a cheaper model is selected, s. Chosen: longer than the
/// turning points of a swinging plate, where its rates are small for a moment.
const CALM_S: f64 = 0.5;

/// Fraction of a limit below which the motion counts as calm. Chosen as hysteresis.
const CALM_SHARE: f64 = 0.5;

/// Fraction of the friction limit μ·F_z up to which the rolling model is used. Chosen: a
/// margin of 10 % before the ball slips.
const MAX_ROLLING_DEMAND: f64 = 0.9;

/// The models of one ball on one plate, and the wanted accuracy; immutable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ladder {
    planar: Planar,
    rolling: Rolling,
    sliding: Sliding,
    friction: f64,
    accuracy_m_s2: f64,
    radius: f64,
    height: f64,
}

/// A model of the lockstep twin, the cheapest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Rung {
    Planar,
    #[default]
    Rolling,
    Sliding,
}

impl Rung {
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Planar => "planar",
            Self::Rolling => "rolling",
            Self::Sliding => "sliding",
        }
    }
}

/// The model in use and the quantities that selected it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fidelity {
    pub rung: Rung,
    /// Bound of the acceleration that the planar model neglects, m/s².
    pub left_out_m_s2: f64,
    /// Acceleration that may be neglected, m/s².
    pub accuracy_m_s2: f64,
    /// Fraction of the friction limit μ·F_z in use, by angles and rates; infinite where
    /// the plate would have to pull.
    pub demand: f64,
    calm_s: f64,
    /// Unmeasured part of the motion (height, vertical speed, spin) while the ball does
    /// not roll.
    unseen: Option<Motion>,
}

impl fmt::Display for Fidelity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (left_out, accuracy) = (self.left_out_m_s2, self.accuracy_m_s2);
        match self.rung {
            Rung::Planar => {
                write!(
                    f,
                    "the small-angle model is off by at most {left_out:.4} m/s²; {accuracy:.4} \
                     allowed"
                )
            }
            Rung::Rolling if left_out <= accuracy => {
                write!(
                    f,
                    "the small-angle model will do once the motion has been calm for {CALM_S} s"
                )
            }
            Rung::Rolling => write!(
                f,
                "the small-angle model would be off by up to {left_out:.4} m/s²; {accuracy:.4} \
                 allowed"
            ),
            Rung::Sliding if self.demand.is_infinite() => {
                write!(f, "the ball would lift off, or would have done so a moment ago")
            }
            Rung::Sliding => write!(
                f,
                "rolling needs {:.0} % of the available friction, or needed it a moment ago",
                100.0 * self.demand
            ),
        }
    }
}

impl Ladder {
    /// Builds the models of `ball` on `plate` with friction μ in (0, 100]. The cheapest
    /// model is selected that neglects at most `accuracy_m_s2` of the acceleration, m/s².
    #[must_use]
    pub fn new(ball: &Ball, plate: &Plate, friction: f64, accuracy_m_s2: f64) -> Self {
        let body = Body::ball(ball, plate);
        Self {
            planar: Planar::new(ball, plate),
            rolling: Rolling::new(ball, plate),
            sliding: Sliding::new(body, friction, Ground::Endless),
            friction,
            accuracy_m_s2,
            radius: ball.radius_m(),
            height: body.rest_height_m(),
        }
    }

    /// The planar model, the cheapest.
    #[must_use]
    pub const fn planar(&self) -> &Planar {
        &self.planar
    }

    /// The rolling model.
    #[must_use]
    pub const fn rolling(&self) -> &Rolling {
        &self.rolling
    }

    /// Returns the acceleration of the ball along x and y, m/s², for the `observed`
    /// motion over a step of `h` seconds with the plate moving as `tilt`.
    pub fn acceleration(
        &self,
        fidelity: &mut Fidelity,
        observed: &RollingState,
        tilt: &Tilt,
        h: f64,
    ) -> Vector2<f64> {
        fidelity.accuracy_m_s2 = self.accuracy_m_s2;
        let evenly = Tilt { acceleration: Vector2::zeros(), ..*tilt };
        fidelity.left_out_m_s2 = self.planar.left_out(observed, &evenly);
        fidelity.demand = self.planar.friction_part(&tilt.angle) / self.friction;
        let small = fidelity.left_out_m_s2 <= self.accuracy_m_s2;
        let grips = fidelity.demand <= CALM_SHARE;
        if small && grips && fidelity.rung == Rung::Planar {
            return self.planar.acceleration(tilt);
        }
        let plate = tilt.motion();
        let steady = PlateMotion { alpha: Vector3::zeros(), ..plate };
        if !grips {
            fidelity.demand = self.rolling.grip(&observed.to_row(), &steady).demand(self.friction);
        }
        match self.choose(fidelity, h) {
            Rung::Sliding => self.slide(fidelity, observed, &steady, h),
            _ => self.rolling.acceleration(observed, &plate).0,
        }
    }

    /// Selects the model: a more accurate one at once, a cheaper one after calm motion.
    fn choose(&self, fidelity: &mut Fidelity, h: f64) -> Rung {
        let rolls = fidelity.unseen.is_none_or(|at| self.grips(&at));
        let needed = if fidelity.demand > MAX_ROLLING_DEMAND || !rolls {
            Rung::Sliding
        } else if fidelity.left_out_m_s2 > self.accuracy_m_s2 * CALM_SHARE {
            Rung::Rolling
        } else {
            Rung::Planar
        };
        // A ball that stops slipping rolls at once: the slip that the observed velocity
        // still shows is noise, and so would be the friction computed from it.
        if needed >= fidelity.rung || fidelity.rung == Rung::Sliding {
            (fidelity.rung, fidelity.calm_s) = (needed, 0.0);
        } else {
            fidelity.calm_s += h;
            if fidelity.calm_s >= CALM_S {
                (fidelity.rung, fidelity.calm_s) = (needed, 0.0);
            }
        }
        if fidelity.rung != Rung::Sliding {
            fidelity.unseen = None;
        }
        fidelity.rung
    }

    /// Whether a ball on the sliding model has returned to rolling.
    fn grips(&self, at: &Motion) -> bool {
        let [x, y] = self.sliding.body.slip(&at.velocity, &at.spin);
        at.position.z <= self.height && x.hypot(y) <= ROLLING_SLIP_M_S
    }

    /// One step of the sliding model; the unmeasured states by explicit Euler.
    fn slide(
        &self,
        fidelity: &mut Fidelity,
        observed: &RollingState,
        plate: &PlateMotion,
        h: f64,
    ) -> Vector2<f64> {
        let (p, v) = (&observed.position, &observed.velocity);
        let before = fidelity.unseen.unwrap_or(Motion {
            position: Vector3::new(p.x, p.y, self.height),
            velocity: Vector3::zeros(),
            spin: Vector3::new(-v.y / self.radius, v.x / self.radius, observed.spin),
        });
        let at = Motion {
            position: Vector3::new(p.x, p.y, before.position.z),
            velocity: Vector3::new(v.x, v.y, before.velocity.z),
            spin: before.spin,
        };
        let (phase, landed) = self.sliding.enter(&at, plate);
        let rate = self.sliding.rate(&phase, &landed.to_row(), plate);
        let mut after = landed;
        if phase == Phase::Flight {
            after.velocity.z += rate[5] * h;
            after.position.z += after.velocity.z * h;
        }
        after.spin = self.turned(&landed, &rate, h);
        fidelity.unseen = Some(after);
        let impulse = (landed.velocity - at.velocity).xy() / h;
        Vector2::new(rate[3], rate[4]) + impulse
    }

    /// The spin after a step; friction stops at zero slip.
    fn turned(&self, at: &Motion, rate: &[f64; 9], h: f64) -> Vector3<f64> {
        let spin = at.spin + Vector3::new(rate[6], rate[7], rate[8]) * h;
        let velocity = at.velocity + Vector3::new(rate[3], rate[4], 0.0) * h;
        let before = self.sliding.body.slip(&at.velocity, &at.spin);
        let after = self.sliding.body.slip(&velocity, &spin);
        let mut to = spin;
        // Set to the spin of a ball rolling at the observed velocity: a ball that does
        // not follow the predicted impulse would otherwise seem to slip in every later
        // step.
        if before[0] * after[0] < 0.0 {
            to.y = at.velocity.x / self.radius;
        }
        if before[1] * after[1] < 0.0 {
            to.x = -at.velocity.y / self.radius;
        }
        to
    }
}

/// Slip below which a ball counts as rolling again, m/s: the error of the velocity
/// filtered over 0.5 s from a camera with 1 mm of noise.
const ROLLING_SLIP_M_S: f64 = 0.02;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::GRAVITY_M_S2;
    use proptest::prelude::*;

    const H: f64 = 0.01;
    const ACCURACY: f64 = 0.0075;

    fn ladder(friction: f64) -> (Ladder, Rolling) {
        let (ball, plate) = (Ball::default(), Plate::default());
        (Ladder::new(&ball, &plate, friction, ACCURACY), Rolling::new(&ball, &plate))
    }

    /// Returns the last acceleration along x after a second under `tilt`.
    fn settle(ladder: &Ladder, fidelity: &mut Fidelity, tilt: &Tilt) -> f64 {
        let still = RollingState::default();
        (0..100).fold(0.0, |_, _| ladder.acceleration(fidelity, &still, tilt, H).x)
    }

    #[test]
    fn it_climbs_at_once_and_comes_down_when_calm() {
        let (ladder, _) = ladder(0.6);
        let mut fidelity = Fidelity::default();
        settle(&ladder, &mut fidelity, &Tilt::constant(0.0, 0.02));
        assert_eq!(fidelity.rung, Rung::Planar);
        let tilt = Tilt::constant(0.0, 0.2);
        ladder.acceleration(&mut fidelity, &RollingState::default(), &tilt, H);
        assert_eq!(fidelity.rung, Rung::Rolling);
        assert!(fidelity.to_string().contains("the small-angle model would be off by up to 0."));
        ladder.acceleration(&mut fidelity, &RollingState::default(), &Tilt::default(), H);
        assert_eq!(fidelity.rung, Rung::Rolling, "one calm step is not enough");
        settle(&ladder, &mut fidelity, &Tilt::default());
        assert_eq!(fidelity.rung, Rung::Planar);
    }

    /// Moves a free ball through `steps` and returns its last acceleration along x.
    fn carry(
        ladder: &Ladder,
        fidelity: &mut Fidelity,
        ball: &mut RollingState,
        tilt: &Tilt,
        steps: u32,
    ) -> f64 {
        (0..steps).fold(0.0, |_, _| {
            let a = ladder.acceleration(fidelity, ball, tilt, H);
            ball.position += (ball.velocity + a * (H / 2.0)) * H;
            ball.velocity += a * H;
            a.x
        })
    }

    /// Beyond tan q = 3.5 μ the ball slides down with g·(sin q − μ·cos q).
    #[test]
    fn validate_a_steep_plate_against_coulomb() {
        let (ladder, _) = ladder(0.2);
        let (mut fidelity, mut ball, q) = (Fidelity::default(), RollingState::default(), 0.8_f64);
        let a = carry(&ladder, &mut fidelity, &mut ball, &Tilt::constant(0.0, q), 30);
        assert_eq!(fidelity.rung, Rung::Sliding);
        assert!((a - GRAVITY_M_S2 * (q.sin() - 0.2 * q.cos())).abs() < 1e-9, "{a}");
    }

    /// After sliding the ball spins less than a rolling one. On a level plate friction
    /// slows it until it rolls, and the twin returns to the planar model.
    #[test]
    fn it_rolls_again_after_a_slide() {
        let (ladder, _) = ladder(0.2);
        let (mut fidelity, mut ball) = (Fidelity::default(), RollingState::default());
        carry(&ladder, &mut fidelity, &mut ball, &Tilt::constant(0.0, 1.2), 30);
        assert_eq!(fidelity.rung, Rung::Sliding);
        let a = carry(&ladder, &mut fidelity, &mut ball, &Tilt::default(), 10);
        assert!((a + 0.2 * GRAVITY_M_S2).abs() < 1e-9, "friction slows it with μ·g: {a}");
        carry(&ladder, &mut fidelity, &mut ball, &Tilt::default(), 200);
        assert_eq!(fidelity.rung, Rung::Planar);
    }

    /// A ball that slides with friction μ on a level plate after a steep one.
    fn sent_sliding(friction: f64) -> (Ladder, Fidelity, RollingState) {
        let (ladder, _) = ladder(friction);
        let (mut fidelity, mut ball) = (Fidelity::default(), RollingState::default());
        carry(&ladder, &mut fidelity, &mut ball, &Tilt::constant(0.0, 1.3), 30);
        assert_eq!(fidelity.rung, Rung::Sliding);
        (ladder, fidelity, ball)
    }

    fn slip(fidelity: &Fidelity, ball: &RollingState) -> f64 {
        let spin = fidelity.unseen.unwrap().spin;
        ball.velocity.x - spin.y * Ball::default().radius_m()
    }

    /// Slip, and with it the sliding model, ends after s/((1 + 1/κ)·μ·g).
    #[test]
    fn validate_when_sliding_ends() {
        let (ladder, mut fidelity, mut ball) = sent_sliding(0.2);
        let wanted = slip(&fidelity, &ball) / (3.5 * 0.2 * GRAVITY_M_S2);
        let mut steps = 0;
        while fidelity.rung == Rung::Sliding {
            carry(&ladder, &mut fidelity, &mut ball, &Tilt::default(), 1);
            steps += 1;
        }
        // The model of a step is selected at its start.
        let took = f64::from(steps) * H;
        assert!((wanted..wanted + 2.0 * H).contains(&took), "{took} s, not {wanted} s");
    }

    /// The unmeasured state of one slide does not affect the next.
    #[test]
    fn a_slide_is_forgotten() {
        let (ladder, mut fidelity, mut ball) = sent_sliding(0.2);
        carry(&ladder, &mut fidelity, &mut ball, &Tilt::default(), 300);
        let mut fresh = Fidelity::default();
        ball.velocity = -ball.velocity;
        let steep = Tilt::constant(0.0, 1.3);
        let a = carry(&ladder, &mut fidelity, &mut ball.clone(), &steep, 2);
        assert_eq!(a, carry(&ladder, &mut fresh, &mut ball, &steep, 2));
    }

    /// A ball whose measured velocity does not follow the predicted friction, because it
    /// is pushed along, returns to rolling as well.
    #[test]
    fn a_ball_that_is_not_slowed_rolls_again() {
        let (ladder, mut fidelity, ball) = sent_sliding(0.6);
        for _ in 0..200 {
            ladder.acceleration(&mut fidelity, &ball, &Tilt::default(), H);
        }
        assert!(fidelity.rung < Rung::Sliding, "{}", fidelity.rung.name());
    }

    /// A first-order lag of 35 ms that gets a command of 0.2 rad: for a moment its
    /// acceleration would pull the plate away from under the ball.
    #[test]
    fn a_servo_that_starts_with_a_jerk_throws_nothing_off() {
        let (ladder, _) = ladder(0.6);
        let away = RollingState { position: Vector2::new(0.15, 0.1), ..Default::default() };
        let tilt = Tilt {
            angle: Vector2::new(0.1, 0.1),
            rate: Vector2::new(5.7, 5.7),
            acceleration: Vector2::new(-163.0, 163.0),
        };
        let mut fidelity = Fidelity::default();
        ladder.acceleration(&mut fidelity, &away, &tilt, H);
        assert_eq!(fidelity.rung, Rung::Rolling);
    }

    proptest! {
        /// With every model, a ball that can roll is predicted like the rolling model
        /// does, up to the wanted accuracy and a second-order term from the jump of the
        /// lag's rate.
        #[test]
        fn the_wanted_accuracy_holds(
            q in prop::array::uniform2(-0.2..0.2_f64), rate in prop::array::uniform2(-1.0..1.0_f64),
            acceleration in prop::array::uniform2(-10.0..10.0_f64),
            p in prop::array::uniform2(-0.2..0.2_f64), v in prop::array::uniform2(-0.5..0.5_f64),
        ) {
            let (ladder, rolling) = ladder(0.6);
            let tilt = Tilt { angle: q.into(), rate: rate.into(), acceleration: acceleration.into() };
            let state = RollingState { position: p.into(), velocity: v.into(), spin: 0.0 };
            let evenly = Tilt { acceleration: Vector2::zeros(), ..tilt };
            let jump = ladder.planar.left_out(&state, &tilt) - ladder.planar.left_out(&state, &evenly);
            for rung in [Rung::Planar, Rung::Rolling] {
                let mut fidelity = Fidelity { rung, ..Fidelity::default() };
                let a = ladder.acceleration(&mut fidelity, &state, &tilt, H);
                let (truth, _) = rolling.acceleration(&state, &tilt.motion());
                let off = (a - truth).norm();
                prop_assert!(off <= ACCURACY + jump, "{off} off on {:?}", fidelity.rung);
            }
        }
    }
}
