//! What a calibration promises: how often each monitor will alarm on the healthy
//! rig.
//!
//! In the T seconds that a monitor judged in the tests it came as near to an alarm
//! as the share s of what confirms one: it comes that near about once in T. How
//! much more seldom it comes all the way is the tail of its evidence. That no rig
//! shows in minutes; it is taken from the population, rigs that were drawn and
//! watched for hours: `offbd chart certificate` holds it against others.

use super::proof::PATIENCE;
use super::self_test::SelfTest;
use crate::diagnosis::{Calibration, MonitorCertificate, Settings};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::FaultCode;

/// By how much more evidence against a servo comes e times more seldom, nats: with
/// it 58 drawn rigs promised 22 false alarms of servos in 232 h, and 24 came.
const TAIL_NATS: f64 = 1.4;
/// The same for what fails by its time, as a share of the time that confirms. Assumed:
/// on the same rigs alarms of such monitors did not go with how near the tests came.
const TAIL_SHARE: f64 = 0.1;
/// False alarms per hour that no test of some minutes shows. Of the sensor: outliers,
/// uneven stamps and bounces that come once in many hours; 28 came in 252 h of 63 drawn
/// rigs.
const SENSOR_PER_HOUR: f64 = 0.1;
/// Of the ball, one that stands where it never stood before: on the same rigs 1 came.
const STUCK_BALL_PER_HOUR: f64 = 0.01;

/// The certificate of each monitor by the `tests` of what was `learnt`.
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

/// The nearest that evidence against a servo came to what confirms a fault of it,
/// and the tail in the same measure.
fn weighed(learnt: &Calibration, code: FaultCode) -> (f64, f64) {
    let Some(axis) = code.axis() else { return (0.0, TAIL_SHARE) };
    let Some(axis) = learnt.axes[axis].as_ref() else { return (0.0, TAIL_SHARE) };
    let confirm_nats = Settings::default().confirming_nats(Some(axis));
    (axis.most_nats / confirm_nats, TAIL_NATS / confirm_nats)
}

/// What no test of a few minutes shows.
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
        let learnt = calibrate(&Rig::chapter("a"), &[session(seconds, 0.03, 1.0)], "", "");
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

    /// The twin's own path leaves nothing to blame: what is promised is next to
    /// nothing, but for the sensor.
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
        let learnt = calibrate(&Rig::chapter("a"), &[samples], "", "").unwrap();
        let promised = learnt.certificate.unwrap();
        assert_eq!(promised[FaultCode::YServo as usize].alarms_per_hour, None);
        assert!(promised[FaultCode::XServo as usize].alarms_per_hour.is_some());
    }
}
