//! A body in flight over a turning plate: in the world frame it is in free fall, which
//! checks gravity, Coriolis, centrifugal and Euler terms together.

use nalgebra::{Matrix3, Rotation3, Vector3};
use offbd_core::maths::{DOPRI5, System};
use offbd_core::plant::{Ball, Body, Contact, Ground, Motion, Plate, PlateMotion, Tilt};
use offbd_lab::models::Compliant;
use offbd_lab::scene::{Drive, Law, Laws, Term};

const MASS: f64 = 0.051;
const G: f64 = 9.81;

/// Large and fast swings of both angles: up to 0.9 rad and 14 rad/s.
fn wild() -> Laws {
    let sine = |amplitude, frequency, phase| {
        Law::new(&[Term::Sine { amplitude, frequency, phase }, Term::Constant(0.1)])
    };
    Laws::new(sine(0.6, 2.3, 0.4), sine(0.8, 2.9, 1.1), Vec::new())
}

/// Returns R = Rx(qx)·Ry(qy), and Ω, computed from the angles.
fn frame(laws: &Laws, t: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let Tilt { angle, rate, .. } = laws.tilt(t);
    let about_x = Rotation3::from_axis_angle(&Vector3::x_axis(), angle.x);
    let about_y = Rotation3::from_axis_angle(&Vector3::y_axis(), angle.y);
    // The first joint turns about the world's x, the second about the turned y.
    let omega = about_y.inverse() * Vector3::x() * rate.x + Vector3::y() * rate.y;
    ((about_x * about_y).into_inner(), omega)
}

/// Returns position, velocity and angular velocity in the world frame.
fn world(laws: &Laws, t: f64, at: &Motion) -> [Vector3<f64>; 3] {
    let (r, omega) = frame(laws, t);
    let velocity = at.velocity + omega.cross(&at.position);
    [r * at.position, r * velocity, r * (at.spin + omega)]
}

struct Flight {
    laws: Laws,
    model: Compliant,
    gravity: f64,
}

impl Flight {
    fn new(gravity: f64) -> Self {
        let body = Body::ball(&Ball::default(), &Plate::default());
        let model = Compliant::new(body, Contact::CHAPTER, Ground::Plate(Plate::default()));
        Self { laws: wild(), model, gravity }
    }

    fn plate(&self, t: f64) -> PlateMotion {
        let mut plate = self.laws.tilt(t).motion();
        plate.gravity *= self.gravity;
        plate
    }

    /// Returns the largest value of `off` over half a second.
    fn worst(&self, start: &Motion, mut off: impl FnMut(f64, [Vector3<f64>; 3]) -> f64) -> f64 {
        let (h, mut y, mut worst) = (1e-4, start.to_row(), 0.0_f64);
        for i in 1..=5000 {
            y = DOPRI5.step(self, f64::from(i - 1) * h, &y, h);
            let t = f64::from(i) * h;
            worst = worst.max(off(t, world(&self.laws, t, &Motion::from_row(&y))));
        }
        worst
    }
}

impl System<9> for Flight {
    const POSITIONS: usize = 3;

    fn rate(&self, t: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(y, &self.plate(t))
    }
}

/// A throw that stays above the plate.
fn thrown() -> Motion {
    Motion {
        position: Vector3::new(0.05, -0.03, 1.5),
        velocity: Vector3::new(0.4, -0.7, 3.0),
        spin: Vector3::new(20.0, -35.0, 11.0),
    }
}

/// Tolerance in m, m/s and J: the errors of rounding and of a fifth-order method at
/// h·Ω = 1e-3 are smaller.
const NEGLIGIBLE: f64 = 1e-11;

#[test]
fn validate_a_free_body_goes_straight_in_the_world() {
    let flight = Flight::new(0.0);
    let [p0, v0, w0] = world(&flight.laws, 0.0, &thrown());
    let worst = flight.worst(&thrown(), |t, [p, v, w]| {
        let line = (p - (p0 + v0 * t)).norm();
        line.max((v - v0).norm()).max((w - w0).norm() / w0.norm())
    });
    assert!(worst < NEGLIGIBLE, "{worst:e}");
}

#[test]
fn validate_a_thrown_body_follows_the_parabola() {
    let flight = Flight::new(1.0);
    let [p0, v0, _] = world(&flight.laws, 0.0, &thrown());
    let down = Vector3::new(0.0, 0.0, -G);
    let worst = flight.worst(&thrown(), |t, [p, v, _]| {
        let parabola = p0 + v0 * t + down * (t * t / 2.0);
        (p - parabola).norm().max((v - (v0 + down * t)).norm())
    });
    assert!(worst < NEGLIGIBLE, "{worst:e}");
}

#[test]
fn validate_energy_and_momentum_in_flight() {
    let flight = Flight::new(1.0);
    let energy = |[p, v, _]: [Vector3<f64>; 3]| MASS * (v.norm_squared() / 2.0 + G * p.z);
    let start = world(&flight.laws, 0.0, &thrown());
    let worst = flight.worst(&thrown(), |_, at| {
        let sideways = MASS * (at[1].xy() - start[1].xy()).norm();
        (energy(at) - energy(start)).abs().max(sideways)
    });
    assert!(worst < NEGLIGIBLE, "{worst:e}");
}
