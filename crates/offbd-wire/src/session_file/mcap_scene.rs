//! The rig in an MCAP file, with the messages by which viewers show a robot: plate and ball as
//! solids in their frames, the measured and the twin's acceleration as arrows on the ball, the
//! faults as a log. Beside them are all judged quantities.
//!
//! The session is judged while it is written, from its first sample on and without the faults
//! of earlier sessions, as `offbd replay` does.

use std::f64::consts::PI;

use foxglove::Encode;
use foxglove::messages::log::Level;
use foxglove::messages::{
    self, ArrowPrimitive, Color, CubePrimitive, CylinderPrimitive, FrameTransform, FrameTransforms,
    Log, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive, Timestamp,
};
use nalgebra::{UnitQuaternion, Vector3};

use super::SessionFileError;
use super::mcap_file::{McapFile, Topic, json_schema, nanoseconds, unwritten};
use crate::verdict::{evidence_view, sentence};
use crate::{asset, words::CodeWord};
use offbd_core::diagnosis::{AxisEvidence, Evidence, FaultMemory, Transition};
use offbd_core::engine::{Admission, Engine, Input, Rig, Setup};
use offbd_core::plant::PlateShape;
use offbd_core::vocabulary::{FaultStatus, Sample};

const FRAMES: Topic = Topic { name: "/tf", schema: FrameTransforms::get_schema };
/// Plate and ball, once: viewers keep what they were shown.
const RIG: Topic = Topic { name: "/rig", schema: SceneUpdate::get_schema };
/// The accelerations.
const TWIN: Topic = Topic { name: "/twin", schema: SceneUpdate::get_schema };
const FAULTS: Topic = Topic { name: "/faults", schema: Log::get_schema };
const EVIDENCE: Topic = Topic {
    name: "/offbd/evidence",
    schema: || json_schema("offbd.Evidence", include_str!("mcap_schemas/evidence.json")),
};

// The fixed frame, and those of plate and ball.
const WORLD: &str = "world";
const PLATE: &str = "plate";
const BALL: &str = "ball";

/// Length of the arrow of an acceleration of 1 m/s², m. Chosen: what a ball on a plate has,
/// some m/s² at most, fits the plate.
const ARROW_M_PER_M_S2: f64 = 0.05;

/// The rig that is shown, with the engine that judges its session.
pub(super) struct RigScene {
    engine: Engine,
    evidence: Vec<Evidence>,
    transitions: Vec<Transition>,
    is_shown: bool,
}

impl RigScene {
    /// Reads the asset file of the session.
    pub(super) fn new(asset_file: &str) -> Result<Self, SessionFileError> {
        let rig = asset::parse(asset_file.as_bytes()).map_err(unwritten)?;
        let setup = Setup::new(rig, None).map_err(unwritten)?;
        let engine = Engine::new(setup, FaultMemory::default());
        Ok(Self { engine, evidence: Vec::new(), transitions: Vec::new(), is_shown: false })
    }

    /// Judges a sample, and writes what becomes known by it.
    pub(super) fn sample(
        &mut self,
        sample: &Sample,
        file: &mut McapFile,
    ) -> Result<(), SessionFileError> {
        if !self.is_shown {
            self.is_shown = true;
            let rig = &self.engine.setup().rig;
            file.foxglove(RIG, sample.t_s, &rig_message(rig, sample.t_s))?;
        }
        if self.input(Input::Sample(*sample)) == Some(Admission::Unknown) {
            // Rows as old as this are not retransmissions in a recording.
            self.input(Input::NewSample(*sample));
        }
        self.write(file)
    }

    /// Judges what the engine still holds.
    pub(super) fn end(&mut self, file: &mut McapFile) -> Result<(), SessionFileError> {
        self.input(Input::End);
        self.write(file)
    }

    fn input(&mut self, input: Input) -> Option<Admission> {
        let Self { engine, evidence, transitions, .. } = self;
        engine.observe(input, transitions, |seen| evidence.push(seen.clone()))
    }

    fn write(&mut self, file: &mut McapFile) -> Result<(), SessionFileError> {
        let height_m = self.engine.setup().rig.plate.centre_gap_m(&self.engine.setup().rig.ball);
        for evidence in self.evidence.drain(..) {
            let Some(at) = evidence.at else { continue };
            let t_s = at.seconds();
            file.foxglove(FRAMES, t_s, &frames_message(&evidence, height_m, t_s))?;
            file.foxglove(TWIN, t_s, &twin_message(&evidence, t_s))?;
            file.json(EVIDENCE, t_s, &evidence_view(&evidence))?;
        }
        for transition in self.transitions.drain(..) {
            let t_s = transition.at.seconds();
            file.foxglove(FAULTS, t_s, &log_message(&transition, t_s))?;
        }
        Ok(())
    }
}

fn timestamp(t_s: f64) -> Option<Timestamp> {
    let ns = nanoseconds(t_s);
    let s = u32::try_from(ns / 1_000_000_000).ok()?;
    Timestamp::new_checked(s, (ns % 1_000_000_000) as u32)
}

fn vector(v: Vector3<f64>) -> Option<messages::Vector3> {
    Some(messages::Vector3 { x: v.x, y: v.y, z: v.z })
}

fn pose(position: Vector3<f64>, turned: UnitQuaternion<f64>) -> Option<Pose> {
    Some(Pose { position: vector(position), orientation: orientation(turned) })
}

fn orientation(turned: UnitQuaternion<f64>) -> Option<Quaternion> {
    let q = turned.coords;
    Some(Quaternion { x: q.x, y: q.y, z: q.z, w: q.w })
}

