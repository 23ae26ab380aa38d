//! The largest stable step of each explicit method on the compliant model, measured by the
//! growth of a small disturbance, against the prediction of its stability function and the
//! eigenvalues.

use super::scenes::{KAPPA, OnPlate, step};
use nalgebra::Complex;
use offbd_core::plant::{Ball, Body, Contact, Ground, Motion, Plate, Tilt};
use offbd_lab::models::Compliant;
use offbd_lab::scene::Method;
use std::f64::consts::PI;

const EXPLICIT: [Method; 4] =
    [Method::Euler, Method::SemiImplicitEuler, Method::Midpoint, Method::Rk4];

/// Number of steps over which a disturbance may grow. Near the limit |R| = 1 + ε, and
/// transient growth by a factor C hides ε < ln C/STEPS: 0.8 % for C = 20.
const STEPS: usize = 400;

/// Half of the final interval of the bisection as a share of the step.
const WIDTH: f64 = 1e-3;

/// Allowed relative difference of measured and predicted limit.
const WITHIN: f64 = 0.05;

fn model(contact: Contact) -> Compliant {
    let body = Body::ball(&Ball::default(), &Plate::default());
    Compliant::new(body, contact, Ground::Endless)
}

fn on_s1(model: &Compliant) -> OnPlate<'_> {
    OnPlate { model, plate: Tilt::constant(PI / 20.0, PI / 20.0).motion() }
}

/// Returns the equilibrium of the rolling ball: the depth that carries the normal force,
/// and the creep that carries the friction, 2/7 of gravity along the plate.
fn settled(system: &OnPlate<'_>) -> [f64; 9] {
    let (model, pull) = (system.model, system.plate.gravity);
    let mass = model.body.mass_kg();
    let mut at = Motion::at_rest(&model.body);
    at.position.z += mass * pull.z / model.contact.stiffness_n_per_m();
    let per = model.contact.slip_threshold_m_s() / (model.contact.friction() * -pull.z);
    let share = KAPPA / (1.0 + KAPPA);
    at.velocity.x = share * pull.x * per;
    at.velocity.y = share * pull.y * per;
    at.to_row()
}

/// Returns whether a disturbance `kick` of the equilibrium grows, measured by `size` of the
/// difference of two runs.
fn grows(
    system: &OnPlate<'_>,
    method: Method,
    h: f64,
    kick: (usize, f64),
    size: impl Fn(&[f64; 9]) -> f64,
) -> bool {
    let mut calm = settled(system);
    let mut moved = calm;
    moved[kick.0] += kick.1;
    let apart = |a: &[f64; 9], b: &[f64; 9]| size(&std::array::from_fn(|i| a[i] - b[i]));
    let start = apart(&moved, &calm);
    for _ in 0..STEPS {
        calm = step(method, system, 0.0, &calm, h);
        moved = step(method, system, 0.0, &moved, h);
        let now = apart(&moved, &calm);
        if !now.is_finite() || now > 1e3 * start {
            return true;
        }
    }
    apart(&moved, &calm) > start
}

/// Returns the largest step at which `unstable` is false, by bisection.
fn largest_stable(guess: f64, unstable: impl Fn(f64) -> bool) -> f64 {
    let (mut stable, mut too_long) = (guess / 4.0, guess * 4.0);
    assert!(!unstable(stable) && unstable(too_long), "no limit near {guess:e} s");
    while too_long / stable > 1.0 + 2.0 * WIDTH {
        let middle = (stable * too_long).sqrt();
        if unstable(middle) { too_long = middle } else { stable = middle }
    }
    (stable * too_long).sqrt()
}

/// Returns the stability function of a method of as many stages as its order, the sum of zᵏ/k!.
fn stability(method: Method, z: Complex<f64>) -> Complex<f64> {
    let order = match method {
        Method::Euler => 1,
        Method::Midpoint => 2,
        _ => 4,
    };
    let one = Complex::new(1.0, 0.0);
    (1..=order).rev().fold(one, |sum, k| one + z / f64::from(k) * sum)
}

