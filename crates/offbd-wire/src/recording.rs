//! A part of a session, row by row: the recorded samples and what was judged.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::words::CodeWord;

use offbd_core::diagnosis::{AxisEvidence, Evidence};
use offbd_core::vocabulary::Sample;

/// The seconds around the last occurrence of a fault.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct RecordingView {
    pub asset: String,
    pub code: CodeWord,
    /// The session's name.
    pub session: String,
    /// The service's id of the session.
    pub session_id: String,
    /// Estimated time at which the deviation began, s on the device's clock, like all times
    /// here; null if unknown.
    pub onset_s: Option<f64>,
    /// Time at which the test failed, s.
    pub failed_s: f64,
    /// Time at which the fault was confirmed, s; null if it never was.
    pub confirmed_s: Option<f64>,
    /// Start of the requested interval, s.
    pub from_s: f64,
    /// End of the requested interval, s.
    pub to_s: f64,
    /// Whether the interval is complete: false while the session is open and samples of the
    /// interval may still arrive.
    pub complete: bool,
    /// Id of the calibration that was used; null if the rig was not calibrated.
    pub calibration_id: Option<String>,
    /// Id of the profile, settings and rig description that were used.
    pub settings_id: String,
    /// One entry for each sample, in order of time.
    pub columns: RecordingColumnsView,
}

macro_rules! columns {
    ($($(#[$doc:meta])* $name:ident: $kind:ty),+ $(,)?) => {
        /// One sample and the quantities judged at it. These are `None` if the sample was
        /// not judged because it was too late or no time had passed.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
        pub struct RecordingRow { $($(#[$doc])* pub $name: $kind),+ }

        /// The columns of a recording, all of the same length. Judged quantities are null if
        /// the sample was not judged.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
        pub struct RecordingColumnsView { $($(#[$doc])* pub $name: Vec<$kind>),+ }

        impl RecordingColumnsView {
            /// Returns the columns of `rows`.
            #[must_use]
            pub fn of(rows: &[RecordingRow]) -> Self {
                Self { $($name: rows.iter().map(|row| row.$name).collect()),+ }
            }
        }
    };
}

columns! {
    /// Time, s on the device's clock.
    t_s: f64,
    /// Command of the plate angle about x, as the device sent it.
    cmd_qx_rad: Option<f64>,
    /// Command of the plate angle about y, as the device sent it.
    cmd_qy_rad: Option<f64>,
    /// Position along x, as the device sent it.
    x_m: Option<f64>,
    /// Position along y, as the device sent it.
    y_m: Option<f64>,
    /// Measured acceleration along x over the window, m/s².
    x_measured_m_s2: Option<f64>,
    /// The twin's acceleration along x through the same filter, m/s².
    x_twin_m_s2: Option<f64>,
    /// Residual along x: measured minus the twin's acceleration, m/s².
    x_residual_m_s2: Option<f64>,
    /// Limit of the residual along x, m/s².
    x_limit_m_s2: Option<f64>,
    /// Whether the enable condition held along x.
    x_enabled: Option<bool>,
    /// Measured acceleration along y over the window, m/s².
    y_measured_m_s2: Option<f64>,
    /// The twin's acceleration along y through the same filter, m/s².
    y_twin_m_s2: Option<f64>,
    /// Residual along y: measured minus the twin's acceleration, m/s².
    y_residual_m_s2: Option<f64>,
    /// Limit of the residual along y, m/s².
    y_limit_m_s2: Option<f64>,
    /// Whether the enable condition held along y.
    y_enabled: Option<bool>,
}

impl RecordingRow {
    /// Returns the row of `sample`, with the quantities of `evidence` if it was judged.
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

/// Writes the rows as CSV with a header of the column names.
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
