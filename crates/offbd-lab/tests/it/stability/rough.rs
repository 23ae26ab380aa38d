//! The L-stable methods at a fixed step of 1 ms, at least seventy times the explicit limit,
//! through slip, lift-off, landing and the edge.

use super::scenes::{apart, compliant, s1, s3, sampled, scene, settled, tight};
use offbd_core::plant::{Contact, Motion};
use offbd_lab::scene::{Configuration, Laws, Method, Pace, Scene};

const SAMPLE_S: f64 = 1e-3;

/// Returns the kinetic energy relative to the plate plus that of the spring and the
/// magnitude of the potential energy, J.
fn energy(scene: &Scene, at: &Motion) -> f64 {
    let body = scene.body();
    let depth = (body.rest_height_m() - at.position.z).max(0.0);
    let turning = at.spin.norm_squared() / body.inverse_inertia();
    (body.mass_kg() * (at.velocity.norm_squared() + 2.0 * 9.81 * at.position.z.abs()) + turning)
        / 2.0
        + scene.contact.stiffness_n_per_m() * depth * depth / 2.0
}

fn most_energy(scene: &Scene, samples: &[(f64, Motion)]) -> f64 {
    samples.iter().map(|(_, at)| energy(scene, at)).fold(0.0, f64::max)
}

/// Runs the configurations `each`, and compares them with the reference solution.
fn check(name: &str, scene: &Scene, laws: &Laws, each: &[Configuration], within_m: f64) {
    let (_, truth) = sampled(scene, laws, &tight(), SAMPLE_S).unwrap();
    let most = most_energy(scene, &truth);
    for configuration in each {
        let method = configuration.method();
        let (outcome, path) = sampled(scene, laws, configuration, SAMPLE_S).unwrap();
        let finite = outcome.end.to_row().iter().all(|value| value.is_finite());
        let (off, share) = (apart(&path, &truth), most_energy(scene, &path) / most);
        println!("{name} {method}: off {off:.2e} m, energy {share:.4} of the truth's");
        assert!(finite && off < within_m, "{name} {method}: off by {off:e} m");
        assert!(share < 1.05, "{name} {method}: {share} times the truth's energy");
    }
}

fn at_1_ms(method: Method) -> Configuration {
    compliant(method, Pace::Step(1e-3))
}

fn tilting(contact: Contact) -> Scene {
    scene(contact, 0.4)
}

/// The chapter's first exercise: the ball rolls over the nearer edge and falls.
fn over_the_edge(contact: Contact) -> Scene {
    let mut scene = scene(contact, 0.6);
    scene.edges = true;
    scene
}

/// The contact step is stable in all scenes, from a ball that just touches the plate: the
/// stiff and the soft landing, and the edge.
#[test]
fn the_contact_step_through_slip_flight_landing_and_edge() {
    let each = [at_1_ms(Method::ContactStep)];
    check("S3A", &tilting(Contact::CHAPTER), &s3(), &each, 1e-4);
    check("S3B", &tilting(Contact::SOFT), &s3(), &each, 3e-4);
    check("edge A", &over_the_edge(Contact::CHAPTER), &s1(), &each, 1e-5);
    check("edge B", &over_the_edge(Contact::SOFT), &s1(), &each, 1e-5);
}

/// The Rosenbrock methods are stable as long as no step starts off the plate: slip and the
/// edge, from the depth at rest.
#[test]
fn rosenbrock_methods_through_slip_and_over_the_edge() {
    let each = [at_1_ms(Method::Rodas3), at_1_ms(Method::Rodas4)];
    let mut slipping = settled(tilting(Contact::CHAPTER));
    slipping.duration_s = 0.11;
    check("S3A until it leaves", &slipping, &s3(), &each, 1e-5);
    check("S3B", &settled(tilting(Contact::SOFT)), &s3(), &each, 1e-4);
    check("edge A", &settled(over_the_edge(Contact::CHAPTER)), &s1(), &each, 1e-5);
    check("edge B", &settled(over_the_edge(Contact::SOFT)), &s1(), &each, 1e-5);
}

/// A step that starts off the plate has no contact in its only Jacobian: it is explicit,
/// L-stability does not help, and a single step of ten times the explicit limit of the
/// normal mode (107 µs) errs by half a metre. So the step of a landing is divided.
#[test]
fn validate_rosenbrock_methods_at_touchdown() {
    let (scene, laws) = (settled(tilting(Contact::CHAPTER)), s3());
    let (_, truth) = sampled(&scene, &laws, &tight(), SAMPLE_S).unwrap();
    for method in [Method::Rodas3, Method::Rodas4] {
        for (pace, within) in
            [(Pace::Step(1e-3), 1e-4), (Pace::Step(5e-5), 1e-5), (Pace::Tolerance(1e-4), 1e-4)]
        {
            let path = sampled(&scene, &laws, &compliant(method, pace), SAMPLE_S).unwrap().1;
            let off = apart(&path, &truth);
            assert!(off < within, "{method} at {pace:?}: {off:e} m");
        }
    }
}
