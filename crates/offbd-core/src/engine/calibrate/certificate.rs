//! The certificate of a calibration: the false alarms to expect of each monitor on the healthy
//! rig.
//!
//! Some rigs alarm again and again, most never do. The rate of a monitor therefore follows a gamma
//! distribution over the rigs of a population, with mean μ and shape k, fitted to simulated rigs
//! that were watched for hours. A rig without an alarm in the T hours of its tests has, by Bayes'
//! rule (Gelman et al. 2013, 2.6), a rate of the same shape with the mean k/(k/μ + T). The rate
//! that nine of ten such rigs stay below is a fixed multiple of this mean. Minutes of tests say
//! little more than the population; hours without an alarm say that the rig is a quiet one. Tests
//! that gave an alarm at first, because of which limits were widened or moments left out, say
//! nothing. `offbd chart certificate` compares this with other rigs.

use super::self_test::{PATIENCE, SelfTest};
use crate::diagnosis::{Calibration, MonitorCertificate, Settings};
use crate::vocabulary::FaultCode;

/// Shape of the distribution of the rates over rigs. Chosen from the 95 % intervals on the rigs below:
/// 0.02 to 0.1 of the servos (with an earlier rule, which gave more alarms), 0.01 to 0.08 of the ball,
/// 0.02 to 0.14 of the sensor. A smaller one states a lower limit.
const SHAPE: f64 = 0.1;
/// The 90 % quantile over the mean, of a gamma distribution with [`SHAPE`].
const MOST_OVER_MEAN: f64 = 2.661_545;
/// False alarms of a servo per hour: 3 came of 87 servos of 47 simulated rigs in 2 h each. On these
/// rigs the evidence that the path needs was chosen.
const SERVO_PER_HOUR: f64 = 0.017;
/// False alarms of the ball per hour: 9 came on 82 simulated rigs in 234 h.
const STUCK_BALL_PER_HOUR: f64 = 0.04;
/// False alarms of the sensor per hour: 18 came on 81 of these rigs in 230 h. The other rig is left
/// out: its sensor holds a reading until the ball has moved by 5 mm, and 173 came in 4 h.
const SENSOR_PER_HOUR: f64 = 0.08;

/// Mean of the rates over the population, per hour.
const fn mean_per_hour(code: FaultCode) -> f64 {
    match code {
        FaultCode::XServo | FaultCode::YServo => SERVO_PER_HOUR,
        FaultCode::StuckBall => STUCK_BALL_PER_HOUR,
        FaultCode::Sensor => SENSOR_PER_HOUR,
    }
}

/// Mean of the rates over the rigs that gave no alarm in `judged_s`, per hour.
fn mean_after(judged_s: f64, code: FaultCode) -> f64 {
    SHAPE / (SHAPE / mean_per_hour(code) + judged_s / 3600.0)
}

/// Returns the certificate of each monitor from the `tests` of what was `learnt`; `quiet` says whether
/// they gave no alarm from the first on.
pub(super) fn of(
    learnt: &Calibration,
    tests: &[SelfTest],
    quiet: bool,
) -> [MonitorCertificate; FaultCode::COUNT] {
    core::array::from_fn(|i| {
        let code = FaultCode::ALL[i];
        let judged_s: f64 = tests.iter().map(|t| t.nearest[i].1).sum();
        let timed = PATIENCE * tests.iter().map(|t| t.nearest[i].0).fold(0.0, f64::max);
        let nearest = timed.max(weighed(learnt, code)).min(1.0);
        let quiet_s = if quiet { judged_s } else { 0.0 };
        let alarms_per_hour = (judged_s > 0.0).then(|| mean_after(quiet_s, code));
        let most_alarms_per_hour = alarms_per_hour.map(|mean| MOST_OVER_MEAN * mean);
        MonitorCertificate { judged_s, nearest, alarms_per_hour, most_alarms_per_hour }
    })
}

/// Returns the closest approach of the evidence to what confirms a fault of a servo.
fn weighed(learnt: &Calibration, code: FaultCode) -> f64 {
    let axis = code.axis().and_then(|axis| learnt.axes[axis].as_ref());
    axis.map_or(0.0, |axis| axis.most_nats / Settings::default().confirming_nats(Some(axis)))
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

    /// Minutes of tests hardly lower the rate of the population, and hours not below the rate of a
    /// tenth of an alarm in as much time.
    #[test]
    fn no_more_is_promised_than_was_tested() {
        for &code in FaultCode::ALL {
            let promised = |hours: f64| mean_after(3600.0 * hours, code);
            assert!((promised(0.0) / mean_per_hour(code) - 1.0).abs() < 1e-12, "{code}");
            assert!(promised(0.05) > 0.9 * mean_per_hour(code), "{code}");
            assert!((promised(1e6) * 1e6 / SHAPE - 1.0).abs() < 1e-3, "{code}");
        }
    }

    /// The quantile against the gamma distribution itself, integrated over the logarithm of the
    /// rate.
    #[test]
    fn nine_of_ten_rigs_stay_below_the_quantile() {
        let mass_below = |most: f64| {
            let (low, n) = (-50.0 / SHAPE, 100_000);
            let step = (most.ln() - low) / f64::from(n);
            let density = |i: u32| {
                let log = low + step * (f64::from(i) + 0.5);
                (SHAPE * (log - log.exp())).exp()
            };
            step * (0..n).map(density).sum::<f64>()
        };
        let share = mass_below(MOST_OVER_MEAN) / mass_below(50.0 / SHAPE);
        assert!((share - 0.9).abs() < 1e-4, "{share}");
    }

    #[test]
    fn an_axis_that_is_missing_promises_nothing() {
        let mut samples = session(60.0, 0.03, 1.0);
        samples.iter_mut().for_each(|s| (s.cmd_qx_rad, s.y_m) = (None, None));
        let learnt = calibrate(&Rig::chapter("a"), &[samples]).unwrap();
        let promised = learnt.certificate.unwrap();
        assert_eq!(promised[FaultCode::YServo as usize].alarms_per_hour, None);
        assert_eq!(promised[FaultCode::YServo as usize].most_alarms_per_hour, None);
        assert!(promised[FaultCode::XServo as usize].alarms_per_hour.is_some());
    }
}
