//! A servo with properties that a data sheet omits: dead time, play, a level offset, and
//! faults.
//!
//! A fault changes the target of the servo or its speed; the dynamics remain those of
//! [`ServoModel`].

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use super::fault::{HornDrive, ServoFault};
use super::noise::Noise;
use offbd_core::plant::{ServoModel, ServoState};
use offbd_core::vocabulary::Invalid;

/// The true properties of one servo, unknown to its owner; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoTruth {
    /// Time from a command to the first movement, s.
    pub dead_time_s: f64,
    /// First-order lag, s.
    pub lag_s: f64,
    pub rate_limit_rad_s: f64,
    /// Plate angle per horn angle.
    pub gain: f64,
    /// Plate angle at a command of zero, rad.
    pub level_rad: f64,
    /// Total play between horn and plate, rad.
    pub play_rad: f64,
}

impl ServoTruth {
    /// Range of [`gain`](Self::gain); chosen.
    pub const GAIN: RangeInclusive<f64> = -10.0..=10.0;
    /// Range of [`level_rad`](Self::level_rad), rad; chosen.
    pub const LEVEL_RAD: RangeInclusive<f64> = -0.5..=0.5;
}

/// Angle, rate and acceleration of the plate about one axis, rad, rad/s, rad/s².
pub(super) type PlateAngle = ServoState;

/// Lag with which a slipped horn settles, s. Chosen: tens of milliseconds; an
/// instantaneous jump would act on the ball with an infinite angular acceleration.
const SLIP_LAG_S: f64 = 0.02;

/// Range of the uniformly distributed durations for which a loose contact closes and
/// opens, s; chosen.
const CONTACT_S: [f64; 2] = [0.3, 1.2];

/// A loose contact: whether it is closed, and until when.
#[derive(Clone, Debug)]
struct LooseContact {
    holds: bool,
    until_s: f64,
    noise: Noise,
}

impl LooseContact {
    /// Returns whether the contact is closed at `at_s`; it first opens at once.
    fn holds(&mut self, at_s: f64) -> bool {
        while at_s >= self.until_s {
            self.holds = !self.holds;
            self.until_s = at_s + self.noise.uniform(CONTACT_S[0], CONTACT_S[1]);
        }
        self.holds
    }
}

/// One servo and the plate angle it turns, with their state.
#[derive(Clone, Debug)]
pub(super) struct SimulatedServo {
    truth: ServoTruth,
    limit_rad: f64,
    commands: VecDeque<(f64, f64)>,
    horn: ServoState,
    slip: ServoState,
    linkage_rad: f64,
    contact: LooseContact,
}

impl SimulatedServo {
    pub(super) fn new(truth: ServoTruth, limit_rad: f64, noise: Noise) -> Result<Self, Invalid> {
        mechanics(truth.lag_s, truth.rate_limit_rad_s)?;
        let contact = LooseContact { holds: true, until_s: 0.0, noise };
        let (commands, horn, slip) =
            (VecDeque::new(), ServoState::default(), ServoState::default());
        Ok(Self { truth, limit_rad, commands, horn, slip, linkage_rad: 0.0, contact })
    }

    /// Queues a command given at `at_s`.
    pub(super) fn command(&mut self, at_s: f64, command: f64) {
        if self.commands.back().is_none_or(|&(_, last)| last != command) {
            self.commands.push_back((at_s, command));
        }
    }

    /// Advances by `h` seconds from `at_s` under `fault`; returns the plate's angle.
    pub(super) fn advance(&mut self, at_s: f64, h: f64, fault: Option<ServoFault>) -> PlateAngle {
        let command = self.in_force(at_s).clamp(-self.limit_rad, self.limit_rad);
        let contact = || self.contact.holds(at_s);
        let drive = fault.map_or(HornDrive::to(command), |fault| fault.drive(command, contact));
        self.turn_horn(h, &drive);
        if drive.slip != 0.0 || self.slip.angle != 0.0 {
            self.slip = settle(SLIP_LAG_S, f64::MAX).advance(&self.slip, drive.slip, h);
        }
        self.plate()
    }

    /// Returns the command that has passed the dead time, and drops older ones.
    fn in_force(&mut self, at_s: f64) -> f64 {
        let arrived = at_s - self.truth.dead_time_s;
        while self.commands.get(1).is_some_and(|&(from, _)| from <= arrived) {
            self.commands.pop_front();
        }
        self.commands.front().filter(|&&(from, _)| from <= arrived).map_or(0.0, |&(_, c)| c)
    }

