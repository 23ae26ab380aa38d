//! The rig in an MCAP file, with the messages by which viewers show a robot: plate and ball as
//! solids in their frames, the measured and the twin's acceleration as arrows on the ball, the
//! faults as a log. Beside them are all judged quantities.
//!
//! The session is judged while it is written, from its first sample on and without the faults
//! of earlier sessions, as `offbd replay` does.

use std::f64::consts::PI;

use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};

use super::SessionFileError;
use super::mcap::{McapFile, Topic, nanoseconds, unwritten};
use crate::wire::verdict::{evidence_view, sentence};
use crate::wire::{asset, words::CodeWord};
use offbd_core::diagnosis::{AxisEvidence, Evidence, FaultMemory, Transition};
use offbd_core::engine::{Admission, Engine, Input, Rig, Setup};
use offbd_core::plant::PlateShape;
use offbd_core::vocabulary::{FaultStatus, Sample};

const SCENE: &str = include_str!("mcap_schemas/scene_update.json");

const FRAMES: Topic = Topic {
    name: "/tf",
    schema: "foxglove.FrameTransforms",
    json_schema: include_str!("mcap_schemas/frame_transforms.json"),
};
/// Plate and ball, once: viewers keep what they were shown.
const RIG: Topic = Topic { name: "/rig", schema: "foxglove.SceneUpdate", json_schema: SCENE };
/// The accelerations.
const TWIN: Topic = Topic { name: "/twin", schema: "foxglove.SceneUpdate", json_schema: SCENE };
const FAULTS: Topic = Topic {
    name: "/faults",
    schema: "foxglove.Log",
    json_schema: include_str!("mcap_schemas/log.json"),
};
const EVIDENCE: Topic = Topic {
    name: "/offbd/evidence",
    schema: "offbd.Evidence",
    json_schema: include_str!("mcap_schemas/evidence.json"),
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
            file.message(RIG, sample.t_s, &rig_message(rig, sample.t_s))?;
        }
        if self.input(Input::Sample(*sample)) == Some(Admission::Unknown) {
            // Rows as old as this are no retransmissions in a recording.
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
            file.message(FRAMES, t_s, &frames_message(&evidence, height_m, t_s))?;
            file.message(TWIN, t_s, &twin_message(&evidence, t_s))?;
            file.message(EVIDENCE, t_s, &evidence_view(&evidence))?;
        }
        for transition in self.transitions.drain(..) {
            let t_s = transition.at.seconds();
            file.message(FAULTS, t_s, &log_message(&transition, t_s))?;
        }
        Ok(())
    }
}

fn timestamp(t_s: f64) -> Value {
    let ns = nanoseconds(t_s);
    json!({"sec": ns / 1_000_000_000, "nsec": ns % 1_000_000_000})
}

fn vector(v: Vector3<f64>) -> Value {
    json!({"x": v.x, "y": v.y, "z": v.z})
}

fn pose(position: Vector3<f64>, turned: UnitQuaternion<f64>) -> Value {
    json!({"position": vector(position), "orientation": orientation(turned)})
}

fn orientation(turned: UnitQuaternion<f64>) -> Value {
    let q = turned.coords;
    json!({"x": q.x, "y": q.y, "z": q.z, "w": q.w})
}

/// A solid or arrow of the scene. All lists of primitives must be there.
fn entity(id: &str, frame: &str, t_s: f64, primitives: &str, solids: Value) -> Value {
    let mut entity = json!({
        "timestamp": timestamp(t_s), "frame_id": frame, "id": id,
        "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": true, "metadata": [],
        "arrows": [], "cubes": [], "spheres": [], "cylinders": [],
        "lines": [], "triangles": [], "texts": [], "models": [],
    });
    entity[primitives] = solids;
    entity
}