/// Returns the largest stable step for p'' = −k·p − d·v, from the roots of its characteristic
/// polynomial; for the semi-implicit rule from the condition |trace| < 1 + determinant of its
/// step (Jury), which is h²k + 2hd < 4.
fn predicted(method: Method, k: f64, d: f64) -> f64 {
    if method == Method::SemiImplicitEuler {
        return ((d * d + 4.0 * k).sqrt() - d) / k;
    }
    let fast = -(Complex::new(d * d / 4.0 - k, 0.0).sqrt() + d / 2.0);
    let mut h = 1e-3 / (d + k.sqrt());
    while stability(method, fast * h).norm() <= 1.0 + 1e-12 {
        h *= 1.001;
    }
    h
}

#[test]
fn validate_the_slip_limit_against_the_stability_function() {
    let model = model(Contact::CHAPTER);
    let system = on_s1(&model);
    let contact = &model.contact;
    let rate = (1.0 + 1.0 / KAPPA) * contact.friction() * -system.plate.gravity.z
        / contact.slip_threshold_m_s();
    for (method, reach) in EXPLICIT.into_iter().zip([2.0, 2.0, 2.0, 2.785_293_563_405_282]) {
        let theory = reach / rate;
        let kick = (3, 1e-3 * contact.slip_threshold_m_s());
        let slip = |y: &[f64; 9]| {
            let at = Motion::from_row(y);
            model.body.slip(&at.velocity, &at.spin)[0].abs()
        };
        let measured = largest_stable(theory, |h| grows(&system, method, h, kick, slip));
        println!("slip {method}: {:.3} µs, theory {:.3} µs", measured * 1e6, theory * 1e6);
        assert!((measured / theory - 1.0).abs() < WITHIN, "{method}: {measured:e} for {theory:e}");
    }
}

/// Two real roots (chapter and soft), and a complex pair with a weak damper.
#[test]
fn validate_the_normal_limit_against_the_roots() {
    let weak = Contact::new(800_000.0, 50.0, 0.6, 1e-4).unwrap();
    for (name, contact) in [("A", Contact::CHAPTER), ("B", Contact::SOFT), ("weak", weak)] {
        let model = model(contact);
        let system = on_s1(&model);
        let mass = model.body.mass_kg();
        let (k, d) = (contact.stiffness_n_per_m() / mass, contact.damping_n_s_per_m() / mass);
        for method in EXPLICIT {
            let theory = predicted(method, k, d);
            let size = |y: &[f64; 9]| (y[2] * k.sqrt()).hypot(y[5]);
            // A thousandth of the depth at rest, as a speed of the mode.
            let kick = (5, 1e-3 * 9.81 / k.sqrt());
            let measured = largest_stable(theory, |h| grows(&system, method, h, kick, size));
            println!("{name} {method}: {:.2} µs, theory {:.2} µs", measured * 1e6, theory * 1e6);
            let off = measured / theory - 1.0;
            assert!(off.abs() < WITHIN, "{name} {method}: {measured:e} s for {theory:e} s");
        }
    }
}

/// The predicted limits of the chapter's contact, the soft contact and a weak damper, µs.
#[test]
fn validate_the_predictions_themselves() {
    let mass = Ball::default().mass_kg();
    let a = predicted(Method::Euler, 800_000.0 / mass, 1000.0 / mass);
    assert!((a * 1e6 - 106.5).abs() < 0.3, "{a:e}");
    let b = predicted(Method::Rk4, 1000.0 / mass, 100.0 / mass);
    assert!((b * 1e6 - 1428.0).abs() < 3.0, "{b:e}");
    // Explicit Euler on a complex pair: h = D/K.
    let weak = predicted(Method::Euler, 800_000.0 / mass, 50.0 / mass);
    assert!((weak * 1e6 - 62.5).abs() < 0.1, "{weak:e}");
}
