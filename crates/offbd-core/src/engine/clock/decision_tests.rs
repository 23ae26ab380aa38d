//! The decision on single time stamps.

use super::*;

const HZ: f64 = 100.0;

/// Time of the first sample, s.
const START_S: f64 = 1000.0;

/// Whether the context says that samples were taken around the time.
const IN_STRETCH: bool = true;

fn sample(seq: Option<u64>, t_s: f64) -> Sample {
    Sample { seq, t_s, ..Sample::default() }
}

/// A clock with the samples it has followed, a reorder window of 0.1 s and a gap of 0.25 s.
struct Followed {
    clock: DeviceClock,
    newest_s: f64,
}

impl Followed {
    /// Follows `n` samples, `period_s` apart.
    fn new(n: u64, period_s: f64, numbered: bool) -> Self {
        let mut this = Self { clock: DeviceClock::new(1.0 / HZ), newest_s: START_S };
        for i in 0..n {
            let t_s = START_S + i as f64 * period_s;
            assert_eq!(this.take(numbered.then_some(i), t_s, false), ClockDecision::Follows);
            this.newest_s = t_s;
        }
        this
    }

    fn released_s(&self) -> f64 {
        self.newest_s - 0.1
    }

    fn take(&mut self, seq: Option<u64>, t_s: f64, in_stretch: bool) -> ClockDecision {
        let context = ClockContext {
            released_s: Some(self.released_s()),
            in_stretch,
            precedes: false,
            reorder_s: 0.1,
            gap_s: 0.25,
        };
        self.clock.take(&sample(seq, t_s), &context)
    }

    /// Passes samples without `seq` from `t_s` on, `period_s` apart, until a step is believed.
    /// Returns their number, and whether the clock was set back.
    fn believed(&mut self, t_s: f64, period_s: f64, in_stretch: bool) -> (usize, bool) {
        for i in 0..2 * MAX_HELD {
            match self.take(None, t_s + i as f64 * period_s, in_stretch) {
                ClockDecision::Doubted { .. } => assert_eq!(self.clock.n_held(), i + 1),
                ClockDecision::Believed { held, set_back } => {
                    assert_eq!(held.len(), i + 1);
                    self.newest_s = t_s + i as f64 * period_s;
                    return (i + 1, set_back);
                }
                other => panic!("{other:?} at {i}"),
            }
        }
        panic!("never believed");
    }
}

fn is_late(decision: &ClockDecision) -> bool {
    matches!(decision, ClockDecision::Late { .. })
}

fn is_doubted(decision: &ClockDecision) -> bool {
    matches!(decision, ClockDecision::Doubted { .. })
}

#[test]
fn a_step_forward_is_doubted_from_ten_reorder_windows_on() {
    let near = Followed::new(100, 0.01, false);
    let (mut near, mut far) = (near, Followed::new(100, 0.01, false));
    let newest_s = near.newest_s;
    assert_eq!(near.take(None, newest_s + 0.9, false), ClockDecision::Follows);
    assert!(is_doubted(&far.take(None, newest_s + 1.1, false)));
}

#[test]
fn a_step_forward_is_doubted_from_ten_measured_intervals_on() {
    // Declared are 100 Hz, and sent is 1 Hz.
    let mut clock = Followed::new(100, 1.0, false);
    assert_eq!(clock.take(None, clock.newest_s + 8.0, false), ClockDecision::Follows);
    // After a step that was believed, the interval is that of the new samples.
    let mut clock = Followed::new(100, 0.01, false);
    clock.believed(clock.newest_s + 1e4, 3.0, false);
    assert_eq!(clock.take(None, clock.newest_s + 29.0, false), ClockDecision::Follows);
}

#[test]
fn what_is_behind_by_less_is_late_also_where_samples_were_taken() {
    let mut clock = Followed::new(100, 0.01, false);
    let released_s = clock.released_s();
    assert!(is_late(&clock.take(None, released_s - 0.5, IN_STRETCH)));
    assert!(is_late(&clock.take(None, released_s, false)), "released");
    assert!(is_late(&clock.take(None, released_s - 30.0, false)));
    assert!(is_doubted(&clock.take(None, released_s - 30.0, IN_STRETCH)));
}

