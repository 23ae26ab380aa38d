//! Explicit integrators, least-squares filters and robust statistics.
//!
//! Pure functions of numbers; knows nothing of rigs.

mod runge_kutta;
pub mod sine;
mod sliding_quadratic;
mod statistics;
mod system;

pub use runge_kutta::{
    DOPRI5, EULER, Estimated, MIDPOINT, RK4, RungeKutta, dopri5, semi_implicit_euler,
};
pub use sliding_quadratic::{Fit, SlidingQuadratic, window_for};
pub use statistics::{median, quantile, robust_deviation};
pub use system::{System, moved};
