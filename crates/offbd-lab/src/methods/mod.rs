//! Methods for scenes: step-size control, and implicit methods for stiff systems. The
//! explicit methods are in `offbd_core::maths`.

mod adaptive;
mod linear;
mod rosenbrock;
mod stiff;

pub use adaptive::StepControl;
pub use rosenbrock::{RODAS3, RODAS4, Rosenbrock};
pub use stiff::Stiff;
