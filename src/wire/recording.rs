//! A stretch of a session as it was recorded and as it was judged, row by row.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use offbd_core::diagnosis::{AxisEvidence, Evidence};
use offbd_core::vocabulary::Sample;

/// The seconds around the last occurrence of a fault.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct RecordingView {
    pub asset: String,
    pub code: String,
    /// The session's name.
    pub session: String,
    /// The service's id of the session.
    pub session_id: String,
    /// When the deviation began, as far as the evidence says, s on the
    /// device's clock, as all times here.
    pub onset_s: Option<f64>,
    /// When the test failed.
    pub failed_s: f64,
    /// When the fault was confirmed; null if it never was.
    pub confirmed_s: Option<f64>,
    /// The stretch that was asked for.
    pub from_s: f64,
    pub to_s: f64,
    /// Whether the session has come to its end: false while samples of an open
    /// session may still come.
    pub complete: bool,
    /// Of the calibration that judged; null on a rig not learnt.
    pub calibration_id: Option<String>,
    /// Of the profile, the settings and the rig's description that judged.
    pub settings_id: String,
    /// One entry for each sample, in order of time.
    pub columns: ColumnsView,
}

macro_rules! columns {
    ($($(#[$doc:meta])* $name:ident: $kind:ty),+ $(,)?) => {
        /// One sample and what was judged of it. Empty where it was not judged:
        /// too late, or no time has passed.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
        pub struct RecordingRow { $($(#[$doc])* pub $name: $kind),+ }

        /// The columns of a recording; null where a sample was not judged.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
        pub struct ColumnsView { $($(#[$doc])* pub $name: Vec<$kind>),+ }

        impl ColumnsView {
            /// The columns of `rows`.
            #[must_use]
            pub fn of(rows: &[RecordingRow]) -> Self {
                Self { $($name: rows.iter().map(|row| row.$name).collect()),+ }
            }
        }
    };
}

columns! {
    /// s on the device's clock.
    t_s: f64,
    /// As the device sent it.
    cmd_qx_rad: Option<f64>,
    cmd_qy_rad: Option<f64>,
    x_m: Option<f64>,
    y_m: Option<f64>,
    /// Measured acceleration along x over the window, m/s².
    x_measured_m_s2: Option<f64>,
    /// The twin's through the same filter, m/s².
    x_twin_m_s2: Option<f64>,
    /// Measured − twin, m/s².
    x_residual_m_s2: Option<f64>,
    /// Residual limit in force, m/s².
    x_limit_m_s2: Option<f64>,
    /// Whether the residual might be judged (the gate).
    x_enabled: Option<bool>,
    /// The same along y.
    y_measured_m_s2: Option<f64>,
    y_twin_m_s2: Option<f64>,
    y_residual_m_s2: Option<f64>,
    y_limit_m_s2: Option<f64>,
    y_enabled: Option<bool>,
}

impl RecordingRow {
    /// The row of `sample`, judged on `evidence`.
    #[must_use]
    pub fn new(sample: &Sample, evidence: Option<&Evidence>) -> Self {
        let axis = |of: fn(&Evidence) -> &AxisEvidence| evidence.map(of);
        let (x, y) = (axis(|e| &e.axes.x), axis(|e| &e.axes.y));
        Self {
            t_s: sample.t_s,
            cmd_qx_rad: sample.cmd_qx_rad,
            cmd_qy_rad: sample.cmd_qy_rad,
            x_m: sample.x_m,
            y_m: sample.y_m,
            x_measured_m_s2: x.and_then(|e| e.measured_m_s2),
            x_twin_m_s2: x.and_then(|e| e.twin_m_s2),
            x_residual_m_s2: x.and_then(AxisEvidence::residual_m_s2),
            x_limit_m_s2: x.map(|e| e.limit_m_s2),
            x_enabled: x.map(|e| e.enabled),
            y_measured_m_s2: y.and_then(|e| e.measured_m_s2),
            y_twin_m_s2: y.and_then(|e| e.twin_m_s2),
            y_residual_m_s2: y.and_then(AxisEvidence::residual_m_s2),
            y_limit_m_s2: y.map(|e| e.limit_m_s2),
            y_enabled: y.map(|e| e.enabled),
        }
    }
}

/// The rows as CSV, with a header that has the names of the columns.
///
/// # Errors
/// [`csv::Error`] if `writer` fails.
pub fn write_csv(writer: impl std::io::Write, rows: &[RecordingRow]) -> Result<(), csv::Error> {
    let mut csv = csv::Writer::from_writer(writer);
    for row in rows {
        csv.serialize(row)?;
    }
    Ok(csv.flush()?)
}