fn rig_message(rig: &Rig, t_s: f64) -> Value {
    let thickness_m = rig.plate.thickness_m();
    let (solid, size) = match rig.plate.shape() {
        PlateShape::Rectangle { length_m, width_m } => ("cubes", [length_m, width_m]),
        PlateShape::Round { diameter_m } => ("cylinders", [diameter_m; 2]),
    };
    // The origin is the middle of the upper side.
    let middle = Vector3::new(0.0, 0.0, -thickness_m / 2.0);
    let mut plate = json!({
        "pose": pose(middle, UnitQuaternion::identity()),
        "size": vector(Vector3::new(size[0], size[1], thickness_m)),
        "color": {"r": 0.6, "g": 0.6, "b": 0.6, "a": 0.8},
    });
    if solid == "cylinders" {
        plate["bottom_scale"] = json!(1.0);
        plate["top_scale"] = json!(1.0);
    }
    let diameter_m = 2.0 * rig.ball.radius_m();
    let ball = json!({
        "pose": pose(Vector3::zeros(), UnitQuaternion::identity()),
        "size": vector(Vector3::repeat(diameter_m)),
        "color": {"r": 0.9, "g": 0.5, "b": 0.1, "a": 1.0},
    });
    json!({"deletions": [], "entities": [
        entity("plate", PLATE, t_s, solid, json!([plate])),
        entity("ball", BALL, t_s, "spheres", json!([ball])),
    ]})
}

/// The plate as commanded, and the ball as measured; without one, it stays where it was.
fn frames_message(evidence: &Evidence, height_m: f64, t_s: f64) -> Value {
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
    json!({ "transforms": transforms })
}

fn transform(
    parent: &str,
    child: &str,
    t_s: f64,
    translation: Vector3<f64>,
    turned: UnitQuaternion<f64>,
) -> Value {
    json!({
        "timestamp": timestamp(t_s), "parent_frame_id": parent, "child_frame_id": child,
        "translation": vector(translation), "rotation": orientation(turned),
    })
}

/// The measured acceleration in blue and the twin's in green; unknown ones are no arrows.
fn twin_message(evidence: &Evidence, t_s: f64) -> Value {
    let arrows = |of: fn(&AxisEvidence) -> Option<f64>, color: Value| {
        let (x, y) = (of(&evidence.axes.x), of(&evidence.axes.y));
        let acceleration = Vector3::new(x.unwrap_or(0.0), y.unwrap_or(0.0), 0.0);
        json!(arrow(acceleration, &color).into_iter().collect::<Vec<_>>())
    };
    let measured = arrows(|a| a.measured_m_s2, json!({"r": 0.1, "g": 0.4, "b": 0.9, "a": 1.0}));
    let twin = arrows(|a| a.twin_m_s2, json!({"r": 0.1, "g": 0.7, "b": 0.3, "a": 1.0}));
    json!({"deletions": [], "entities": [
        entity("measured acceleration", BALL, t_s, "arrows", measured),
        entity("acceleration of the twin", BALL, t_s, "arrows", twin),
    ]})
}

/// An arrow along the plate; `None` if it has no length.
fn arrow(acceleration: Vector3<f64>, color: &Value) -> Option<Value> {
    let length_m = acceleration.norm() * ARROW_M_PER_M_S2;
    // An arrow points along x until it is turned.
    let turned = UnitQuaternion::rotation_between(&Vector3::x(), &acceleration)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI));
    (length_m > 0.0).then(|| {
        json!({
            "pose": pose(Vector3::zeros(), turned),
            "shaft_length": 0.8 * length_m, "shaft_diameter": 0.004,
            "head_length": 0.2 * length_m, "head_diameter": 0.01,
            "color": color,
        })
    })
}

/// The levels are those of the schema: 2 is information, 3 a warning, 4 an error.
fn log_message(transition: &Transition, t_s: f64) -> Value {
    let level = match transition.status {
        _ if !transition.byte.test_failed() => 2,
        FaultStatus::Confirmed => 4,
        _ => 3,
    };
    json!({
        "timestamp": timestamp(t_s), "level": level, "message": sentence(transition),
        "name": CodeWord::from(transition.code), "file": "", "line": 0,
    })
}
