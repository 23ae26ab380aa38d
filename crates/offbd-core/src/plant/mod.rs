//! The physics of the rig: ball, plate, servos, and models of the ball's motion of
//! increasing cost, each in its own file with its equations and range of validity.
//!
//! A model is immutable data, its state is a small copyable value, and a step is a pure
//! function of both. Knows no faults, sensors or clocks. Notation and signs:
//! `ARCHITECTURE.md`, "Frames and signs".

mod body;
mod contact;
mod lockstep;
mod planar;
mod rolling;
mod servo;
mod simulated_twin;
mod sliding;
mod tilt;
mod twin;

pub use body::{Ball, GRAVITY_M_S2, Plate, PlateShape};
pub use contact::{Body, Contact, Ground, Motion};
pub use lockstep::{Fidelity, Ladder, Rung};
pub use planar::Planar;
pub use rolling::{Grip, Rolling, RollingState};
pub use servo::{ServoModel, ServoState, Sweep};
pub use simulated_twin::SimulatedTwin;
pub use sliding::{Hold, Phase, Sliding};
pub use tilt::{PlateMotion, Tilt};
#[cfg(test)]
pub(crate) use twin::steps;
pub use twin::{
    LONGEST_DEAD_TIME_S, LONGEST_SPAN_S, Twin, TwinAxis, TwinModel, TwinMotion, resistance_share,
};
