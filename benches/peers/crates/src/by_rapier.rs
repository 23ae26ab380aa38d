//! rapier3d-f64: a ball on a cuboid that is moved from pose to pose.

use anyhow::Result;
use rapier3d_f64::math::{Pose, Rotation, Vector};
use rapier3d_f64::prelude::*;

use crate::equations::{FRICTION, GRAVITY, MASS, RADIUS, REST_HEIGHT, rolling};
use crate::measure::{Case, Labels};
use crate::scene::{Law, Scene};

/// Half extents of a plate that no ball leaves; its top is where the ball rests.
const PLATE: [f64; 3] = [5.0, 5.0, REST_HEIGHT - RADIUS];

const STEPS: [f64; 6] = [5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4];
const QUICK_STEPS: [f64; 3] = [2e-3, 1e-3, 5e-4];
const SHORTEST_SAMPLE: f64 = 2e-3;

/// What can be chosen of the engine.
#[derive(Clone, Copy)]
struct Tuning {
    name: &'static str,
    parameters: fn() -> IntegrationParameters,
}

const TUNINGS: [Tuning; 3] = [
    Tuning { name: "as shipped", parameters: IntegrationParameters::default },
    Tuning { name: "one hard pass", parameters: one_pass },
    Tuning { name: "two hard passes", parameters: two_passes },
];

/// All tunings and steps of one scene.
pub fn scan(case: &mut Case) {
    let scene = *case.scene;
    let steps = if case.quick { &QUICK_STEPS[..] } else { &STEPS };
    for &value in steps.iter().filter(|&&step| step <= SHORTEST_SAMPLE || scene.law == Law::Sine) {
        for tuning in TUNINGS {
            for (ending, staggered) in [("", false), (", staggered start", true)] {
                let method = format!("{}{ending}", tuning.name);
                let labels = Labels { model: "rigid contact", method, setting: "step_s", value };
                case.add(labels, |times| roll(scene, tuning, value, staggered, times));
            }
        }
    }
}

/// A contact so hard that it is solved within a step, without sub-steps and
/// without a second pass that would take out what the penetration puts in.
fn one_pass() -> IntegrationParameters {
    IntegrationParameters { num_internal_stabilization_iterations: 0, ..hard() }
}

/// The same with that second pass, and friction in both.
fn two_passes() -> IntegrationParameters {
    IntegrationParameters { friction_in_bias_pass: true, ..hard() }
}

fn hard() -> IntegrationParameters {
    let softness = SpringCoefficients::new(3000.0, 1.0);
    IntegrationParameters {
        contact_softness: softness,
        static_contact_softness: softness,
        num_solver_iterations: 1,
        contact_recycling: false,
        friction_model: FrictionModel::Coulomb,
        ..IntegrationParameters::default()
    }
}

fn pose(law: Law, t: f64) -> Pose {
    let [qx, qy] = law.at(t).angle;
    Pose::from_parts(Vector::ZERO, Rotation::from_rotation_x(qx) * Rotation::from_rotation_y(qy))
}

fn roll(
    scene: Scene,
    tuning: Tuning,
    step: f64,
    staggered: bool,
    times: &[f64],
) -> Result<Vec<[f64; 2]>> {
    let (mut world, plate, ball) = world(scene, tuning, step, staggered);
    let mut positions = Vec::with_capacity(times.len());
    let mut see = |world: &PhysicsWorld, t: f64| {
        if times.get(positions.len()).is_some_and(|sample| (sample - t).abs() < 0.5 * step) {
            let seen = pose(scene.law, t).rotation.inverse() * world.bodies[ball].translation();
            positions.push([seen.x, seen.y]);
        }
    };
    see(&world, 0.0);
    for n in 1..=(scene.duration / step).round() as u32 {
        let t = f64::from(n) * step;
        world.bodies[plate].set_next_kinematic_position(pose(scene.law, t));
        world.step();
        see(&world, t);
    }
    Ok(positions)
}

fn world(
    scene: Scene,
    tuning: Tuning,
    step: f64,
    staggered: bool,
) -> (PhysicsWorld, RigidBodyHandle, RigidBodyHandle) {
    let mut world = PhysicsWorld::new();
    world.gravity = Vector::new(0.0, 0.0, -GRAVITY);
    world.integration_parameters = IntegrationParameters { dt: step, ..(tuning.parameters)() };
    let plate = RigidBodyBuilder::kinematic_position_based().pose(pose(scene.law, 0.0));
    let [x, y, z] = PLATE;
    let (plate, _) = world.insert(plate, ColliderBuilder::cuboid(x, y, z).friction(FRICTION));
    let substep = step / world.integration_parameters.num_solver_iterations as f64;
    let lead = if staggered { 0.5 * substep } else { 0.0 };
    let ball = ColliderBuilder::ball(RADIUS).friction(FRICTION).mass(MASS);
    let (ball, _) = world.insert(resting(scene.law, lead), ball);
    (world, plate, ball)
}

/// The ball at rest on the plate, with the velocities that it had `lead` earlier.
fn resting(law: Law, lead: f64) -> RigidBodyBuilder {
    let to_world = pose(law, 0.0).rotation;
    let motion = law.at(0.0);
    let ([_, qy], [rx, ry], [ax, ay]) = (motion.angle, motion.rate, motion.acceleration);
    let (sy, cy) = qy.sin_cos();
    let turn = Vector::new(rx * cy, ry, rx * sy);
    let turn_rate = Vector::new(ax * cy - rx * ry * sy, ay, ax * sy + rx * ry * cy);
    let place = Vector::new(0.0, 0.0, REST_HEIGHT);
    let mut rate = [0.0; 5];
    rolling(law, 0.0, &[0.0; 5], &mut rate);
    let [_, _, fx, fy, fz] = rate;
    let carried = turn_rate.cross(place) + turn.cross(turn.cross(place));
    let acceleration = carried + Vector::new(fx, fy, 0.0);
    let spin_rate = turn_rate + Vector::new(-fy / RADIUS, fx / RADIUS, fz);
    RigidBodyBuilder::dynamic()
        .translation(to_world * place)
        .linvel(to_world * (turn.cross(place) - lead * acceleration))
        .angvel(to_world * (turn - lead * spin_rate))
        .can_sleep(false)
}
