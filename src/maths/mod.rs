//! Integrators, least-squares filters and robust statistics.
//!
//! Pure and deterministic: numbers in, numbers out. Knows nothing of rigs.

mod adaptive;
pub mod estimators;
mod kinked_parabola;
mod linear;
mod rosenbrock;
mod runge_kutta;
pub mod sine;
mod sliding_quadratic;
mod statistics;
mod system;

pub use adaptive::StepControl;
pub use kinked_parabola::off_kinked_parabola;
pub use rosenbrock::{RODAS3, RODAS4, Rosenbrock};
pub use runge_kutta::{
    DOPRI5, EULER, Estimated, MIDPOINT, RK4, RungeKutta, dopri5, semi_implicit_euler,
};
pub use sliding_quadratic::{Fit, SlidingQuadratic, window_for};
pub use statistics::{median, quantile, robust_deviation};
pub use system::{Stiff, System};
