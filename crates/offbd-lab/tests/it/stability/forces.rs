//! The contact forces and their derivatives at random states.

use nalgebra::Vector3;
use offbd_core::plant::{Ball, Body, Contact, Ground, Motion, Plate, PlateMotion, Tilt};
use offbd_lab::models::Compliant;
use proptest::prelude::*;

fn variants() -> [Compliant; 4] {
    let body = Body::ball(&Ball::default(), &Plate::default());
    let model = Compliant::new(body, Contact::CHAPTER, Ground::Endless);
    [model, model.with_cone(), model.with_push_only(), model.with_cone().with_push_only()]
}

/// Motions up to 1e-5 m in or above the plate, with slips of a few thresholds.
fn motions() -> impl Strategy<Value = Motion> {
    let side = prop::array::uniform2(-0.1..0.1_f64);
    let slip = prop::array::uniform2(-4e-4..4e-4_f64);
    let normal = (-1e-5..1e-5_f64, -0.02..0.02_f64);
    let spin = prop::array::uniform3(-20.0..20.0_f64);
    (side, slip, normal, spin).prop_map(|([x, y], [sx, sy], (above, vz), [wx, wy, wz])| Motion {
        position: Vector3::new(x, y, 0.0227 + above),
        velocity: Vector3::new(0.0127 * wy - sx, -0.0127 * wx - sy, vz),
        spin: Vector3::new(wx, wy, wz),
    })
}

fn plates() -> impl Strategy<Value = PlateMotion> {
    let of = |most: f64| prop::array::uniform2(-most..most);
    (of(0.5), of(5.0), of(50.0)).prop_map(|(angle, rate, acceleration)| {
        let (angle, rate, acceleration) = (angle.into(), rate.into(), acceleration.into());
        Tilt { angle, rate, acceleration }.motion()
    })
}

/// Steps of the difference quotients, in the units of the state: the force is linear or
/// smooth except at a slip of 1e-4 m/s and a depth of 0 m.
const STEPS: [f64; 9] = [1e-6, 1e-6, 1e-8, 1e-8, 1e-8, 1e-6, 1e-6, 1e-6, 1e-4];

/// Returns whether the state is so far from every kink that no difference spans one.
fn away_from_kinks(model: &Compliant, at: &Motion) -> bool {
    let contact = &model.contact;
    let threshold = contact.slip_threshold_m_s();
    let [x, y] = model.body.slip(&at.velocity, &at.spin);
    let depth = at.position.z - model.body.rest_height_m();
    let push = -contact.stiffness_n_per_m() * depth - contact.damping_n_s_per_m() * at.velocity.z;
    let far = |s: f64| (s - threshold).abs() > 1e-6;
    far(x.abs()) && far(y.abs()) && far(x.hypot(y)) && depth.abs() > 3e-8 && push.abs() > 0.02
}

/// Returns column `j` of the Jacobian by central differences.
fn differences(model: &Compliant, y: &[f64; 9], plate: &PlateMotion, j: usize) -> [f64; 9] {
    let ends = [-STEPS[j], STEPS[j]].map(|d| {
        let mut at = *y;
        at[j] += d;
        model.rate(&at, plate)
    });
    std::array::from_fn(|i| (ends[1][i] - ends[0][i]) / (2.0 * STEPS[j]))
}

proptest! {
    #[test]
    fn validate_the_jacobian_against_differences(at in motions(), plate in plates()) {
        for model in variants().iter().filter(|model| away_from_kinks(model, &at)) {
            let y = at.to_row();
            let jacobian = model.jacobian(&y, &plate);
            let largest = jacobian.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
            let columns: [_; 9] = std::array::from_fn(|j| differences(model, &y, &plate, j));
            for (i, row) in jacobian.iter().enumerate() {
                for (j, is) in row.iter().enumerate() {
                    let should = columns[j][i];
                    // Curvature of the cone: (step/threshold)² of the entry;
                    // rounding: eps·rate/step, some 1e-9 of the largest.
                    let allowed = 1e-3 * should.abs() + 1e-8 * largest + 1e-4;
                    prop_assert!((is - should).abs() <= allowed, "({i}, {j}): {is:e} for {should:e}");
                }
            }
        }
    }

    #[test]
    fn friction_stays_within_its_limit(at in motions()) {
        let [boxed, cone, push, both] = variants().map(|model| model.force(&at));
        let mu = Contact::CHAPTER.friction() * (1.0 + 1e-12);
        for force in [boxed, push] {
            prop_assert!(force.x.abs().max(force.y.abs()) <= mu * force.z.abs());
        }
        for force in [cone, both] {
            prop_assert!(force.xy().norm() <= mu * force.z.abs());
        }
        prop_assert!(push.z >= 0.0 && both.z >= 0.0);
        prop_assert!(push.z == boxed.z.max(0.0) && both.z == cone.z.max(0.0));
    }

    /// Friction never drives the slip while the plate pushes.
    #[test]
    fn friction_takes_energy_away(at in motions()) {
        for model in variants() {
            let (force, [x, y]) = (model.force(&at), model.body.slip(&at.velocity, &at.spin));
            prop_assert!(force.z <= 0.0 || force.x * x + force.y * y >= 0.0);
        }
    }
}
