//! `labels.json` of a labelled corpus: the true fault of each session.

use std::path::Path;

use serde::{Deserialize, Serialize};

use offbd_lab::simulation::{FaultEffect, FaultTruth};
use offbd_terminal::errors::{InputError, read};

/// The label of one session.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Label {
    /// Path within the corpus, `RIG/SESSION.csv`.
    pub file: String,
    pub rig: String,
    #[serde(default)]
    pub motion: String,
    pub seconds: f64,
    pub rows: u64,
    /// `healthy`, or the code of the fault.
    pub class: String,
    /// Further codes that count as correct, because the readings cannot distinguish them.
    #[serde(default)]
    pub also: Vec<String>,
    pub fault: Option<LabelledFault>,
}

/// The fault of a session.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct LabelledFault {
    pub kind: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<serde_json::Value>,
    pub onset_s: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_s: Option<f64>,
    /// Time at which it first became detectable, s; null: never.
    pub chance_s: Option<f64>,
}

impl Label {
    /// Returns whether the session is for calibration, not to be judged.
    pub(super) fn is_calibration(&self) -> bool {
        self.file.ends_with("calibration.csv")
    }
}

/// Returns the class of a session with this fault.
pub(super) fn class(fault: Option<&FaultTruth>) -> String {
    fault.map_or_else(|| "healthy".to_owned(), |f| f.fault.effect.code().to_string())
}

/// Returns the label of a simulated fault, with times rounded to the millisecond.
pub(super) fn labelled(truth: &FaultTruth) -> LabelledFault {
    let effect: &FaultEffect = &truth.fault.effect;
    let size = effect.size().map(|size| match size.as_slice() {
        [one] => serde_json::json!(one),
        several => serde_json::json!(several),
    });
    let milli = |s: f64| (s * 1e3).round() / 1e3;
    LabelledFault {
        kind: effect.kind().to_owned(),
        axis: effect.axis().map(|a| a.as_str().to_owned()),
        size,
        onset_s: milli(truth.fault.onset_s),
        end_s: truth.fault.end_s.map(milli),
        chance_s: truth.chance_s.map(milli),
    }
}

/// Reads the labels of the corpus in `dir`.
pub(super) fn load(dir: &Path) -> Result<Vec<Label>, InputError> {
    let path = dir.join("labels.json");
    serde_json::from_slice(&read(&path)?).map_err(|e| InputError::file(&path, e))
}
