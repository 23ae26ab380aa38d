use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::chart::{ChartError, Document};

/// The result of one configuration of one engine on one scene; `benches/peers` writes the
/// same records.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkPrecisionRecord {
    pub scene: String,
    /// `offbd`, or the name of another engine.
    pub engine: String,
    pub model: String,
    pub method: String,
    /// Name of the parameter: `step_s`, `tolerance_m`, or one of another engine.
    pub setting: String,
    /// Value of the parameter.
    pub value: f64,
    /// Largest distance from the reference solution in x, y over the samples, m; `None` if
    /// the run failed.
    pub error_m: Option<f64>,
    /// CPU time per simulated second, µs/s, minimum over the repeated measurements.
    pub cpu_us_per_s: Option<f64>,
    /// Median over minimum of the repeated measurements.
    #[serde(default)]
    pub spread: Option<f64>,
    /// Why the run failed.
    #[serde(default)]
    pub note: Option<String>,
    /// Whether it is on the Pareto front of offbd's records on this scene.
    #[serde(default)]
    pub front: bool,
    /// The requested accuracy, m, of a run in one pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked_m: Option<f64>,
}

impl WorkPrecisionRecord {
    /// Returns cost and error, if both are known, finite and positive.
    pub(super) fn point(&self) -> Option<(f64, f64)> {
        let finite = |value: Option<f64>| value.filter(|v| v.is_finite() && *v > 0.0);
        Some((finite(self.cpu_us_per_s)?, finite(self.error_m)?))
    }
}

/// The records of other engines, and their versions.
#[derive(Clone, Debug, Default)]
pub struct Peers {
    pub records: Vec<WorkPrecisionRecord>,
    pub versions: Vec<(String, String)>,
}

/// Reads the records and versions of other engines from a file.
///
/// # Errors
/// [`ChartError::Peers`] naming the file, if it cannot be read or is invalid.
pub fn read(path: &Path) -> Result<Peers, ChartError> {
    let failed = |reason: String| ChartError::Peers { path: path.to_owned(), reason };
    let bytes = std::fs::read(path).map_err(|e| failed(e.to_string()))?;
    let document: Document<WorkPrecisionRecord> =
        serde_json::from_slice(&bytes).map_err(|e| failed(e.to_string()))?;
    let versions = document.versions.into_iter().filter(|(name, _)| name != "offbd");
    Ok(Peers { records: document.records, versions: versions.collect() })
}
