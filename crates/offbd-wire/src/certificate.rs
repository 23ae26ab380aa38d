//! The certificate of a calibration: expected false alarms of each monitor.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::words::CodeWord;
use offbd_core::diagnosis::MonitorCertificate;
use offbd_core::vocabulary::{FaultCode, Invalid, in_range};

/// Test result of one monitor on healthy recordings that the calibration did not learn
/// from, and the false alarms to expect on the healthy rig.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MonitorCertificateView {
    /// Fault code of the monitor.
    pub code: CodeWord,
    /// Time of the recordings for which the monitor could judge, s, in [0, 1e9].
    #[schema(minimum = 0, maximum = 1e9)]
    pub judged_s: f64,
    /// Closest approach to an alarm, in [0, 1]: 1 would confirm a fault.
    #[schema(minimum = 0, maximum = 1)]
    pub nearest: f64,
    /// Expected false alarms per hour of operation, in [0, 1e6]: the mean over rigs like this
    /// one; null if the monitor could not judge.
    #[schema(minimum = 0, maximum = 1e6)]
    pub alarms_per_hour: Option<f64>,
    /// False alarms per hour that nine of ten such rigs stay below, in [0, 1e6]; null if
    /// unknown, as in calibrations of earlier versions.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1e6)]
    pub most_alarms_per_hour: Option<f64>,
}

type Certificate = [MonitorCertificate; FaultCode::COUNT];

/// Returns the views of a certificate, in the order of the codes.
pub(super) fn view(certificate: &Certificate) -> Vec<MonitorCertificateView> {
    let view = |(&code, monitor): (&FaultCode, &MonitorCertificate)| MonitorCertificateView {
        code: code.into(),
        judged_s: monitor.judged_s,
        nearest: monitor.nearest,
        alarms_per_hour: monitor.alarms_per_hour,
        most_alarms_per_hour: monitor.most_alarms_per_hour,
    };
    FaultCode::ALL.iter().zip(certificate).map(view).collect()
}

/// Returns the certificate that `views` describe, or `None` if there are none. A code that
/// is missing was not judged.
///
/// # Errors
/// [`Invalid`] naming the element under `/calibration/certificate`.
pub(super) fn certificate(
    views: &[MonitorCertificateView],
) -> Result<Option<Certificate>, Invalid> {
    let mut certificate = Certificate::default();
    for (i, view) in views.iter().enumerate() {
        let at = |field: &str| format!("/calibration/certificate/{i}/{field}");
        let rate = |field: &str, rate: Option<f64>| {
            rate.map(|rate| in_range(&at(field), rate, 0.0..=1e6)).transpose()
        };
        certificate[FaultCode::from(view.code) as usize] = MonitorCertificate {
            judged_s: in_range(&at("judged_s"), view.judged_s, 0.0..=1e9)?,
            nearest: in_range(&at("nearest"), view.nearest, 0.0..=1.0)?,
            alarms_per_hour: rate("alarms_per_hour", view.alarms_per_hour)?,
            most_alarms_per_hour: rate("most_alarms_per_hour", view.most_alarms_per_hour)?,
        };
    }
    Ok((!views.is_empty()).then_some(certificate))
}