#[test]
fn out_of_order_samples_do_not_set_the_clock_back() {
    let mut clock = Followed::new(100, 0.01, true);
    assert_eq!(clock.take(Some(90), clock.newest_s - 0.05, false), ClockDecision::Follows);
    let late = clock.take(Some(95), clock.newest_s - 30.0, false);
    assert!(is_late(&late), "its number is not the newest: {late:?}");
    assert_eq!(clock.take(Some(100), clock.newest_s + 0.98, false), ClockDecision::Follows);
}

#[test]
fn a_sample_that_follows_ends_a_doubt() {
    let mut clock = Followed::new(100, 0.01, false);
    for i in 0..4 {
        assert!(is_doubted(&clock.take(None, clock.newest_s + 50.0 + f64::from(i), false)));
    }
    assert_eq!(clock.take(None, clock.newest_s + 0.01, false), ClockDecision::Follows);
    assert_eq!((clock.clock.n_held(), clock.clock.n_dropped()), (0, 4));
}

#[test]
fn a_time_is_not_settled_before_five_samples() {
    let mut clock = Followed::new(4, 0.01, false);
    assert_eq!(clock.believed(clock.newest_s - 30.0, 0.01, false), (BELIEVED_AFTER, true));
    let mut clock = Followed::new(5, 0.01, false);
    assert!(is_late(&clock.take(None, clock.newest_s - 30.0, false)));
    let mut clock = Followed::new(1, 0.01, false);
    clock.believed(clock.newest_s + 1e4, 0.01, false);
    assert!(is_late(&clock.take(None, clock.newest_s - 30.0, false)), "settled by a step");
}

#[test]
fn a_step_is_believed_after_five_samples_and_one_back_without_numbers_after_a_gap() {
    let mut clock = Followed::new(100, 0.01, false);
    assert_eq!(clock.believed(clock.newest_s + 60.0, 0.01, false), (BELIEVED_AFTER, false));
    let mut clock = Followed::new(100, 0.01, true);
    for i in 0..5 {
        let decision = clock.take(Some(100 + i), clock.newest_s - 60.0 + i as f64 * 0.01, false);
        assert_eq!(is_doubted(&decision), i < 4, "{decision:?}");
    }
    let mut clock = Followed::new(100, 0.01, false);
    let (n, set_back) = clock.believed(clock.newest_s - 60.0, 0.01, IN_STRETCH);
    assert!(set_back && (26..=28).contains(&n), "0.25 s: {n}");
    let mut clock = Followed::new(100, 0.01, false);
    assert_eq!(clock.believed(clock.newest_s - 60.0, 1e-5, IN_STRETCH).0, MAX_HELD);
}

#[test]
fn that_samples_have_numbers_is_remembered_after_a_step() {
    let mut clock = Followed::new(100, 0.01, true);
    clock.believed(clock.newest_s + 60.0, 0.01, false);
    assert!(is_late(&clock.take(None, clock.newest_s - 30.0, IN_STRETCH)));
}

#[test]
fn the_interval_is_that_of_the_samples_followed_or_believed() {
    let mut clock = Followed::new(2000, 0.02, false);
    assert!((clock.clock.interval_s() - 0.02).abs() < 1e-9, "{}", clock.clock.interval_s());
    clock.believed(START_S + 500.0, 0.05, !IN_STRETCH);
    assert!((clock.clock.interval_s() - 0.05).abs() < 1e-9, "{}", clock.clock.interval_s());
}

#[test]
fn samples_of_one_time_do_not_shorten_the_interval() {
    let mut clock = Followed::new(100, 0.01, true);
    let before_s = clock.clock.interval_s();
    let newest_s = clock.newest_s;
    for seq in 100..200 {
        assert_eq!(clock.take(Some(seq), newest_s, IN_STRETCH), ClockDecision::Follows);
    }
    assert_eq!(clock.clock.interval_s(), before_s);
}

#[test]
fn believed_samples_of_one_time_do_not_make_the_interval_zero() {
    let mut clock = Followed::new(100, 0.01, false);
    let before_s = clock.clock.interval_s();
    clock.believed(START_S + 500.0, 0.0, !IN_STRETCH);
    assert_eq!(clock.clock.interval_s(), before_s);
}
