//! The digital twin as a model of FMI 2.0 and 3.0, for co-simulation.
//!
//! [`VARIABLES`] is the one list of what the model has; the model description, the
//! documentation and the checks of values follow it. [`Instance`] is a twin between its
//! instantiation and its end. The C functions of FMI are in another crate, which makes a
//! shared library of this one.
//!
//! Knows no files, no clock and no pointers.

mod description;
mod instance;
mod licences;
mod location;
mod start_values;
mod twin;
mod variables;
mod version;

pub use description::{documentation, instantiation_token, model_description};
pub use instance::{Instance, Refusal};
pub use licences::LICENCES;
pub use location::path_of_location;
pub use start_values::StartValues;
pub use variables::{Role, VARIABLES, Variable};
pub use version::FmiVersion;

/// The name of the shared library within an FMU, without its suffix.
pub const MODEL_IDENTIFIER: &str = "ball_on_plate";
