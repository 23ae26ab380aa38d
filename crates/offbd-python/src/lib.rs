//! The native part of the Python package `offbd`: everything that computes. What is only
//! convenient is in `python/offbd/`.
//!
//! Documents (asset files, scene files, verdict lines) cross the border as JSON text, columns
//! of numbers as Arrow. While something is judged, calibrated or simulated, other Python
//! threads run.

mod columns;
mod judge;
mod lab;
mod recording;
mod table;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use offbd_core::engine::Rig;
use offbd_core::vocabulary::Invalid;
use offbd_wire::asset;

#[pymodule]
mod _offbd {
    #[pymodule_export]
    use super::judge::{NativeEngine, calibrate, replay};
    #[pymodule_export]
    use super::lab::{scene, simulate};
    #[pymodule_export]
    use super::recording::read;
    #[pymodule_export]
    use super::table::Table;

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python expects")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}

/// The error of a value that cannot be used.
fn unusable(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Returns the rig of an asset file; without one, the chapter's rig.
fn rig(asset_file: Option<&str>) -> Result<Rig, Invalid> {
    asset_file.map_or_else(|| Ok(Rig::chapter("chapter")), |text| asset::parse_new(text.as_bytes()))
}
