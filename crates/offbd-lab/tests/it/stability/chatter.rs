//! Between the slip limit and the normal limit the solution does not diverge: the clamp of
//! friction turns the instability into chatter, which the position does not show.

use super::scenes::{KAPPA, apart, compliant, s1, sampled, scene, settled, slip_speed, tight};
use offbd_core::plant::{Contact, Motion};
use offbd_lab::scene::{Method, Pace, Scene};
use std::f64::consts::PI;

const DURATION_S: f64 = 0.4;
const SAMPLE_S: f64 = 1e-3;

/// Time after which the initial transient has decayed, s: the normal mode decays at
/// 836 1/s.
const SETTLED_S: f64 = 0.02;

fn s1a() -> Scene {
    scene(Contact::CHAPTER, DURATION_S)
}

/// Returns gravity along x, along y and into the plate in scene S1, m/s².
fn pull() -> [f64; 3] {
    let (sin, cos) = (PI / 20.0).sin_cos();
    [9.81 * cos * sin, 9.81 * sin, 9.81 * cos * cos]
}

/// Returns the creep, the slip that carries the friction of the rolling ball,
/// F·v_thr/(μ·F_z), m/s.
fn creep() -> f64 {
    let [x, y, normal] = pull();
    let contact = Contact::CHAPTER;
    let friction = KAPPA / (1.0 + KAPPA) * x.hypot(y);
    friction * contact.slip_threshold_m_s() / (contact.friction() * normal)
}

/// Returns the energy that friction dissipates by creep over the whole scene, J.
fn creep_loss() -> f64 {
    let [x, y, _] = pull();
    0.051 * KAPPA / (1.0 + KAPPA) * x.hypot(y) * creep() * DURATION_S
}

/// Returns the dissipated energy ∫ F·s dt over the samples, J.
fn friction_loss(scene: &Scene, samples: &[(f64, Motion)], every_s: f64) -> f64 {
    let model = scene.compliant();
    let power = samples.iter().map(|(_, at)| {
        let (force, [x, y]) = (model.force(at), scene.body().slip(&at.velocity, &at.spin));
        force.x * x + force.y * y
    });
    power.sum::<f64>() * every_s
}

fn mean_slip(scene: &Scene, samples: &[(f64, Motion)]) -> f64 {
    let settled = samples.iter().filter(|(t, _)| *t >= SETTLED_S);
    let speeds: Vec<f64> = settled.map(|(_, at)| slip_speed(scene, at)).collect();
    speeds.iter().sum::<f64>() / speeds.len() as f64
}

#[test]
fn validate_chatter_shows_in_slip_and_energy_but_not_in_position() {
    let (scene, h) = (s1a(), 50e-6);
    let configuration = compliant(Method::Rk4, Pace::Step(h));
    let (_, each) = sampled(&scene, &s1(), &configuration, h).unwrap();
    let (_, truth) = sampled(&scene, &s1(), &tight(), h).unwrap();
    let (off, slip) = (apart(&each, &truth), mean_slip(&scene, &each));
    let loss = friction_loss(&scene, &each, h);
    println!(
        "off {off:e} m, slip {:.1} creeps, loss {:.1} times",
        slip / creep(),
        loss / creep_loss()
    );
    assert!(off < 1e-3, "the position is off by {off:e} m");
    assert!(slip > 10.0 * creep(), "slip {slip:e} for a creep of {:e} m/s", creep());
    assert!(loss > 10.0 * creep_loss(), "loss {loss:e} for {:e} J", creep_loss());
    let true_loss = friction_loss(&scene, &truth, h);
    assert!((true_loss / creep_loss() - 1.0).abs() < 0.02, "{true_loss:e}");
}

/// Every explicit method chatters between its two limits.
#[test]
fn every_explicit_method_chatters_between_the_limits() {
    let scene = s1a();
    for method in [Method::Euler, Method::SemiImplicitEuler, Method::Midpoint, Method::Rk4] {
        let configuration = compliant(method, Pace::Step(60e-6));
        let (outcome, each) = sampled(&scene, &s1(), &configuration, SAMPLE_S).unwrap();
        let slip = mean_slip(&scene, &each);
        assert!(outcome.end.position.norm() < 1.0, "{method} blew up");
        assert!(slip > 10.0 * creep(), "{method}: {:.1} creeps", slip / creep());
    }
}

/// At a hundred times the explicit limit the creep is accurate. The start is at the depth
/// at rest: a Rosenbrock step that starts off the plate is an explicit one.
#[test]
fn validate_the_creep_of_l_stable_methods_at_one_millisecond() {
    let scene = settled(s1a());
    for method in [Method::Rodas3, Method::Rodas4, Method::ContactStep] {
        let configuration = compliant(method, Pace::Step(1e-3));
        let (_, each) = sampled(&scene, &s1(), &configuration, SAMPLE_S).unwrap();
        let settled = each.iter().filter(|(t, _)| *t >= SETTLED_S);
        for (t, at) in settled {
            let off = slip_speed(&scene, at) / creep() - 1.0;
            assert!(off.abs() < 1e-2, "{method} at {t} s: creep off by {:.2} %", 100.0 * off);
        }
    }
}
