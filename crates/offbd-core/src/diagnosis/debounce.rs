//! Debouncing by time: a fault detection counter from −128 to 127.
//!
//! Prefailed raises the counter (jumping up to zero first), prepassed lowers it, at rates
//! that take `fail_s` and `pass_s` from zero to either end. Prepassed does not jump down
//! to zero but takes `leak_s` from the upper end: the residual of a ball that a faulty
//! servo swings to and fro crosses zero twice a period, and a loose contact comes and
//! goes. While the enable condition does not hold the counter is frozen. Rates are per
//! second, not per judgement, so that they do not depend on the sample rate.

use super::Settings;
use crate::vocabulary::{FaultCode, FaultKind};
use serde::{Deserialize, Serialize};

/// The result of a monitor at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Test {
    /// The enable condition does not hold: neither passed nor failed.
    #[default]
    NotTested,
    Prepassed,
    Prefailed,
}

/// The debounce times of one monitor, s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DebounceTimes {
    /// Time of failure from zero to the upper end.
    pub fail_s: f64,
    /// Further time of failure until it counts as a trip.
    pub confirm_s: f64,
    /// Time of agreement from zero to the lower end.
    pub pass_s: f64,
    /// Time of agreement from the upper end to zero.
    pub leak_s: f64,
}

impl DebounceTimes {
    /// Returns the times for `code`. Servos have a slow leak, because a loose contact
    /// comes and goes. Readings and ball fail sooner. A ball that stands fails as soon as
    /// readings do on a learnt rig, unless time `may_decide` between it and another cause with
    /// the same symptoms. Of the sensor's kinds of fault, noise has
    /// its own time.
    #[must_use]
    pub fn of(
        code: FaultCode,
        kind: Option<FaultKind>,
        may_decide: bool,
        settings: &Settings,
    ) -> Self {
        let Settings { fail_s, confirm_s, pass_s, .. } = *settings;
        match code {
            FaultCode::XServo | FaultCode::YServo => {
                Self { fail_s, confirm_s, pass_s, leak_s: settings.leak_s }
            }
            FaultCode::StuckBall if may_decide || !settings.learnt => {
                Self { fail_s, confirm_s, pass_s, leak_s: pass_s }
            }
            FaultCode::StuckBall | FaultCode::Sensor => Self {
                fail_s: match kind {
                    Some(FaultKind::Noise) => settings.noise_fail_s,
                    _ => settings.readings_fail_s,
                },
                confirm_s: settings.readings_confirm_s,
                pass_s,
                leak_s: pass_s,
            },
        }
    }
}

impl DebounceTimes {
    /// Returns the time that a persistent failure of `code` without a rival cause takes
    /// to be confirmed, s: debounce plus confirmation.
    #[must_use]
    pub fn needed_s(code: FaultCode, settings: &Settings) -> f64 {
        let Self { fail_s, confirm_s, .. } = Self::of(code, None, false, settings);
        fail_s + confirm_s
    }
}

/// The result of debouncing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Qualified {
    /// Between both ends, or nothing new.
    No,
    /// The counter is at −128: PASSED.
    Passed,
    /// The counter is at +127: FAILED.
    Failed,
    /// FAILED for long enough to count as a trip.
    Tripped,
}

/// The debounce state of one monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Debounce {
    /// In [−1, 1]; −1 is passed, 1 is failed.
    level: f64,
    /// Time of failure since the counter reached its upper end, s.
    failing_s: f64,
}

impl Debounce {
    /// The ISO 14229 fault detection counter, −128 to 127.
    #[must_use]
    pub fn counter(&self) -> i8 {
        let scale = if self.level < 0.0 { 128.0 } else { 127.0 };
        // In range by construction: |level| ≤ 1.
        (self.level * scale) as i8
    }

    /// Whether the counter is above zero: a fault is suspected.
    #[must_use]
    pub fn suspicious(&self) -> bool {
        self.level > 0.0
    }

