//! Estimation: least-squares filters and robust statistics.
//!
//! Pure and deterministic: numbers in, numbers out. Knows nothing of rigs.

pub mod estimators;
mod sliding_quadratic;
mod statistics;

pub use sliding_quadratic::{Fit, Path, SlidingQuadratic};
pub use statistics::{median, quantile, robust_deviation};
