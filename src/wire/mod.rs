//! What crosses the boundary: asset files, scene files, session files,
//! verdict lines.
//!
//! One idea: parse in two stages, a syntactic view that judges nothing, then a
//! domain value that cannot be wrong. Views are `Serialize`, domain types are
//! not; they are converted by hand. Knows no sockets and no SQL.

pub mod access;
pub mod asset;
pub mod basis;
pub mod certificate;
pub mod difference;
pub mod drive_cycle;
pub mod learning;
pub mod memory;
#[cfg(feature = "lab")]
mod preset;
pub mod provenance;
pub mod recording;
#[cfg(feature = "lab")]
pub mod scene;
pub mod service;
pub mod session_csv;
pub mod telemetry;
pub mod trace;
pub mod trend;
pub mod verdict;
