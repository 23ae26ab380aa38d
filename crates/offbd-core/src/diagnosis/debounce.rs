//! Debouncing by time: a fault detection counter from −128 to 127.
//!
//! Prefailed raises it (jumping up to zero first), prepassed lowers it, at
//! rates that take `fail_s` and `pass_s` from zero to an end. It does not jump
//! down first but leaks away in `leak_s`: the residual of a ball that a sick
//! servo swings to and fro crosses zero twice a swing, and a loose contact
//! comes and goes. While the enable condition is lost it freezes.
//! A silent rig is judged by time, not by counts, so the rates are per second.

use super::Settings;
use crate::vocabulary::{FaultCode, FaultKind};

/// What a monitor says of one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Test {
    /// The enable condition does not hold: neither passed nor failed.
    #[default]
    NotTested,
    Prepassed,
    Prefailed,
}

/// How fast the counter of one monitor moves, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Failure from zero to the upper end.
    pub fail_s: f64,
    /// Further failure until it counts as a trip.
    pub confirm_s: f64,
    /// Agreement from zero to the lower end.
    pub pass_s: f64,
    /// Agreement from the upper end to zero.
    pub leak_s: f64,
}

impl Pace {
    /// The pace of `code`'s monitor: a loose contact comes and goes; readings
    /// and a ball are given up on sooner, for a disturbance shows in them too.
    /// The ball of a learnt rig that stands fails as soon as readings do, unless
    /// it has a `rival`: another cause that reads alike, which has to have its
    /// time to show. Of readings that scatter the `kind` is noise.
    #[must_use]
    pub fn of(code: FaultCode, kind: Option<FaultKind>, rival: bool, settings: &Settings) -> Self {
        let Settings { fail_s, confirm_s, pass_s, .. } = *settings;
        match code {
            FaultCode::XServo | FaultCode::YServo => {
                Self { fail_s, confirm_s, pass_s, leak_s: settings.leak_s }
            }
            FaultCode::StuckBall if rival || !settings.learnt => {
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

impl Pace {
    /// Time that a lasting failure of `code` takes to be confirmed by `settings`,
    /// where nothing else reads alike, s: debounce and confirmation.
    #[must_use]
    pub fn needed_s(code: FaultCode, settings: &Settings) -> f64 {
        let Self { fail_s, confirm_s, .. } = Self::of(code, None, false, settings);
        fail_s + confirm_s
    }
}

/// What the counter came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Qualified {
    /// Still on its way, or nothing new.
    No,
    /// At −128: PASSED.
    Passed,
    /// At +127: FAILED.
    Failed,
    /// Failed, and has been failing long enough to count as a trip.
    Tripped,
}

/// The debounce of one monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Debounce {
    /// In [−1, 1]; −1 is passed, +1 is failed.
    level: f64,
    /// Seconds of failure since the counter reached its upper end.
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

    /// Whether it is on its way up: something is suspected.
    #[must_use]
    pub fn suspicious(&self) -> bool {
        self.level > 0.0
    }

    /// Whether it is at its upper end: the test has failed.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.level >= 1.0
    }

    /// How far it has come on the way to a trip, 0 to 1.
    #[must_use]
    pub fn progress(&self, pace: &Pace) -> f64 {
        let Pace { fail_s, confirm_s, .. } = *pace;
        let needed_s = fail_s + confirm_s;
        let came_s = self.level.max(0.0) * fail_s + self.failing_s;
        if needed_s > 0.0 { (came_s / needed_s).min(1.0) } else { self.level.max(0.0) }
    }

    /// Takes suspicion back: another cause accounts for what was seen.
    pub fn exonerate(&mut self) {
        self.level = self.level.min(0.0);
        self.failing_s = 0.0;
    }

    /// Takes `test`, which held for the `dt` seconds before this sample. A
    /// time of zero qualifies at once.
    pub fn update(&mut self, test: Test, dt: f64, pace: &Pace) -> Qualified {
        let Pace { fail_s, confirm_s, pass_s, leak_s } = *pace;
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
        let pace = Pace { fail_s: 0.5, confirm_s: 0.25, pass_s: 1.0, leak_s: 2.0 };
        (0..n).map(|_| debounce.update(test, 0.125, &pace)).collect()
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

    /// Hands that push a ball twice, each time seen for three quarters of what
    /// fails, confirm nothing unless the second comes within half a second.
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
                        &Pace::of(FaultCode::XServo, None, false, &settings),
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
            let pace = Pace::of(FaultCode::StuckBall, None, rival, &settings);
            debounce.update(Test::Prefailed, after_s, &pace) == Qualified::Failed
        };
        assert_eq!([0.25, 0.35].map(|s| fails(false, s)), [false, true]);
        assert_eq!([0.55, 0.65].map(|s| fails(true, s)), [false, true]);
    }

    /// Two outliers scatter the readings for 0.4 s.
    #[test]
    fn noise_takes_longer_than_what_one_reading_shows() {
        let fails = |kind, after_s: f64| {
            let pace = Pace::of(FaultCode::Sensor, Some(kind), false, &Settings::default());
            Debounce::default().update(Test::Prefailed, after_s, &pace) == Qualified::Failed
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
                &Pace::of(FaultCode::XServo, None, false, &settings)
            ),
            Qualified::Tripped
        );
        assert_eq!(debounce.counter(), 127);
    }
}
