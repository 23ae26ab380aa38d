//! The ball on the plate: rolling, stiction and rolling resistance, the rim or the open
//! edge, and the faults of a ball.

use nalgebra::Vector2;

use super::fault::BallFault;
use offbd_core::plant::{Ball, Plate, PlateShape, Rolling, RollingState, Tilt};
use offbd_core::vocabulary::{Axis, Invalid, in_range};

/// The properties of the plate's surface and rim; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Stiction: tilt below which a ball at rest stays at rest, rad.
    pub breakaway_rad: f64,
    /// Rolling resistance: tilt at which a moving ball keeps its speed, rad.
    pub rolling_rad: f64,
    /// Coefficient of restitution of the rim, 0 to 1.
    pub restitution: f64,
}

impl Surface {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        in_range("/surface/breakaway_rad", self.breakaway_rad, 0.0..=0.5)?;
        in_range("/surface/rolling_rad", self.rolling_rad, 0.0..=self.breakaway_rad)?;
        in_range("/surface/restitution", self.restitution, 0.0..=1.0)?;
        Ok(())
    }
}

/// Speed below which a ball that is not driven counts as at rest, m/s; chosen.
const REST_M_S: f64 = 1e-3;

/// The state of the ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BallState {
    pub rolling: RollingState,
    /// Whether the ball has fallen off the plate.
    pub lost: bool,
}

/// Ball, plate and surface; immutable.
#[derive(Clone, Debug)]
pub(super) struct BallOnPlate {
    rolling: Rolling,
    ball: Ball,
    plate: Plate,
    surface: Surface,
}

impl BallOnPlate {
    pub(super) fn new(ball: Ball, plate: Plate, surface: Surface) -> Self {
        Self { rolling: Rolling::new(&ball, &plate), ball, plate, surface }
    }

    /// Returns the largest distance of the ball's centre from the plate's along each
    /// axis, m.
    pub(super) fn reach(&self) -> Vector2<f64> {
        let kept = if self.plate.rim() { self.ball.radius_m() } else { 0.0 };
        let along = |axis| (self.plate.half_extent_m(axis) - kept).max(0.0);
        Vector2::new(along(Axis::X), along(Axis::Y))
    }

    /// Returns the state after a step of `h` seconds, with the `tilt` at its start, middle
    /// and end, and `push` an acceleration of the free ball, m/s².
    pub(super) fn advance(
        &self,
        state: &BallState,
        tilt: [&Tilt; 3],
        push: Vector2<f64>,
        fault: Option<BallFault>,
        h: f64,
    ) -> BallState {
        let before = &state.rolling;
        if state.lost {
            return *state;
        }
        if fault == Some(BallFault::Glued) || self.rests(before, tilt[0], push, fault) {
            return BallState { rolling: self.spun_down(at_rest(before), fault, h), lost: false };
        }
        let drag = self.drag(before, fault);
        let plate = tilt.map(|tilt| tilt.motion().pushed(push + drag));
        let after = self.rolling.rk4(before, plate.each_ref(), h);
        let after = self.spun_down(stopped_by(before, after, drag), fault, h);
        self.at_the_edge(after)
    }

    /// Slows the spin about the normal as rolling resistance slows rolling: by the torque
    /// weight × rolling_rad·r, the lever of the contact force. Otherwise the spin of a ball that
    /// circles would grow without bound.
    fn spun_down(&self, state: RollingState, fault: Option<BallFault>, h: f64) -> RollingState {
        let kappa = self.ball.inertia_factor();
        let couple = self.resistance(self.surface.rolling_rad, fault) * (1.0 + kappa);
        let braked = couple / (kappa * self.ball.radius_m()) * h;
        RollingState { spin: state.spin.signum() * (state.spin.abs() - braked).max(0.0), ..state }
    }

    /// Returns the resistance as an acceleration of the rolling ball, m/s².
    fn resistance(&self, healthy_rad: f64, fault: Option<BallFault>) -> f64 {
        let sticky = if let Some(BallFault::Sticky(tilt)) = fault { tilt } else { 0.0 };
        self.ball.rolling_gravity() * healthy_rad.max(sticky).sin()
    }

    fn rests(
        &self,
        state: &RollingState,
        tilt: &Tilt,
        push: Vector2<f64>,
        fault: Option<BallFault>,
    ) -> bool {
        let hold = self.resistance(self.surface.breakaway_rad, fault);
        let (drive, _) = self.rolling.acceleration(&at_rest(state), &tilt.motion().pushed(push));
        hold > 0.0 && state.velocity.norm() < REST_M_S && drive.norm() <= hold
    }

    /// Returns the resistance to a moving ball as an acceleration of the free ball, m/s².
    fn drag(&self, state: &RollingState, fault: Option<BallFault>) -> Vector2<f64> {
        let speed = state.velocity.norm();
        if speed == 0.0 {
            return Vector2::zeros();
        }
        let inertia = 1.0 + self.ball.inertia_factor();
        let resistance = self.resistance(self.surface.rolling_rad, fault);
        state.velocity * (-resistance * inertia / speed)
    }

