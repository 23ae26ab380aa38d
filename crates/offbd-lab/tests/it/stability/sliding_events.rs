//! The times at which the sliding model slips, leaves the plate and lands, against an
//! independent computation: one axis in the plate frame by small fixed steps, and the
//! flight as a parabola in the world frame.

use super::scenes::{KAPPA, held, s3, sampled, scene};
use offbd_core::plant::{Ball, Body, Contact, Ground, Hold, Motion, Phase, Plate, Sliding, Tilt};
use offbd_lab::scene::{Configuration, Law, Laws, Method, Model, Pace, Term, run};

const G: f64 = 9.81;
const R: f64 = 0.0127;
const GAP: f64 = 0.0227;
const MU: f64 = 0.6;

/// S3's angle about y with its rates.
fn angle(t: f64) -> [f64; 3] {
    let (to, duration) = (1.2, 0.15);
    let s = t / duration;
    if s >= 1.0 {
        return [to, 0.0, 0.0];
    }
    [
        to * s * s * (3.0 - 2.0 * s),
        to * 6.0 * s * (1.0 - s) / duration,
        to * (6.0 - 12.0 * s) / (duration * duration),
    ]
}

/// x, ẋ and the spin about y of a ball on the plate.
type State = [f64; 3];

/// Returns the free acceleration along x and along the normal, at the resting height.
fn free(t: f64, [x, v, _]: State) -> [f64; 2] {
    let [q, rate, acceleration] = angle(t);
    [
        G * q.sin() + rate * rate * x - acceleration * GAP,
        -G * q.cos() + 2.0 * rate * v + rate * rate * GAP + acceleration * x,
    ]
}

/// Returns the friction per mass that keeps the ball rolling.
fn rolling_friction(t: f64, y: State) -> f64 {
    let [along, _] = free(t, y);
    (-R * angle(t)[2] - along) / (1.0 + 1.0 / KAPPA)
}

fn rate(t: f64, y: State, slips: bool) -> State {
    let [along, normal] = free(t, y);
    let slip = -y[1] + R * y[2];
    let rolls = rolling_friction(t, y);
    let sign = if slip.abs() > 1e-9 { slip.signum() } else { rolls.signum() };
    let friction = if slips { sign * MU * -normal } else { rolls };
    [y[1], along + friction, -angle(t)[2] - friction / (KAPPA * R)]
}

fn rk4(t: f64, y: State, h: f64, slips: bool) -> State {
    let at = |k: State, h: f64| -> State { std::array::from_fn(|i| y[i] + h * k[i]) };
    let k1 = rate(t, y, slips);
    let k2 = rate(t + h / 2.0, at(k1, h / 2.0), slips);
    let k3 = rate(t + h / 2.0, at(k2, h / 2.0), slips);
    let k4 = rate(t + h, at(k3, h), slips);
    std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// Integrates until `margin` turns negative, halving the last step down to 1e-14 s.
fn until(
    mut t: f64,
    mut y: State,
    slips: bool,
    margin: impl Fn(f64, State) -> f64,
) -> (f64, State) {
    let mut h = 1e-5;
    while h > 1e-14 {
        let next = rk4(t, y, h, slips);
        if margin(t + h, next) < 0.0 {
            h /= 2.0;
        } else {
            (t, y) = (t + h, next);
        }
    }
    (t, y)
}

/// Returns the (x, z) components in the world frame of a vector in the plate frame.
fn to_world(q: f64, [x, z]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = q.sin_cos();
    [cos * x + sin * z, -sin * x + cos * z]
}

/// Returns the time at which the parabola from (t, x, v) meets the plate again.
fn landing(t0: f64, [x, v, _]: State) -> f64 {
    let [q, rate, _] = angle(t0);
    let p = to_world(q, [x, GAP]);
    let u = to_world(q, [v + rate * GAP, -rate * x]);
    let height = |t: f64| {
        let (s, q) = (t - t0, angle(t)[0]);
        let at = [p[0] + u[0] * s, p[1] + u[1] * s - G * s * s / 2.0];
        q.sin() * at[0] + q.cos() * at[1] - GAP
    };
    let (mut above, mut below) = (t0 + 1e-3, t0 + 1e-3);
    while height(below) > 0.0 {
        above = below;
        below += 1e-4;
    }
    for _ in 0..60 {
        let middle = (above + below) / 2.0;
        if height(middle) > 0.0 { above = middle } else { below = middle }
    }
    below
}

/// Tolerance of the time of an event, s. An event is where two forces are equal, which
/// change by some 1e3 m/s³; the two integrations are accurate to 1e-12 and 1e-10 m.
const SAME_MOMENT_S: f64 = 1e-8;

#[test]
fn validate_the_moments_of_s3() {
    let (slips, y) =
        until(0.0, [0.0; 3], false, |t, y| MU * -free(t, y)[1] - rolling_friction(t, y).abs());
    let (leaves, y) = until(slips, y, true, |t, y| -free(t, y)[1]);
    let lands = landing(leaves, y);
    println!("slips {slips:.9}, leaves {leaves:.9}, lands {lands:.9}");
    for (moment, about) in [(slips, 0.098), (leaves, 0.112), (lands, 0.181)] {
        assert!((moment - about).abs() < 1e-3, "{moment} for about {about}");
    }
    let configuration =
        Configuration::new(Model::Sliding, Method::Dopri5, Pace::Tolerance(1e-11)).unwrap();
    let outcome = run(&scene(Contact::CHAPTER, 0.4), &mut s3(), &configuration, None).unwrap();
    let found: Vec<(&str, f64)> = outcome.events.iter().map(|e| (e.what, e.at_s)).collect();
    println!("{found:?}");
    let expected = [("rolls", 0.0), ("slips", slips), ("flies", leaves), ("slips", lands)];
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.0, expected.0);
        assert!((found.1 - expected.1).abs() < SAME_MOMENT_S, "{found:?} for {expected:?}");
    }
    assert!(found.len() >= expected.len());
}

