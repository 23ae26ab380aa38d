//! What a calibration promises of each monitor, as it is stored and served.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use offbd_core::diagnosis::MonitorCertificate;
use offbd_core::vocabulary::{FaultCode, Invalid, in_range};

/// What the tests of a calibration showed of one monitor, on healthy recordings
/// that it had not learnt from, and how often it will alarm on the healthy rig.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MonitorCertificateView {
    /// Code of the faults that the monitor finds.
    pub code: String,
    /// Seconds of the recordings that it could judge, in [0, 1e9].
    #[schema(minimum = 0, maximum = 1e9)]
    pub judged_s: f64,
    /// The nearest it came to an alarm, in [0, 1]: 1 is what confirms a fault.
    #[schema(minimum = 0, maximum = 1)]
    pub nearest: f64,
    /// False alarms to expect per hour of operation, in [0, 1e6]; null where it
    /// judged nothing.
    #[schema(minimum = 0, maximum = 1e6)]
    pub alarms_per_hour: Option<f64>,
}

type Certificate = [MonitorCertificate; FaultCode::COUNT];

/// The views of a certificate, in the order of the codes.
pub(super) fn view(certificate: &Certificate) -> Vec<MonitorCertificateView> {
    let view = |(code, monitor): (&FaultCode, &MonitorCertificate)| MonitorCertificateView {
        code: code.to_string(),
        judged_s: monitor.judged_s,
        nearest: monitor.nearest,
        alarms_per_hour: monitor.alarms_per_hour,
    };
    FaultCode::ALL.iter().zip(certificate).map(view).collect()
}

/// The certificate that `views` describe; none without any. A code that is not
/// among them was not judged.
///
/// # Errors
/// [`Invalid`] naming the element under `/calibration/certificate`.
pub(super) fn certificate(
    views: &[MonitorCertificateView],
) -> Result<Option<Certificate>, Invalid> {
    let mut certificate = Certificate::default();
    for (i, view) in views.iter().enumerate() {
        let at = |field: &str| format!("/calibration/certificate/{i}/{field}");
        let code: FaultCode =
            view.code.parse().map_err(|e: offbd_core::vocabulary::UnknownWord| {
                Invalid::new(at("code"), e.to_string())
            })?;
        let rate = |rate: f64| in_range(&at("alarms_per_hour"), rate, 0.0..=1e6);
        certificate[code as usize] = MonitorCertificate {
            judged_s: in_range(&at("judged_s"), view.judged_s, 0.0..=1e9)?,
            nearest: in_range(&at("nearest"), view.nearest, 0.0..=1.0)?,
            alarms_per_hour: view.alarms_per_hour.map(rate).transpose()?,
        };
    }
    Ok((!views.is_empty()).then_some(certificate))
}
