//! Hours at rest: nothing moves, and no energy is gained.

use super::scenes::{compliant, held, scene};
use nalgebra::Vector3;
use offbd_core::plant::{Contact, Motion};
use offbd_lab::scene::{Configuration, LONGEST_SCENE_S, Method, Model, Pace, Scene, run};

/// Returns a scene with the ball off the centre, at its depth at rest.
fn resting(contact: Contact) -> Scene {
    let mut scene = scene(contact, LONGEST_SCENE_S);
    let sag = 0.051 * 9.81 / contact.stiffness_n_per_m();
    scene.initial.position += Vector3::new(0.05, -0.03, -sag);
    scene
}

/// Returns the distance of the ball from its start, m, and its speed, m/s.
fn drift(scene: &Scene, end: &Motion) -> (f64, f64) {
    let start = &scene.initial;
    let turning = end.spin.norm() * 0.0127;
    ((end.position - start.position).norm(), end.velocity.norm().max(turning))
}

/// Runs `hours` one after the other, each from the end of the previous one.
fn rests(contact: Contact, configuration: &Configuration, hours: u32, deep: bool) {
    let first = resting(contact);
    let mut scene = first.clone();
    for _ in 0..hours {
        scene.initial = run(&scene, &mut held(0.0, 0.0), configuration, None).unwrap().end;
    }
    let mut end = scene.initial;
    if !deep {
        // A rigid plate has no depth to rest at.
        end.position.z = first.initial.position.z;
    }
    let (gone, speed) = drift(&first, &end);
    let name = format!("{} {}", configuration.model(), configuration.method());
    println!("{name}: {gone:e} m, {speed:e} m/s after {hours} h");
    // Only rounding: an ulp of 0.05 m is 7e-18, and a random walk of a million of them
    // covers about a thousand.
    assert!(gone < 1e-14, "{name} moved by {gone:e} m");
    assert!(speed < 1e-14, "{name} moves with {speed:e} m/s");
}

#[test]
fn hours_on_the_stiff_contact() {
    rests(Contact::CHAPTER, &compliant(Method::ContactStep, Pace::Step(1e-3)), 1, true);
    rests(Contact::CHAPTER, &compliant(Method::ContactStep, Pace::Step(1e-2)), 4, true);
    rests(Contact::CHAPTER, &compliant(Method::Rodas4, Pace::Step(1e-2)), 1, true);
}

#[test]
fn hours_on_the_soft_contact() {
    rests(Contact::SOFT, &compliant(Method::ContactStep, Pace::Step(1e-2)), 4, true);
    rests(Contact::SOFT, &compliant(Method::Rodas4, Pace::Step(1e-2)), 1, true);
}

#[test]
fn hours_on_the_rigid_plate() {
    let of = |model, method, pace| Configuration::new(model, method, pace).unwrap();
    let rk4 = of(Model::Rolling, Method::Rk4, Pace::Step(1e-2));
    rests(Contact::CHAPTER, &rk4, 4, false);
    let sliding = of(Model::Sliding, Method::Dopri5, Pace::Tolerance(1e-9));
    rests(Contact::CHAPTER, &sliding, 4, false);
}