    /// Whether the counter is at its upper end: the test has failed.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.level >= 1.0
    }

    /// Returns the progress towards a trip, 0 to 1.
    #[must_use]
    pub fn progress(&self, times: &DebounceTimes) -> f64 {
        let DebounceTimes { fail_s, confirm_s, .. } = *times;
        let needed_s = fail_s + confirm_s;
        let came_s = self.level.max(0.0) * fail_s + self.failing_s;
        if needed_s > 0.0 { (came_s / needed_s).min(1.0) } else { self.level.max(0.0) }
    }

    /// Withdraws the suspicion: another cause explains the readings.
    pub fn exonerate(&mut self) {
        self.level = self.level.min(0.0);
        self.failing_s = 0.0;
    }

    /// Updates the counter by `test`, which held for the `dt` seconds before this sample.
    /// A debounce time of zero qualifies at once.
    pub fn update(&mut self, test: Test, dt: f64, times: &DebounceTimes) -> Qualified {
        let DebounceTimes { fail_s, confirm_s, pass_s, leak_s } = *times;
        let share = |full: f64| if full > 0.0 { dt / full } else { 1.0 };
        match test {
            Test::NotTested => Qualified::No,
            Test::Prefailed => {
                if self.level >= 1.0 {
                    self.failing_s += dt;
                }
                self.level = (self.level.max(0.0) + share(fail_s)).min(1.0);
                match self.level >= 1.0 {
                    true if self.failing_s >= confirm_s => Qualified::Tripped,
                    true => Qualified::Failed,
                    false => Qualified::No,
                }
            }
            Test::Prepassed => {
                let full_s = if self.level > 0.0 { leak_s } else { pass_s };
                self.level = (self.level - share(full_s)).max(-1.0);
                if self.level <= 0.0 {
                    self.failing_s = 0.0;
                }
                if self.level <= -1.0 { Qualified::Passed } else { Qualified::No }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Profile;
    use super::*;

    fn run(debounce: &mut Debounce, test: Test, n: usize) -> Vec<Qualified> {
        let times = DebounceTimes { fail_s: 0.5, confirm_s: 0.25, pass_s: 1.0, leak_s: 2.0 };
        (0..n).map(|_| debounce.update(test, 0.125, &times)).collect()
    }

    #[test]
    fn failing_takes_its_time_and_tripping_longer() {
        use Qualified::{Failed, No, Tripped};
        let found = run(&mut Debounce::default(), Test::Prefailed, 7);
        assert_eq!(found, [No, No, No, Failed, Failed, Tripped, Tripped]);
    }

    #[test]
    fn a_lost_enable_condition_freezes_and_a_pass_lowers() {
        let mut debounce = Debounce::default();
        run(&mut debounce, Test::Prefailed, 3);
        let before = debounce.counter();
        assert_eq!(before, 95);
        run(&mut debounce, Test::NotTested, 100);
        assert_eq!(debounce.counter(), before);
        run(&mut debounce, Test::Prepassed, 1);
        assert_eq!(debounce.counter(), 87, "evidence leaks away in two seconds");
        assert_eq!(run(&mut debounce, Test::Prepassed, 19).last(), Some(&Qualified::Passed));
        assert_eq!(debounce.counter(), -128);
        run(&mut debounce, Test::Prefailed, 1);
        assert_eq!(debounce.counter(), 31, "jumps up to zero first");
    }

    /// Two pushes by hand, each visible for three quarters of `fail_s`, confirm nothing
    /// unless the second follows within half a second.
    #[test]
    fn two_pushes_confirm_nothing_unless_close_together() {
        let settings = Settings::default();
        let push_s = 0.75 * settings.fail_s;
        let confirms = |apart_s: f64| {
            let mut debounce = Debounce::default();
            let mut take = |test, seconds: f64| {
                let n = (seconds / 0.01).round() as usize;
                let tripped = |_| {
                    debounce.update(
                        test,
                        0.01,
                        &DebounceTimes::of(FaultCode::XServo, None, false, &settings),
                    ) == Qualified::Tripped
                };
                (0..n).any(tripped)
            };
            take(Test::Prefailed, push_s);
            take(Test::Prepassed, apart_s);
            take(Test::Prefailed, push_s)
        };
        assert!(confirms(0.4));
        assert!(!confirms(0.6));
    }

    #[test]
    fn a_ball_that_stands_fails_sooner_where_it_can_be_nothing_else() {
        let settings = Settings { learnt: true, ..Settings::default() };
        let fails = |rival, after_s: f64| {
            let mut debounce = Debounce::default();
            let times = DebounceTimes::of(FaultCode::StuckBall, None, rival, &settings);
            debounce.update(Test::Prefailed, after_s, &times) == Qualified::Failed
        };
        assert_eq!([0.25, 0.35].map(|s| fails(false, s)), [false, true]);
        assert_eq!([0.55, 0.65].map(|s| fails(true, s)), [false, true]);
    }

    /// Two outliers scatter the readings for 0.4 s.
    #[test]
    fn noise_takes_longer_than_what_one_reading_shows() {
        let fails = |kind, after_s: f64| {
            let times =
                DebounceTimes::of(FaultCode::Sensor, Some(kind), false, &Settings::default());
            Debounce::default().update(Test::Prefailed, after_s, &times) == Qualified::Failed
        };
        assert_eq!([0.25, 0.35].map(|s| fails(FaultKind::Frozen, s)), [false, true]);
        assert_eq!([0.4, 0.5].map(|s| fails(FaultKind::Noise, s)), [false, true]);
    }

    #[test]
    fn no_debounce_means_at_once() {
        let mut debounce = Debounce::default();
        let settings = Settings::of(Profile::Textbook);
        assert_eq!(
            debounce.update(
                Test::Prefailed,
                0.0,
                &DebounceTimes::of(FaultCode::XServo, None, false, &settings)
            ),
            Qualified::Tripped
        );
        assert_eq!(debounce.counter(), 127);
    }
}
