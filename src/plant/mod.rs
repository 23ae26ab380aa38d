//! The rig as physics: ball, plate, servos and the rolling ball's motion.
//!
//! One idea: a model is immutable data, its state is a small copyable value,
//! and a step is a pure function of both. Knows no faults, no sensors, no
//! clock. Notation and signs: `ARCHITECTURE.md`, "Frames and signs".

mod batch;
mod body;
mod rolling;
mod servo;
mod twin;

pub use batch::{Instructions, PlateColumns, RollingBatch, RollingConstants};
pub use body::{Ball, GRAVITY_M_S2, Plate, PlateShape};
pub use rolling::{Rolling, RollingState, Tilt};
pub use servo::{Servo, ServoModel};
pub use twin::{Twin, TwinAxis, TwinModel, TwinMotion};
