//! Scenes shared by the tests, and functions to run them.

use std::f64::consts::PI;

use offbd_core::maths::{EULER, MIDPOINT, RK4, System, semi_implicit_euler};
use offbd_core::plant::{Ball, Contact, Motion, Plate, PlateMotion};
use offbd_lab::methods::Stiff;
use offbd_lab::methods::{RODAS3, RODAS4};
use offbd_lab::models::Compliant;
use offbd_lab::scene::{
    Configuration, Failure, Law, Laws, Method, Model, Pace, RunOutcome, Samples, Scene, Subject,
    Term, run,
};

/// κ of the chapter's ball.
pub const KAPPA: f64 = 0.4;

/// The chapter's ball on an endless plate.
pub fn scene(contact: Contact, duration_s: f64) -> Scene {
    let ball = Subject::Ball(Ball::default());
    Scene::new(ball, Plate::default(), contact, duration_s).unwrap()
}

/// Returns the same scene with the ball at its depth at rest.
pub fn settled(mut scene: Scene) -> Scene {
    let weight = scene.body().mass_kg() * 9.81;
    scene.initial.position.z -= weight / scene.contact.stiffness_n_per_m();
    scene
}

pub fn law(terms: &[Term]) -> Law {
    Law::new(terms)
}

/// Constant angles.
pub fn held(qx: f64, qy: f64) -> Laws {
    Laws::new(law(&[Term::Constant(qx)]), law(&[Term::Constant(qy)]), Vec::new())
}

/// S1: both angles π/20.
pub fn s1() -> Laws {
    held(PI / 20.0, PI / 20.0)
}

/// S2: both angles sinusoidal.
pub fn s2() -> Laws {
    let sine = |frequency, phase| law(&[Term::Sine { amplitude: 0.05, frequency, phase }]);
    Laws::new(sine(0.7, 0.0), sine(0.9, 0.5), Vec::new())
}

/// S3: tilts so far within 0.15 s that the ball slips, leaves the plate and lands.
pub fn s3() -> Laws {
    let step = Term::Smoothstep { to: 1.2, start: 0.0, duration: 0.15 };
    Laws::new(Law::default(), law(&[step]), Vec::new())
}

pub fn compliant(method: Method, pace: Pace) -> Configuration {
    Configuration::new(Model::Compliant, method, pace).unwrap()
}

/// The configuration of the reference solution.
pub fn tight() -> Configuration {
    compliant(Method::Rodas4, Pace::Tolerance(1e-10))
}

/// Runs a scene; returns the outcome and the samples.
pub fn sampled(
    scene: &Scene,
    laws: &Laws,
    configuration: &Configuration,
    every_s: f64,
) -> Result<(RunOutcome, Vec<(f64, Motion)>), Failure> {
    let mut taken = Vec::new();
    let mut sink = |t: f64, at: &Motion| taken.push((t, *at));
    let mut samples = Samples::new(every_s, &mut sink);
    let outcome = run(scene, &mut laws.clone(), configuration, Some(&mut samples))?;
    Ok((outcome, taken))
}

/// Returns the largest distance in (x, y) of two runs with the same sampling, m.
pub fn apart(a: &[(f64, Motion)], b: &[(f64, Motion)]) -> f64 {
    assert_eq!(a.len(), b.len());
    let each = a.iter().zip(b).map(|(a, b)| (a.1.position.xy() - b.1.position.xy()).norm());
    each.fold(0.0, f64::max)
}

/// Returns the speed of the contact point relative to the plate, m/s.
pub fn slip_speed(scene: &Scene, at: &Motion) -> f64 {
    let [x, y] = scene.body().slip(&at.velocity, &at.spin);
    x.hypot(y)
}

/// The compliant model on a plate at rest.
pub struct OnPlate<'a> {
    pub model: &'a Compliant,
    pub plate: PlateMotion,
}

impl System<9> for OnPlate<'_> {
    const POSITIONS: usize = 3;

    fn rate(&self, _: f64, y: &[f64; 9]) -> [f64; 9] {
        self.model.rate(y, &self.plate)
    }
}

impl Stiff<9> for OnPlate<'_> {
    fn jacobian(&self, _: f64, y: &[f64; 9]) -> [[f64; 9]; 9] {
        self.model.jacobian(y, &self.plate)
    }
}

/// Returns the state after one step by any method that steps general systems.
pub fn step<const N: usize>(
    method: Method,
    system: &impl Stiff<N>,
    t: f64,
    y: &[f64; N],
    h: f64,
) -> [f64; N] {
    match method {
        Method::Euler => EULER.step(system, t, y, h),
        Method::SemiImplicitEuler => semi_implicit_euler(system, t, y, h),
        Method::Midpoint => MIDPOINT.step(system, t, y, h),
        Method::Rk4 => RK4.step(system, t, y, h),
        Method::Dopri5 => offbd_core::maths::DOPRI5.step(system, t, y, h),
        Method::Rodas3 => RODAS3.step(system, t, y, h).unwrap().y,
        Method::Rodas4 => RODAS4.step(system, t, y, h).unwrap().y,
        Method::ZeroOrderHold | Method::ContactStep => panic!("no method for any system"),
    }
}
