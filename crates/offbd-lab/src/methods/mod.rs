//! Methods for scenes: control of the step, and implicit methods for stiff
//! systems. The explicit ones are `offbd_core::maths`'s.

mod adaptive;
mod linear;
mod rosenbrock;
mod stiff;

pub use adaptive::StepControl;
pub use rosenbrock::{RODAS3, RODAS4, Rosenbrock};
pub use stiff::Stiff;