/// Returns the largest constant angle at which `rolls` is true, by bisection.
fn steepest(rolls: impl Fn(f64) -> bool) -> f64 {
    let (mut holds, mut slips) = (0.1, 1.5);
    while slips - holds > 1e-9 {
        let middle = (holds + slips) / 2.0;
        if rolls(middle) { holds = middle } else { slips = middle }
    }
    holds
}

#[test]
fn validate_the_onset_of_slip_on_a_held_plate() {
    let body = Body::ball(&Ball::default(), &Plate::default());
    let model = Sliding::new(body, MU, Ground::Endless);
    let sticks = Phase::Contact([Hold::Stick; 2]);
    let theory = ((1.0 + 1.0 / KAPPA) * MU).atan();
    let entered = steepest(|q| {
        model.enter(&Motion::at_rest(&body), &Tilt::constant(0.0, q).motion()).0 == sticks
    });
    assert!((entered - theory).abs() < 1e-6, "{entered} for {theory}");
    let configuration =
        Configuration::new(Model::Sliding, Method::Dopri5, Pace::Tolerance(1e-9)).unwrap();
    let scene = scene(Contact::CHAPTER, 0.05);
    let ran = steepest(|q| {
        let outcome = run(&scene, &mut held(0.0, q), &configuration, None).unwrap();
        outcome.events.iter().all(|event| event.what == "rolls")
    });
    assert!((ran - theory).abs() < 1e-6, "{ran} for {theory}");
}

/// A ball that lands on a plate that falls away does not penetrate it: its normal velocity
/// is set to zero, and it flies on.
#[test]
fn a_landing_on_a_plate_that_falls_away_is_one() {
    let wave = Term::Sine { amplitude: 0.05, frequency: 10.0, phase: 0.0 };
    let laws = Laws::new(Law::default(), Law::new(&[wave]), Vec::new());
    let configuration =
        Configuration::new(Model::Sliding, Method::Dopri5, Pace::Tolerance(1e-6)).unwrap();
    let (outcome, path) =
        sampled(&scene(Contact::CHAPTER, 2.0), &laws, &configuration, 1e-3).unwrap();
    assert!(outcome.statistics.steps < 20_000, "{} steps", outcome.statistics.steps);
    let lowest = path.iter().map(|(_, at)| at.position.z).fold(f64::INFINITY, f64::min);
    assert!(lowest > GAP - 1e-6, "{:e} m into the plate", GAP - lowest);
}

/// When slip ends, the ball rolls on at 5/7 of its speed. If the remainder were taken for
/// slip in the other direction, the phase would alternate every 1e-8 s.
#[test]
fn validate_slip_ends_in_rolling() {
    let configuration =
        Configuration::new(Model::Sliding, Method::Dopri5, Pace::Tolerance(1e-6)).unwrap();
    let mut scene = scene(Contact::CHAPTER, 0.5);
    scene.initial.velocity.x = 0.7;
    let outcome = run(&scene, &mut held(0.0, 0.0), &configuration, None).unwrap();
    assert!((outcome.end.velocity.x - 0.5).abs() < 1e-6, "{}", outcome.end.velocity.x);
    let found: Vec<&str> = outcome.events.iter().map(|event| event.what).collect();
    assert_eq!(found, ["slips", "rolls"]);
    assert!(outcome.statistics.steps < 1000, "{} steps", outcome.statistics.steps);
}