const fn color(r: f64, g: f64, b: f64, a: f64) -> Option<Color> {
    Some(Color { r, g, b, a })
}

/// A part of the scene that moves with a frame, without anything to show yet.
fn entity(id: &str, frame: &str, t_s: f64) -> SceneEntity {
    SceneEntity {
        timestamp: timestamp(t_s),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..SceneEntity::default()
    }
}

fn scene(entities: Vec<SceneEntity>) -> SceneUpdate {
    SceneUpdate { deletions: Vec::new(), entities }
}

fn rig_message(rig: &Rig, t_s: f64) -> SceneUpdate {
    scene(vec![plate(rig, t_s), ball(rig, t_s)])
}

fn plate(rig: &Rig, t_s: f64) -> SceneEntity {
    let thickness_m = rig.plate.thickness_m();
    // The origin is the middle of the upper side.
    let pose = pose(Vector3::new(0.0, 0.0, -thickness_m / 2.0), UnitQuaternion::identity());
    let color = color(0.6, 0.6, 0.6, 0.8);
    let size = |x, y| vector(Vector3::new(x, y, thickness_m));
    let (mut cubes, mut cylinders) = (Vec::new(), Vec::new());
    match rig.plate.shape() {
        PlateShape::Rectangle { length_m, width_m } => {
            cubes.push(CubePrimitive { pose, size: size(length_m, width_m), color });
        }
        PlateShape::Round { diameter_m } => cylinders.push(CylinderPrimitive {
            pose,
            size: size(diameter_m, diameter_m),
            bottom_scale: 1.0,
            top_scale: 1.0,
            color,
        }),
    }
    SceneEntity { cubes, cylinders, ..entity("plate", PLATE, t_s) }
}

fn ball(rig: &Rig, t_s: f64) -> SceneEntity {
    let ball = SpherePrimitive {
        pose: pose(Vector3::zeros(), UnitQuaternion::identity()),
        size: vector(Vector3::repeat(2.0 * rig.ball.radius_m())),
        color: color(0.9, 0.5, 0.1, 1.0),
    };
    SceneEntity { spheres: vec![ball], ..entity("ball", BALL, t_s) }
}

/// The plate as commanded, and the ball as measured; without one, it stays where it was.
fn frames_message(evidence: &Evidence, height_m: f64, t_s: f64) -> FrameTransforms {
    let angle = |axis: &AxisEvidence| axis.command_rad.unwrap_or(0.0);
    let axes = &evidence.axes;
    // The x servo turns the plate about y, within the frame that the y servo turns about x.
    let turned = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle(&axes.y))
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle(&axes.x));
    let mut transforms = vec![transform(WORLD, PLATE, t_s, Vector3::zeros(), turned)];
    if axes.x.position_m.is_some() || axes.y.position_m.is_some() {
        let along = |axis: &AxisEvidence| axis.position_m.unwrap_or(0.0);
        let position = Vector3::new(along(&axes.x), along(&axes.y), height_m);
        transforms.push(transform(PLATE, BALL, t_s, position, UnitQuaternion::identity()));
    }
    FrameTransforms { transforms }
}

fn transform(
    parent: &str,
    child: &str,
    t_s: f64,
    translation: Vector3<f64>,
    turned: UnitQuaternion<f64>,
) -> FrameTransform {
    FrameTransform {
        timestamp: timestamp(t_s),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: vector(translation),
        rotation: orientation(turned),
    }
}

/// The measured acceleration in blue and the twin's in green; unknown ones are not drawn.
fn twin_message(evidence: &Evidence, t_s: f64) -> SceneUpdate {
    let arrows = |id: &str, of: fn(&AxisEvidence) -> Option<f64>, color| {
        let (x, y) = (of(&evidence.axes.x), of(&evidence.axes.y));
        let acceleration = Vector3::new(x.unwrap_or(0.0), y.unwrap_or(0.0), 0.0);
        let arrows = arrow(acceleration, color).into_iter().collect();
        SceneEntity { arrows, ..entity(id, BALL, t_s) }
    };
    scene(vec![
        arrows("measured acceleration", |a| a.measured_m_s2, color(0.1, 0.4, 0.9, 1.0)),
        arrows("acceleration of the twin", |a| a.twin_m_s2, color(0.1, 0.7, 0.3, 1.0)),
    ])
}

/// An arrow along the plate; `None` if it has no length.
fn arrow(acceleration: Vector3<f64>, color: Option<Color>) -> Option<ArrowPrimitive> {
    let length_m = acceleration.norm() * ARROW_M_PER_M_S2;
    // An arrow points along x until it is turned.
    let turned = UnitQuaternion::rotation_between(&Vector3::x(), &acceleration)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI));
    (length_m > 0.0).then(|| ArrowPrimitive {
        pose: pose(Vector3::zeros(), turned),
        shaft_length: 0.8 * length_m,
        shaft_diameter: 0.004,
        head_length: 0.2 * length_m,
        head_diameter: 0.01,
        color,
    })
}

fn log_message(transition: &Transition, t_s: f64) -> Log {
    let level = match transition.status {
        _ if !transition.byte.test_failed() => Level::Info,
        FaultStatus::Confirmed => Level::Error,
        _ => Level::Warning,
    };
    Log {
        timestamp: timestamp(t_s),
        level: level.into(),
        message: sentence(transition),
        name: CodeWord::from(transition.code).to_string(),
        ..Log::default()
    }
}