    fn at_the_edge(&self, mut state: RollingState) -> BallState {
        if !self.plate.rim() {
            let beyond = self.plate.edge_distance_m(state.position.x, state.position.y) < 0.0;
            return BallState { rolling: state, lost: beyond };
        }
        let (reach, e) = (self.reach(), self.surface.restitution);
        if let PlateShape::Round { .. } = self.plate.shape() {
            bounce_off_ring(&mut state, reach.x, e);
        } else {
            for i in 0..2 {
                bounce_off_wall(&mut state.position[i], &mut state.velocity[i], reach[i], e);
            }
        }
        BallState { rolling: state, lost: false }
    }
}

fn at_rest(state: &RollingState) -> RollingState {
    RollingState { velocity: Vector2::zeros(), ..*state }
}

/// Returns `after`, but at rest if resistance would have reversed the velocity.
fn stopped_by(before: &RollingState, after: RollingState, drag: Vector2<f64>) -> RollingState {
    let turned = after.velocity.dot(&before.velocity) < 0.0;
    if turned && drag != Vector2::zeros() { at_rest(&after) } else { after }
}

fn bounce_off_wall(position: &mut f64, velocity: &mut f64, reach: f64, restitution: f64) {
    if position.abs() > reach {
        *position = reach.copysign(*position);
        if *velocity * *position > 0.0 {
            *velocity *= -restitution;
        }
    }
}

fn bounce_off_ring(state: &mut RollingState, reach: f64, restitution: f64) {
    let distance = state.position.norm();
    if distance > reach {
        let outward = state.position / distance;
        state.position = outward * reach;
        let speed = state.velocity.dot(&outward).max(0.0);
        state.velocity -= outward * (speed * (1.0 + restitution));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SURFACE: Surface = Surface { breakaway_rad: 0.01, rolling_rad: 0.002, restitution: 0.5 };

    fn ball_on_plate(rim: bool) -> BallOnPlate {
        let plate = Plate::new(Plate::default().shape(), 0.02, rim).unwrap();
        BallOnPlate::new(Ball::default(), plate, SURFACE)
    }

    fn run(
        ball_on_plate: &BallOnPlate,
        from: BallState,
        qy: f64,
        fault: Option<BallFault>,
        ms: u32,
    ) -> BallState {
        let tilt = Tilt::constant(0.0, qy);
        (0..ms)
            .fold(from, |s, _| ball_on_plate.advance(&s, [&tilt; 3], Vector2::zeros(), fault, 1e-3))
    }

    #[test]
    fn a_ball_at_rest_starts_above_its_breakaway_tilt_only() {
        let rest = BallState::default();
        assert_eq!(run(&ball_on_plate(true), rest, 0.0099, None, 500), rest);
        let rolled = run(&ball_on_plate(true), rest, 0.02, None, 500).rolling.position.x;
        let expected = 9.81 / 1.4 * (0.02_f64.sin() - 0.002_f64.sin()) / 8.0;
        assert!((rolled / expected - 1.0).abs() < 5e-3, "{rolled} m is not {expected} m");
    }

    /// A couple m·g·rolling_rad·r acts on the inertia κ·m·r².
    #[test]
    fn validate_that_a_ball_that_spins_on_the_spot_is_braked() {
        let spinning = RollingState { spin: -20.0, ..RollingState::default() };
        let from = BallState { rolling: spinning, lost: false };
        let rate = 9.81 * 0.002_f64.sin() / (0.4 * Ball::default().radius_m());
        for seconds in [2, 8] {
            let spin = run(&ball_on_plate(true), from, 0.0, None, 1000 * seconds).rolling.spin;
            let wanted = -(20.0 - rate * f64::from(seconds)).max(0.0);
            assert!((spin - wanted).abs() < 1e-9, "{spin} is not {wanted}");
        }
    }

    #[test]
    fn a_sticky_ball_needs_more_and_a_glued_one_stops_at_once() {
        let rest = BallState::default();
        assert_eq!(run(&ball_on_plate(true), rest, 0.09, Some(BallFault::Sticky(0.1)), 500), rest);
        let moving = run(&ball_on_plate(true), rest, 0.05, None, 300);
        let glued = run(&ball_on_plate(true), moving, 0.05, Some(BallFault::Glued), 100);
        assert_eq!(glued.rolling.position, moving.rolling.position);
    }

    #[test]
    fn a_rim_keeps_the_ball_and_an_open_edge_loses_it() {
        let kept = run(&ball_on_plate(true), BallState::default(), 0.1, None, 3000);
        assert!(!kept.lost && kept.rolling.position.x <= 0.19 - 0.0127);
        assert!(run(&ball_on_plate(false), BallState::default(), 0.1, None, 3000).lost);
    }

    #[test]
    fn validate_rebound_speed_against_the_restitution() {
        let (mut position, mut velocity) = (0.2, 0.3);
        bounce_off_wall(&mut position, &mut velocity, 0.19, 0.5);
        assert_eq!((position, velocity), (0.19, -0.15));
        let mut state = RollingState {
            position: Vector2::new(0.0, -0.2),
            velocity: Vector2::new(0.1, -0.3),
            spin: 0.0,
        };
        bounce_off_ring(&mut state, 0.15, 0.5);
        assert!((state.velocity - Vector2::new(0.1, 0.15)).norm() < 1e-15);
    }
}
