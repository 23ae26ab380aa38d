//! The certificate of a calibration: the expected false alarms of each monitor on the
//! healthy rig.
//!
//! In the T seconds that a monitor judged in the tests it came as close to an alarm as
//! the fraction s of what confirms one; it comes that close about once in T. How much
//! rarer an alarm is follows from the tail of its evidence. A rig does not show this tail
//! in minutes; it is taken from a population of simulated rigs that were watched for
//! hours (`offbd chart certificate` compares the result with other rigs).

use super::self_test::{PATIENCE, SelfTest};
use crate::diagnosis::{Calibration, MonitorCertificate, Settings};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::FaultCode;

/// Further evidence against a servo that makes an alarm e times rarer, nats: with it 58
/// simulated rigs promised 22 false alarms of servos in 232 h, and 24 came.
const TAIL_NATS: f64 = 1.4;
/// Further duration of failure that makes an alarm e times rarer, as a fraction of the
/// time that confirms. Assumed: on the same rigs alarms by duration did not depend on how
/// close the tests came.
const TAIL_SHARE: f64 = 0.1;
/// False alarms of the sensor per hour that tests of minutes do not show: outliers,
/// uneven time stamps and bounces that occur once in many hours; 28 came in 252 h of 63
/// simulated rigs.
const SENSOR_PER_HOUR: f64 = 0.1;
/// False alarms per hour of a ball that stands where it never stood before: on the same
/// rigs 1 came.
const STUCK_BALL_PER_HOUR: f64 = 0.01;

/// Returns the certificate of each monitor from the `tests` of what was `learnt`.
pub(super) fn of(
    learnt: &Calibration,
    tests: &[SelfTest],
) -> [MonitorCertificate; FaultCode::COUNT] {
    core::array::from_fn(|i| {
        let code = FaultCode::ALL[i];
        let judged_s: f64 = tests.iter().map(|t| t.nearest[i].1).sum();
        let timed = PATIENCE * tests.iter().map(|t| t.nearest[i].0).fold(0.0, f64::max);
        let (weighed, tail) = weighed(learnt, code);
        let nearest = timed.max(weighed).min(1.0);
        let alarms_per_hour = (judged_s > 0.0).then(|| {
            let seldom = ((1.0 - nearest) / tail).exp();
            3600.0 / judged_s / seldom + unforeseen_per_hour(code)
        });
        MonitorCertificate { judged_s, nearest, alarms_per_hour }
    })
}

/// Returns the closest approach of the evidence to what confirms a fault of a servo, and
/// the tail in the same unit.
fn weighed(learnt: &Calibration, code: FaultCode) -> (f64, f64) {
    let Some(axis) = code.axis() else { return (0.0, TAIL_SHARE) };
    let Some(axis) = learnt.axes[axis].as_ref() else { return (0.0, TAIL_SHARE) };
    let confirm_nats = Settings::default().confirming_nats(Some(axis));
    (axis.most_nats / confirm_nats, TAIL_NATS / confirm_nats)
}

/// False alarms per hour that tests of minutes do not show.
const fn unforeseen_per_hour(code: FaultCode) -> f64 {
    match code {
        FaultCode::Sensor => SENSOR_PER_HOUR,
        FaultCode::StuckBall => STUCK_BALL_PER_HOUR,
        FaultCode::XServo | FaultCode::YServo => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::session;
    use super::*;
    use crate::engine::Rig;
    use crate::engine::calibrate::calibrate;

    fn promised(seconds: f64) -> [MonitorCertificate; FaultCode::COUNT] {
        let learnt = calibrate(&Rig::chapter("a"), &[session(seconds, 0.03, 1.0)]);
        learnt.unwrap().certificate.unwrap()
    }

    #[test]
    fn what_was_tested_for_longer_promises_more() {
        let (short, long) = (promised(40.0), promised(160.0));
        for (i, code) in FaultCode::ALL.iter().enumerate() {
            assert!(short[i].judged_s > 10.0, "{code}: {:?}", short[i]);
            assert!(long[i].judged_s > 3.0 * short[i].judged_s, "{code}: {:?}", long[i]);
            assert!(long[i].alarms_per_hour < short[i].alarms_per_hour, "{code}: {long:?}");
        }
    }

    /// The twin's own path gives no evidence: hardly any false alarms are expected,
    /// except for the sensor.
    #[test]
    fn a_rig_that_obeys_the_twin_promises_no_alarms() {
        let promised = promised(120.0);
        for code in [FaultCode::XServo, FaultCode::YServo, FaultCode::StuckBall] {
            assert!(promised[code as usize].alarms_per_hour.unwrap() < 0.05, "{promised:?}");
        }
    }

    #[test]
    fn an_axis_that_is_missing_promises_nothing() {
        let mut samples = session(60.0, 0.03, 1.0);
        samples.iter_mut().for_each(|s| (s.cmd_qx_rad, s.y_m) = (None, None));
        let learnt = calibrate(&Rig::chapter("a"), &[samples]).unwrap();
        let promised = learnt.certificate.unwrap();
        assert_eq!(promised[FaultCode::YServo as usize].alarms_per_hour, None);
        assert!(promised[FaultCode::XServo as usize].alarms_per_hour.is_some());
    }
}
