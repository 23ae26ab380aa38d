//! The laboratory of offbd: scenes, the models and methods that only scenes
//! need, simulated rigs, and charts of what was measured.
//!
//! The service runs without it. Knows no service, no store, no HTTP.

pub mod batch;
pub mod chart;
pub mod estimators;
pub mod methods;
pub mod models;
pub mod scene;
pub mod simulation;
pub mod timing;
