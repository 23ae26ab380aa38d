//! Estimators of acceleration: error against delay and cost.

use super::{Chart, ChartError, Effort, Table};

/// Measures and draws.
///
/// # Errors
/// If a record is no JSON.
pub fn make(_effort: Effort) -> Result<Chart, ChartError> {
    Ok(Chart {
        name: "estimators",
        records: Vec::new(),
        figures: Vec::new(),
        table: Table::default(),
        versions: Vec::new(),
    })
}
