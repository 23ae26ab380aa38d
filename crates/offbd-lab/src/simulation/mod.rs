//! The simulated rig: a plate on two servos, a ball, a sensor, a controller, and their
//! faults.
//!
//! An immutable [`RigModel`] describes a rig; a mutable [`SimulatedRig`] simulates it
//! from event to event (sensor, controller, log) on its own clock. Random streams for
//! separate purposes come from one seed, so that equal seeds give equal bytes and a fault
//! does not change the noise. The module uses the plant's models, but neither the
//! diagnosis nor the system's clock.

mod ball;
mod controller;
mod disturbance;
mod fault;
mod model;
mod noise;
mod presets;
mod reference;
mod refresh;
mod rig;
mod sensor;
mod servo;
mod session;
mod steps;
mod transport;
mod truth;
mod variety;

pub use ball::Surface;
pub use controller::{ControllerModel, PidGains};
pub use disturbance::Disturbances;
pub use fault::{BallFault, Fault, FaultEffect, FaultSyntax, SensorFault, ServoFault};
pub use model::{RigModel, SessionSpread};
pub use presets::Preset;
pub use reference::Reference;
pub use refresh::Refresh;
pub use rig::SimulatedRig;
pub use sensor::SensorModel;
pub use servo::ServoTruth;
pub use steps::{LEAST_STEP, is_step};
pub use transport::{Transport, TransportFaults};
pub use truth::{FaultTruth, Truth};
pub use variety::Variety;
