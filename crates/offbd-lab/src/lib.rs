//! The laboratory of offbd: scenes, the models and methods that only scenes
//! need, simulated rigs, and charts of measurements.
//!
//! The service does not need this crate. The crate depends on neither the
//! service, its store nor HTTP.

pub mod chart;
pub mod estimators;
pub mod methods;
pub mod models;
pub mod scene;
pub mod simulation;
pub mod timing;
