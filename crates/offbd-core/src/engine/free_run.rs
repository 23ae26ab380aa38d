//! A free run: the twin alone under the commands of a recording, which says what the model would
//! do with them.
//!
//! The engine moves its twin to the measured ball again and again; here the twin sees the ball
//! once, at the start, and then only the commands.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

use super::frame::{Moment, moment};
use super::{Setup, rejection};
use crate::plant::{Ladder, RollingState, SimulatedTwin, TwinModel};
use crate::vocabulary::{Invalid, PerAxis, Sample, SimTime, in_range};

/// Longest free run, s: a day; chosen to bound the computing time.
pub const LONGEST_FREE_RUN_S: f64 = 86_400.0;

/// The twin at the time of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeRunPoint {
    pub at: SimTime,
    /// The ball of the twin.
    pub ball: RollingState,
    /// The angle of the plate that each servo turns, rad.
    pub plate: PerAxis<f64>,
    /// The measured position of the ball, m.
    pub measured: PerAxis<Option<f64>>,
}

/// Returns the motion of the twin of `setup` under the commands of `samples`, in steps of at most
/// `longest_step_s`, which is in [`SimulatedTwin::STEPS_S`].
///
/// At the first sample both servos stand on its commands, and the ball is at rest where it was
/// measured; an unknown command or coordinate is 0. A command holds until the next. Samples that
/// an engine would reject are left out, and those that are not later than the one before.
///
/// # Errors
/// [`Invalid`] naming the step, or `/t_s` if the samples span more than [`LONGEST_FREE_RUN_S`].
pub fn free_run(
    setup: &Setup,
    samples: &[Sample],
    longest_step_s: f64,
) -> Result<Vec<FreeRunPoint>, Invalid> {
    in_range("/longest_step", longest_step_s, SimulatedTwin::STEPS_S)?;
    let usable = samples.iter().filter(|sample| rejection(&setup.rig, sample).is_none());
    let mut moments = usable.filter_map(|sample| moment(&setup.rig.mapping, sample));
    let Some(first) = moments.next() else { return Ok(Vec::new()) };
    let mut twin = start(setup, &first);
    let mut points = vec![point(&twin, &first)];
    let mut last = first.at;
    for moment in moments {
        if moment.at <= last {
            continue;
        }
        if moment.at - first.at > LONGEST_FREE_RUN_S {
            let reason = format!("the samples span more than {LONGEST_FREE_RUN_S} s");
            return Err(Invalid::new("/t_s", reason));
        }
        twin.advance(moment.at, longest_step_s);
        twin.command(moment.command);
        points.push(point(&twin, &moment));
        last = moment.at;
    }
    Ok(points)
}

fn start(setup: &Setup, first: &Moment) -> SimulatedTwin {
    let rig = &setup.rig;
    let (friction, accuracy) = (rig.contact.friction(), SimulatedTwin::ACCURACY_M_S2);
    let ladder = Ladder::new(&rig.ball, &rig.plate, friction, accuracy);
    let model = TwinModel { ladder, axes: setup.twin.axes };
    let PerAxis { x, y } = first.position.map(Option::unwrap_or_default);
    let ball = RollingState { position: [x, y].into(), ..RollingState::default() };
    SimulatedTwin::start(model, first.at, first.command.map(Option::unwrap_or_default), &ball)
}

fn point(twin: &SimulatedTwin, moment: &Moment) -> FreeRunPoint {
    let (at, measured) = (moment.at, moment.position);
    FreeRunPoint { at, ball: twin.ball(), plate: twin.plate(), measured }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Rig;

    const STEP_S: f64 = 2e-3;

    fn rig() -> Rig {
        let mut rig = Rig::chapter("chapter");
        (rig.servo.lag_s, rig.servo.dead_time_s) = (0.05, 0.02);
        rig
    }

    fn run(rig: Rig, samples: &[Sample]) -> Result<Vec<FreeRunPoint>, Invalid> {
        free_run(&Setup::new(rig, None).unwrap(), samples, STEP_S)
    }

    fn commanded(t_s: f64, qy: f64) -> Sample {
        Sample { t_s, cmd_qx_rad: Some(0.0), cmd_qy_rad: Some(qy), ..Sample::default() }
    }

    /// The plate turns by the lag's exponential after the dead time; then the ball rolls with
    /// 5/7·g·sin q.
    #[test]
    fn validate_a_step_of_the_command() {
        let samples: Vec<Sample> = (0..=200)
            .map(|i| commanded(f64::from(i) * 0.01, if i < 10 { 0.0 } else { 0.1 }))
            .collect();
        let points = run(rig(), &samples).unwrap();
        assert_eq!(points.len(), samples.len());
        let after_s = 0.15 - 0.1 - 0.02;
        let wanted = 0.1 * (1.0 - (-after_s / 0.05_f64).exp());
        assert!((points[15].plate.x - wanted).abs() < 1e-12, "{}", points[15].plate.x);
        let gained = points[200].ball.velocity.x - points[150].ball.velocity.x;
        let wanted = 0.5 * 5.0 / 7.0 * 9.81 * 0.1_f64.sin();
        assert!((gained - wanted).abs() < 1e-9, "{gained} is not {wanted}");
    }

    /// The device's degrees, centimetres and axes are those of the plate first.
    #[test]
    fn the_numbers_of_a_device_are_converted() {
        let mut device = rig();
        device.mapping.command_unit_rad = 0.01;
        device.mapping.position_unit_m = 0.01;
        device.mapping.swap = true;
        let row = |t_s: f64, unit: f64| Sample { y_m: Some(unit), ..commanded(t_s, 10.0) };
        let plain = |t_s: f64| Sample { x_m: Some(0.03), ..commanded(t_s, 0.1) };
        let of_device = run(device, &[row(0.0, 3.0), row(1.0, 3.0)]).unwrap();
        let of_plate = run(rig(), &[plain(0.0), plain(1.0)]).unwrap();
        let apart = of_device[1].ball.position - of_plate[1].ball.position;
        assert!(apart.norm() < 1e-12, "{apart}");
        assert_eq!(of_device[0].ball.position.x, 0.03);
    }

    #[test]
    fn a_command_holds_until_the_next_and_unusable_samples_are_left_out() {
        let none = |t_s: f64| Sample { t_s, ..Sample::default() };
        let kept = [commanded(0.0, 0.0), commanded(0.1, 0.1), none(0.2), none(0.3)];
        let bad = [commanded(0.1, -0.2), commanded(0.05, -0.2), commanded(0.2, f64::NAN)];
        let mut mixed = kept[..2].to_vec();
        mixed.extend(bad);
        mixed.extend_from_slice(&kept[2..]);
        let points = run(rig(), &mixed).unwrap();
        assert_eq!(points, run(rig(), &kept).unwrap());
        assert!(points.len() == 4 && points[3].plate.x > 0.09, "{points:?}");
        assert_eq!(run(rig(), &[]), Ok(Vec::new()));
    }

    #[test]
    fn a_clock_that_jumps_by_years_is_refused() {
        let error = run(rig(), &[commanded(0.0, 0.0), commanded(1e9, 0.0)]).unwrap_err();
        assert_eq!(error.to_string(), "/t_s: the samples span more than 86400 s");
    }
}
