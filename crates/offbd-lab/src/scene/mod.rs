//! Scenes: a body on a plate that moves by a law of time or a controller, run by any
//! model and any method that can step it.
//!
//! A run is specified by data: a model, a method and a pace. The integration loops are
//! generic over all three. The module uses no files, clock or faults.

mod configuration;
mod controlled;
mod drive;
mod driven_models;
mod events;
mod law;
mod one_pass;
mod run;
mod samples;
mod search;
mod step_limits;
mod stepping;
mod survey;

pub use configuration::{Configuration, LONGEST_STEP_S, Method, Model, Pace, SHORTEST_STEP_S};
pub use controlled::{ControlLoop, ControlStep, ControlledPlate};
pub use drive::{Drive, Laws, PlateNodes, Push};
pub use events::{Event, MOST_EVENTS};
pub use law::{AngleNodes, Law, Term};
pub use one_pass::{Declined, OnePass, Stage, one_pass};
pub use run::{RunOutcome, run, suits};
pub use samples::{Samples, Sink};
pub use search::{Choice, OutOfReach, TriedCandidate, choose};
pub use step_limits::StepLimits;
pub use stepping::{Failure, MOST_STEPS, RunStatistics};
pub use survey::Survey;

use offbd_core::plant::{Ball, Body, Contact, Ground, Motion, Plate};
use offbd_core::vocabulary::{Invalid, positive};

/// The body on the plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Subject {
    Ball(Ball),
    Block(Block),
}

/// A cube that slides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    pub edge_m: f64,
    pub mass_kg: f64,
    body: Body,
}

/// Longest scene, s: an hour; chosen to bound the computing time.
pub const LONGEST_SCENE_S: f64 = 3600.0;

/// A body on a plate with its initial motion; the plate's motion is a [`Drive`].
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    pub subject: Subject,
    pub plate: Plate,
    pub contact: Contact,
    /// Whether the plate ends at its edges; otherwise it is endless.
    pub edges: bool,
    pub initial: Motion,
    pub duration_s: f64,
}

impl Scene {
    /// Creates a scene with `subject` at rest at the centre of an endless `plate`, for
    /// `duration_s` in (0, 3600] s.
    ///
    /// # Errors
    /// [`Invalid`] naming the element.
    pub fn new(
        subject: Subject,
        plate: Plate,
        contact: Contact,
        duration_s: f64,
    ) -> Result<Self, Invalid> {
        let duration_s = positive("/duration_s", duration_s, LONGEST_SCENE_S)?;
        let initial = Motion::default();
        let mut scene = Self { subject, plate, contact, edges: false, initial, duration_s };
        scene.initial = Motion::at_rest(&scene.body());
        Ok(scene)
    }

    /// Creates a block with an edge in (0, 1] m and a mass in [1e-6, 100] kg.
    ///
    /// # Errors
    /// [`Invalid`] naming the element.
    pub fn block(edge_m: f64, mass_kg: f64, plate: &Plate) -> Result<Subject, Invalid> {
        let body = Body::block(edge_m, mass_kg, plate)?;
        Ok(Subject::Block(Block { edge_m, mass_kg, body }))
    }

    #[must_use]
    pub fn body(&self) -> Body {
        match &self.subject {
            Subject::Ball(ball) => Body::ball(ball, &self.plate),
            Subject::Block(block) => block.body,
        }
    }

    #[must_use]
    pub fn ground(&self) -> Ground {
        if self.edges { Ground::Plate(self.plate) } else { Ground::Endless }
    }
}
