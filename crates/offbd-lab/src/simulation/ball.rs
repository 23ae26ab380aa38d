//! The ball on the plate: rolling, resistance at rest and in motion, the rim
//! or the open edge, and a ball that sticks.

use nalgebra::Vector2;

use super::fault::BallFault;
use offbd_core::plant::{Ball, Plate, PlateShape, Rolling, RollingState, Tilt};
use offbd_core::vocabulary::{Axis, Invalid, in_range};

/// What the plate's surface does to the ball; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Tilt below which a ball at rest stays at rest, rad.
    pub breakaway_rad: f64,
    /// Tilt at which a moving ball keeps its speed, rad.
    pub rolling_rad: f64,
    /// Speed after over speed before an impact on the rim, 0 to 1.
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

/// Slower than this, m/s, and not driven, a ball is at rest.
const REST_M_S: f64 = 1e-3;

/// The ball's motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BallState {
    pub rolling: RollingState,
    /// It has fallen off the plate.
    pub lost: bool,
}

/// Ball, plate and surface; immutable.
#[derive(Clone, Debug)]
pub(super) struct Table {
    rolling: Rolling,
    ball: Ball,
    plate: Plate,
    surface: Surface,
}

impl Table {
    pub(super) fn new(ball: Ball, plate: Plate, surface: Surface) -> Self {
        Self { rolling: Rolling::new(&ball, &plate), ball, plate, surface }
    }

    /// Largest distance of the ball's centre from the plate's along each axis, m.
    pub(super) fn reach(&self) -> Vector2<f64> {
        let kept = if self.plate.rim() { self.ball.radius_m() } else { 0.0 };
        let along = |axis| (self.plate.half_extent_m(axis) - kept).max(0.0);
        Vector2::new(along(Axis::X), along(Axis::Y))
    }

    /// One step of `h` seconds: `tilt` at its start, middle and end, `push` an
    /// acceleration of the free ball, m/s².
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

    /// The spin about the normal is braked as rolling is: by a couple of the
    /// weight times the reach of the contact, which is rolling_rad·r. Without it
    /// a ball that circles would spin faster without end.
    fn spun_down(&self, state: RollingState, fault: Option<BallFault>, h: f64) -> RollingState {
        let kappa = self.ball.inertia_factor();
        let couple = self.resistance(self.surface.rolling_rad, fault) * (1.0 + kappa);
        let braked = couple / (kappa * self.ball.radius_m()) * h;
        RollingState { spin: state.spin.signum() * (state.spin.abs() - braked).max(0.0), ..state }
    }

    /// The resistance as an acceleration of a rolling ball, m/s².
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

    /// The resistance to a moving ball as a push of the free ball, m/s².
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

/// Resistance stops a ball; it does not turn it round.
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

    fn table(rim: bool) -> Table {
        let plate = Plate::new(Plate::default().shape(), 0.02, rim).unwrap();
        Table::new(Ball::default(), plate, SURFACE)
    }

    fn run(
        table: &Table,
        from: BallState,
        qy: f64,
        fault: Option<BallFault>,
        ms: u32,
    ) -> BallState {
        let tilt = Tilt::constant(0.0, qy);
        (0..ms).fold(from, |s, _| table.advance(&s, [&tilt; 3], Vector2::zeros(), fault, 1e-3))
    }

    #[test]
    fn a_ball_at_rest_starts_above_its_breakaway_tilt_only() {
        let rest = BallState::default();
        assert_eq!(run(&table(true), rest, 0.0099, None, 500), rest);
        let rolled = run(&table(true), rest, 0.02, None, 500).rolling.position.x;
        let expected = 9.81 / 1.4 * (0.02_f64.sin() - 0.002_f64.sin()) / 8.0;
        assert!((rolled / expected - 1.0).abs() < 5e-3, "{rolled} m is not {expected} m");
    }

    /// Couple m·g·rolling_rad·r on an inertia κ·m·r².
    #[test]
    fn validate_that_a_ball_that_spins_on_the_spot_is_braked() {
        let spinning = RollingState { spin: -20.0, ..RollingState::default() };
        let from = BallState { rolling: spinning, lost: false };
        let rate = 9.81 * 0.002_f64.sin() / (0.4 * Ball::default().radius_m());
        for seconds in [2, 8] {
            let spin = run(&table(true), from, 0.0, None, 1000 * seconds).rolling.spin;
            let wanted = -(20.0 - rate * f64::from(seconds)).max(0.0);
            assert!((spin - wanted).abs() < 1e-9, "{spin} is not {wanted}");
        }
    }

    #[test]
    fn a_sticky_ball_needs_more_and_a_glued_one_stops_at_once() {
        let rest = BallState::default();
        assert_eq!(run(&table(true), rest, 0.09, Some(BallFault::Sticky(0.1)), 500), rest);
        let moving = run(&table(true), rest, 0.05, None, 300);
        let glued = run(&table(true), moving, 0.05, Some(BallFault::Glued), 100);
        assert_eq!(glued.rolling.position, moving.rolling.position);
    }

    #[test]
    fn a_rim_keeps_the_ball_and_an_open_edge_loses_it() {
        let kept = run(&table(true), BallState::default(), 0.1, None, 3000);
        assert!(!kept.lost && kept.rolling.position.x <= 0.19 - 0.0127);
        assert!(run(&table(false), BallState::default(), 0.1, None, 3000).lost);
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
