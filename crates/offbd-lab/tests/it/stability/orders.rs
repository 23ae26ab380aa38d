//! Observed orders of convergence: slopes fitted over five halvings of the step.

use super::scenes::{apart, compliant, s2, s3, sampled, scene, step, tight};
use offbd_core::maths::System;
use offbd_core::plant::Contact;
use offbd_lab::methods::Stiff;
use offbd_lab::scene::{Configuration, Laws, Method, Model, Pace, Scene};

const HALVINGS: usize = 5;

/// Returns the least-squares slope of log error over log step.
fn slope(errors: &[f64]) -> f64 {
    let n = errors.len() as f64;
    let points: Vec<(f64, f64)> =
        errors.iter().enumerate().map(|(i, e)| (-(i as f64), e.log2())).collect();
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let over: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    over / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

/// Returns the errors at the step `first` and its halvings.
fn halved(first: f64, error: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=HALVINGS).map(|i| error(first / 2_f64.powi(i as i32))).collect()
}

fn check(name: &str, errors: &[f64], order: f64, band: f64) {
    let found = slope(errors);
    println!("{name}: order {found:.3}, errors {:.2e} to {:.2e}", errors[0], errors[HALVINGS]);
    assert!((found - order).abs() <= band, "{name}: order {found}, not {order}: {errors:?}");
}

/// ẍ = −x³ + f(t), driven such that x = sin(ωt): nonlinear and not autonomous.
struct Driven;

const OMEGA: f64 = 1.3;

impl System<2> for Driven {
    const POSITIONS: usize = 1;

    fn rate(&self, t: f64, y: &[f64; 2]) -> [f64; 2] {
        let sin = (OMEGA * t).sin();
        [y[1], sin.powi(3) - y[0].powi(3) - OMEGA * OMEGA * sin]
    }
}

impl Stiff<2> for Driven {
    fn jacobian(&self, _: f64, y: &[f64; 2]) -> [[f64; 2]; 2] {
        [[0.0, 1.0], [-3.0 * y[0] * y[0], 0.0]]
    }
}

/// Returns the error of position and velocity after 4 s.
fn driven_error(method: Method, h: f64) -> f64 {
    let end = 4.0;
    let n = (end / h).round() as usize;
    let mut y = [0.0, OMEGA];
    for i in 0..n {
        y = step(method, &Driven, i as f64 * h, &y, h);
    }
    let (sin, cos) = (OMEGA * end).sin_cos();
    (y[0] - sin).hypot(y[1] - OMEGA * cos)
}

#[test]
fn validate_orders_on_a_driven_oscillator() {
    for (method, order, first) in [
        (Method::Euler, 1.0, 1.0 / 64.0),
        (Method::SemiImplicitEuler, 1.0, 1.0 / 64.0),
        (Method::Midpoint, 2.0, 1.0 / 16.0),
        (Method::Rk4, 4.0, 1.0 / 8.0),
        (Method::Dopri5, 5.0, 1.0 / 4.0),
        (Method::Rodas3, 3.0, 1.0 / 16.0),
        (Method::Rodas4, 4.0, 1.0 / 4.0),
    ] {
        let errors = halved(first, |h| driven_error(method, h));
        check(&format!("driven {method}"), &errors, order, 0.2);
    }
}

/// Returns the largest errors of the position over the samples, by step.
fn scene_errors(
    (scene, laws): (&Scene, &Laws),
    truth: &Configuration,
    first: f64,
    of: impl Fn(f64) -> Configuration,
) -> Vec<f64> {
    let every = scene.duration_s / 5.0;
    let path =
        |configuration: &Configuration| sampled(scene, laws, configuration, every).unwrap().1;
    let truth = path(truth);
    halved(first, |h| apart(&path(&of(h)), &truth))
}

#[test]
fn validate_orders_on_the_rolling_ball() {
    let (scene, laws) = (scene(Contact::CHAPTER, 2.0), s2());
    let of = |method, pace| Configuration::new(Model::Rolling, method, pace).unwrap();
    // Few steps, so that rounding errors stay below the finest error.
    let truth = of(Method::Dopri5, Pace::Step(2e-3));
    for (method, order, first) in [
        (Method::Euler, 1.0, 1.0 / 100.0),
        (Method::SemiImplicitEuler, 1.0, 1.0 / 100.0),
        (Method::Midpoint, 2.0, 1.0 / 20.0),
        (Method::Rk4, 4.0, 1.0 / 10.0),
        (Method::Dopri5, 5.0, 1.0 / 5.0),
    ] {
        let errors = scene_errors((&scene, &laws), &truth, first, |h| of(method, Pace::Step(h)));
        check(&format!("sine {method}"), &errors, order, 0.2);
    }
}

/// The contact step is of second order in the slow motion, whatever the contact.
#[test]
fn validate_the_contact_step_on_slow_motion() {
    let (scene, laws) = (scene(Contact::CHAPTER, 2.0), s2());
    let errors = scene_errors((&scene, &laws), &tight(), 1.0 / 50.0, |h| {
        compliant(Method::ContactStep, Pace::Step(h))
    });
    check("sine contact-step", &errors, 2.0, 0.2);
}

/// Steps do not end at the times at which slip begins or ends and the ball lands: the
/// contact step is of first order then. Its error depends on the position of these times
/// within a step, so errors are averaged over steps that are up to a quarter shorter.
#[test]
fn validate_the_contact_step_through_slip_and_landing() {
    const PHASES: u32 = 8;
    for (name, contact) in [("A", Contact::CHAPTER), ("B", Contact::SOFT)] {
        let (scene, laws) = (scene(contact, 0.4), s3());
        let by_phase = (0..PHASES).map(|phase| {
            let first = 1e-3 * (1.0 - 0.25 * f64::from(phase) / f64::from(PHASES));
            scene_errors((&scene, &laws), &tight(), first, |h| {
                compliant(Method::ContactStep, Pace::Step(h))
            })
        });
        let sums = by_phase.fold(vec![0.0; HALVINGS + 1], |sums: Vec<f64>, errors| {
            sums.iter().zip(errors).map(|(sum, error)| sum + error).collect()
        });
        check(&format!("S3{name} contact-step"), &sums, 1.0, 0.2);
    }
}
