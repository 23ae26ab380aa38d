use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::chart::{ChartError, Document};

/// One configuration of one engine on one scene. Peers write the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    pub scene: String,
    /// `offbd`, or somebody else's.
    pub engine: String,
    pub model: String,
    pub method: String,
    /// What `value` is: `step_s`, `tolerance`, or an engine's own.
    pub setting: String,
    pub value: f64,
    /// Worst distance from the truth in x, y over the scene's samples, m; none
    /// where the run failed.
    pub error_m: Option<f64>,
    /// CPU microseconds per simulated second, minimum over repeats.
    pub cpu_us_per_s: Option<f64>,
    /// Median over minimum of the repeats.
    #[serde(default)]
    pub spread: Option<f64>,
    /// Why there is no error.
    #[serde(default)]
    pub note: Option<String>,
    /// No other of ours on this scene is both cheaper and nearer.
    #[serde(default)]
    pub front: bool,
    /// The accuracy asked for, m, where the program chose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked_m: Option<f64>,
    /// What choosing cost, CPU microseconds per simulated second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub choosing_us_per_s: Option<f64>,
}

impl Record {
    /// Cost and error where both are there.
    pub(super) fn point(&self) -> Option<(f64, f64)> {
        let finite = |value: Option<f64>| value.filter(|v| v.is_finite() && *v > 0.0);
        Some((finite(self.cpu_us_per_s)?, finite(self.error_m)?))
    }
}

/// What other engines measured, and their versions.
#[derive(Clone, Debug, Default)]
pub struct Peers {
    pub records: Vec<Record>,
    pub versions: Vec<(String, String)>,
}

/// The records and versions of a file that another engine's run wrote.
///
/// # Errors
/// [`ChartError::Peers`] naming the file.
pub fn read(path: &Path) -> Result<Peers, ChartError> {
    let failed = |reason: String| ChartError::Peers { path: path.to_owned(), reason };
    let bytes = std::fs::read(path).map_err(|e| failed(e.to_string()))?;
    let document: Document<Record> =
        serde_json::from_slice(&bytes).map_err(|e| failed(e.to_string()))?;
    let versions = document.versions.into_iter().filter(|(name, _)| name != "offbd");
    Ok(Peers { records: document.records, versions: versions.collect() })
}