    fn turn_horn(&mut self, h: f64, &HornDrive { target, slower, .. }: &HornDrive) {
        let (lag, rate) = (self.truth.lag_s * slower, self.truth.rate_limit_rad_s / slower);
        self.horn = match target {
            Some(target) => settle(lag, rate).advance(&self.horn, target, h),
            None => ServoState { angle: self.horn.angle, ..ServoState::default() },
        };
    }

    /// Moves the plate after the horn, with the play between them; returns its angle.
    fn plate(&mut self) -> PlateAngle {
        let truth = &self.truth;
        let wanted = truth.gain * self.horn.angle + self.slip.angle;
        let play = truth.play_rad / 2.0;
        let before = self.linkage_rad;
        self.linkage_rad = before.clamp(wanted - play, wanted + play);
        let pushed = self.linkage_rad != before || play == 0.0;
        let moving = |horn: f64, slip: f64| if pushed { truth.gain * horn + slip } else { 0.0 };
        PlateAngle {
            angle: self.linkage_rad + truth.level_rad,
            rate: moving(self.horn.rate, self.slip.rate),
            acceleration: moving(self.horn.acceleration, self.slip.acceleration),
        }
    }
}

/// Limit of the horn angle, rad. Chosen: the stops of a hobby servo are far outside the
/// controller's commands.
const STOP_RAD: f64 = std::f64::consts::FRAC_PI_2;

fn mechanics(lag_s: f64, rate_limit_rad_s: f64) -> Result<ServoModel, Invalid> {
    ServoModel::new(STOP_RAD, lag_s, rate_limit_rad_s)
}

/// Returns a servo model with its parameters clamped to the valid range.
fn settle(lag_s: f64, rate_limit_rad_s: f64) -> ServoModel {
    let model = mechanics(lag_s.clamp(0.0, 10.0), rate_limit_rad_s.clamp(1e-3, 1000.0));
    model.unwrap_or_else(|_| unreachable!("both numbers are in range"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::noise::Purpose;

    const TRUTH: ServoTruth = ServoTruth {
        dead_time_s: 0.05,
        lag_s: 0.02,
        rate_limit_rad_s: 100.0,
        gain: 1.0,
        level_rad: 0.01,
        play_rad: 0.0,
    };

    /// Returns the plate's angle one second after a command of 0.1 rad.
    fn after_a_second(truth: ServoTruth, fault: Option<ServoFault>) -> f64 {
        let noise = Noise::new(1, Purpose::ServoX);
        let mut servo = SimulatedServo::new(truth, 0.2, noise).unwrap();
        servo.command(0.0, 0.1);
        (0..1000).map(|i| servo.advance(f64::from(i) * 1e-3, 1e-3, fault).angle).last().unwrap()
    }

    #[test]
    fn each_fault_leaves_its_angle() {
        let settled = |fault| after_a_second(TRUTH, fault) - TRUTH.level_rad;
        let close = |got: f64, wanted: f64| (got - wanted).abs() < 1e-9;
        assert!(close(settled(None), 0.1));
        assert!(close(settled(Some(ServoFault::Hold)), 0.0));
        assert!(close(settled(Some(ServoFault::Dead)), 0.0));
        assert!(close(settled(Some(ServoFault::Gain(0.4))), 0.04));
        assert!(close(settled(Some(ServoFault::Reversed)), -0.1));
        assert!(close(settled(Some(ServoFault::Offset(0.05))), 0.15));
        let slow = settled(Some(ServoFault::Slow(20.0)));
        let expected = 0.1 * (1.0 - (-0.95_f64 / 0.4).exp());
        assert!(close(slow, expected), "{slow} is not {expected}");
    }

    #[test]
    fn play_is_lost_before_the_plate_follows() {
        let loose = ServoTruth { play_rad: 0.02, ..TRUTH };
        let angle = after_a_second(loose, None);
        assert!((angle - (0.1 - 0.01 + 0.01)).abs() < 1e-9, "{angle}");
    }

    #[test]
    fn a_loose_contact_fails_and_recovers() {
        let mut contact =
            LooseContact { holds: true, until_s: 0.0, noise: Noise::new(3, Purpose::ServoX) };
        let held: Vec<bool> = (0..60).map(|i| contact.holds(f64::from(i) * 0.1)).collect();
        assert!(!held[0] && held.contains(&true));
    }
}
