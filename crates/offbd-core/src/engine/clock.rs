//! Second stage: the clock of the device.
//!
//! A step of the clock is doubted until the samples after it confirm it; until then these
//! samples are held back. One wrong time stamp therefore costs one sample, at any sample
//! rate and for any size of the step. A clock that was set forward or back is followed.

use core::mem;
use serde::{Deserialize, Serialize};

use crate::vocabulary::Sample;

#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// Consecutive samples on a new time until it is believed. Chosen: more wrong time stamps
/// in a row that agree are a new time.
const BELIEVED_AFTER: usize = 5;

/// Steps of more than this many reorder windows are doubted. Chosen: below it, a wrong
/// time stamp waits in the reorder window and delays nothing.
const DOUBTED_WINDOWS: f64 = 10.0;
/// Steps of more than this many sample intervals are doubted. Chosen: a few lost samples
/// are common.
const DOUBTED_INTERVALS: f64 = 10.0;

/// Time that samples without `seq` from before the first one must last to show that the clock
/// was set back, s. Chosen: longer than most batches, because a batch that was lost may be sent
/// late.
const SET_BACK_AFTER_S: f64 = 10.0;

/// Gain of the filter of the sample interval, per sample. Chosen.
const INTERVAL_GAIN: f64 = 0.1;

/// Most samples held back; bounds the memory. Half a second at 8 kHz.
const MAX_HELD: usize = 4096;

/// The circumstances in which a time stamp is judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClockContext {
    /// Time of the last sample that left the reorder window, s.
    pub(super) released_s: Option<f64>,
    /// Whether samples without `seq` have been taken around this time.
    pub(super) in_stretch: bool,
    /// Whether the sample has no `seq` and is before the first one taken.
    pub(super) precedes: bool,
    pub(super) reorder_s: f64,
    /// The interval without a sample that makes a gap, s.
    pub(super) gap_s: f64,
}

/// The decision on a time stamp.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ClockDecision {
    /// It continues the clock.
    Follows,
    /// It is before the last released sample.
    Late { behind_s: f64 },
    /// The clock steps by `step_s`: the sample is held back.
    Doubted { step_s: f64 },
    /// The step is confirmed: `held` are the samples since, this one included.
    Believed { held: Vec<Sample>, set_back: bool },
}

/// The clock of the device.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct DeviceClock {
    newest_s: Option<f64>,
    newest_seq: Option<u64>,
    /// Samples on the present time, at most [`BELIEVED_AFTER`] are counted.
    n_followed: usize,
    interval_s: f64,
    held: Vec<Sample>,
    /// Samples that were held back and are not judged.
    n_dropped: u64,
}

impl DeviceClock {
    /// `interval_s` is the expected sample interval.
    pub(super) const fn new(interval_s: f64) -> Self {
        Self {
            newest_s: None,
            newest_seq: None,
            n_followed: 0,
            interval_s,
            held: Vec::new(),
            n_dropped: 0,
        }
    }

    /// Judges the time stamp of the next sample.
    pub(super) fn take(&mut self, sample: &Sample, context: &ClockContext) -> ClockDecision {
        let Some(newest_s) = self.newest_s else { return self.follow(sample) };
        let (step_s, doubted_s) = (sample.t_s - newest_s, self.doubted_s(context));
        let behind_s = context.released_s.map(|s| s - sample.t_s).filter(|&s| s >= 0.0);
        match behind_s {
            None if step_s <= doubted_s => self.follow(sample),
            Some(behind_s) if behind_s <= doubted_s || !self.may_be_set_back(sample, context) => {
                ClockDecision::Late { behind_s }
            }
            _ => self.doubt(sample, step_s, context),
        }
    }

    fn doubted_s(&self, context: &ClockContext) -> f64 {
        (DOUBTED_WINDOWS * context.reorder_s).max(DOUBTED_INTERVALS * self.interval_s)
    }

    fn follow(&mut self, sample: &Sample) -> ClockDecision {
        self.drop_held();
        if let Some(newest_s) = self.newest_s.filter(|&newest_s| sample.t_s > newest_s) {
            self.interval_s += INTERVAL_GAIN * (sample.t_s - newest_s - self.interval_s);
        }
        self.newest_s = Some(self.newest_s.map_or(sample.t_s, |newest| newest.max(sample.t_s)));
        self.newest_seq = self.newest_seq.max(sample.seq);
        self.n_followed = (self.n_followed + 1).min(BELIEVED_AFTER);
        ClockDecision::Follows
    }

    /// Whether a sample of the past can mean that the clock was set back: its `seq`
    /// continues, or without `seq` samples around this time have been taken already, or none
    /// from before. If not, it is one that was lost and is sent late.
    fn may_be_set_back(&self, sample: &Sample, context: &ClockContext) -> bool {
        match (sample.seq, self.newest_seq) {
            (Some(seq), newest) => newest.is_none_or(|newest| seq > newest),
            (None, Some(_)) => false,
            (None, None) => {
                context.in_stretch || context.precedes || self.n_followed < BELIEVED_AFTER
            }
        }
    }

    fn doubt(&mut self, sample: &Sample, step_s: f64, context: &ClockContext) -> ClockDecision {
        let agrees = self
            .held
            .last()
            .is_some_and(|last| (0.0..=step_s.abs()).contains(&(sample.t_s - last.t_s)));
        if !agrees {
            self.drop_held();
        }
        self.held.push(*sample);
        if self.is_confirmed(step_s, context) {
            self.believe(step_s)
        } else {
            ClockDecision::Doubted { step_s }
        }
    }

    /// Whether enough samples agree. Without `seq`, samples of the past must also last
    /// longer than a gap, because shorter gaps are not known: they may fill one. Those from
    /// before the first sample must last longer.
    fn is_confirmed(&self, step_s: f64, context: &ClockContext) -> bool {
        let needed_s = if context.precedes { SET_BACK_AFTER_S } else { context.gap_s };
        let may_fill_gap = step_s < 0.0
            && self.newest_seq.is_none()
            && self.n_followed >= BELIEVED_AFTER
            && self.held_span_s() <= needed_s;
        self.held.len() >= MAX_HELD || (self.held.len() >= BELIEVED_AFTER && !may_fill_gap)
    }

    fn held_span_s(&self) -> f64 {
        self.held.first().zip(self.held.last()).map_or(0.0, |(first, last)| last.t_s - first.t_s)
    }

    fn believe(&mut self, step_s: f64) -> ClockDecision {
        let interval_s = self.held_span_s() / (self.held.len() - 1).max(1) as f64;
        if interval_s > 0.0 {
            self.interval_s = interval_s;
        }
        let held = mem::take(&mut self.held);
        self.newest_s = held.last().map(|last| last.t_s);
        self.newest_seq = held.iter().map(|sample| sample.seq).fold(self.newest_seq, Option::max);
        self.n_followed = BELIEVED_AFTER;
        ClockDecision::Believed { held, set_back: step_s < 0.0 }
    }

    /// Drops the samples that were held back; the clock goes on as before.
    pub(super) fn drop_held(&mut self) {
        self.n_dropped += self.held.len() as u64;
        // Keeps no memory: samples are rarely held back, and then often only once.
        self.held = Vec::new();
    }

    pub(super) fn n_held(&self) -> usize {
        self.held.len()
    }

    /// Samples that were held back and are not judged.
    pub(super) const fn n_dropped(&self) -> u64 {
        self.n_dropped
    }

    /// The sample interval, s.
    pub(super) const fn interval_s(&self) -> f64 {
        self.interval_s
    }
}

#[cfg(test)]
mod decision_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Admission, Engine, Input, Rig, Setup};
    use proptest::prelude::*;

    const HZ: f64 = 100.0;

    fn engine(hz: f64) -> Engine {
        let rig = Rig { sample_rate_hz: hz, ..Rig::chapter("rig") };
        Engine::new(Setup::new(rig, None).unwrap(), Default::default())
    }

    fn row(seq: Option<u64>, t_s: f64) -> Sample {
        let swing = (0.7 * t_s).sin();
        let (cmd_qx_rad, x_m) = (Some(0.02 * swing), Some(0.01 * swing));
        Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad: cmd_qx_rad, x_m, y_m: x_m }
    }

    /// Passes the rows to a new engine. Returns how many are judged and set aside.
    fn judged(hz: f64, rows: impl IntoIterator<Item = Sample>) -> (u64, u64) {
        let (mut engine, mut transitions) = (engine(hz), Vec::new());
        for row in rows {
            let mut admission = engine.handle(Input::Sample(row), &mut transitions);
            if admission == Some(Admission::Unknown) {
                admission = engine.handle(Input::NewSample(row), &mut transitions);
            }
            let is_recorded =
                matches!(admission, Some(Admission::Accepted | Admission::SetAside(_)));
            assert!(is_recorded, "{row:?}: {admission:?}");
        }
        engine.handle(Input::End, &mut transitions);
        assert!(transitions.is_empty(), "{transitions:?}");
        (engine.state().n_judged, engine.n_set_aside())
    }

    fn numbered(n: u64, t_s: impl Fn(u64) -> f64) -> impl Iterator<Item = Sample> {
        (0..n).map(move |i| row(Some(i), t_s(i)))
    }

    fn unnumbered(n: u64, t_s: impl Fn(u64) -> f64) -> impl Iterator<Item = Sample> {
        (0..n).map(move |i| row(None, t_s(i)))
    }

    #[test]
    fn one_wrong_time_stamp_costs_at_most_one_sample() {
        for step_s in [-1e9, -3000.0, -19.995, 0.305, 0.905, 3.005, 60.0, 3000.0, 4000.0, 1e9] {
            let t_s = |i: u64| i as f64 / HZ + if i == 2000 { step_s } else { 0.0 };
            let (n, aside) = judged(HZ, numbered(6001, t_s));
            assert!(n + aside == 6001 && aside <= 1, "{step_s} s: {n} judged, {aside} set aside");
            let (n, aside) = judged(HZ, unnumbered(6001, t_s));
            assert!(n + aside == 6001 && aside <= 1, "{step_s} s: {n} judged, {aside} set aside");
        }
    }

    #[test]
    fn a_clock_that_is_set_is_followed() {
        for step_s in [-1e6, -1200.0, -30.0, 2.0, 1200.0, 1e6] {
            let t_s = |i: u64| 2000.0 + i as f64 / HZ + if i >= 2000 { step_s } else { 0.0 };
            assert_eq!(judged(HZ, numbered(6001, t_s)), (6001, 0), "{step_s} s");
        }
        // Without numbers, a time from before the first sample is followed after 10 s.
        for step_s in [-1e6, -3000.0] {
            let t_s = |i: u64| 2000.0 + i as f64 / HZ + if i >= 2000 { step_s } else { 0.0 };
            assert_eq!(judged(HZ, unnumbered(6001, t_s)), (6001, 0), "{step_s} s");
        }
        // A time of the past is followed where samples were taken before.
        let t_s = |i: u64| i as f64 / HZ - if i >= 5000 { 30.005 } else { 0.0 };
        assert_eq!(judged(HZ, unnumbered(8000, t_s)), (8000, 0));
    }

    #[test]
    fn a_first_time_stamp_that_is_wrong_does_not_blind() {
        for first_s in [1e9, -1e9, 50.0] {
            let t_s = |i: u64| if i == 0 { first_s } else { i as f64 / HZ };
            assert_eq!(judged(HZ, numbered(3000, t_s)).1, 0, "{first_s}");
            assert_eq!(judged(HZ, unnumbered(3000, t_s)).1, 0, "{first_s}");
        }
    }

    #[test]
    fn slow_rigs_with_long_pauses_are_judged() {
        for period_s in [2.0, 20.0, 60.0] {
            for declared_hz in [HZ, 1.0 / period_s] {
                let t_s = |i: u64| i as f64 * period_s + if i >= 50 { 7200.0 } else { 0.0 };
                assert_eq!(judged(declared_hz, unnumbered(250, t_s)), (250, 0), "{period_s} s");
            }
        }
    }

    #[test]
    fn a_gap_that_is_filled_late_is_set_aside() {
        let (outage, late) = (1000..2500_u64, |i: u64| row(None, i as f64 / HZ));
        let live = (0..4000).filter(|i| !outage.contains(i)).map(late);
        let (n, aside) =
            judged(HZ, live.chain(outage.clone().map(late)).chain((4000..5000).map(late)));
        assert_eq!((n, aside), (3500, 1500));
        let short = 1000..1010_u64;
        let live = (0..4000).filter(|i| !short.contains(i)).map(late);
        let rows = live.chain(short.clone().map(late)).chain((4000..5000).map(late));
        assert_eq!(judged(HZ, rows), (4990, 10), "a gap that is not known as one");
    }

    #[test]
    fn a_first_batch_that_arrives_late_is_set_aside() {
        let rows = |range: std::ops::Range<u64>| range.map(|i| row(None, i as f64 / HZ));
        let (n, aside) = judged(HZ, rows(900..2000).chain(rows(0..900)).chain(rows(2000..4000)));
        assert_eq!((n, aside), (3100, 900));
    }

    #[test]
    fn a_rig_whose_samples_go_unjudged_says_so() {
        let (mut engine, mut transitions) = (engine(HZ), Vec::new());
        for i in 0..1000_u32 {
            engine.handle(
                Input::Sample(row(Some(1000 + u64::from(i)), f64::from(i) / HZ)),
                &mut transitions,
            );
        }
        assert_eq!(engine.state().unjudged, None);
        for i in 0..20_u32 {
            let late = row(Some(u64::from(i)), f64::from(i) / HZ);
            engine.handle(Input::Sample(late), &mut transitions);
        }
        let state = engine.state();
        let unjudged = state.unjudged.unwrap();
        assert_eq!((unjudged.n, unjudged.why.as_str()), (20, "late"));
        assert!(state.monitors.iter().all(|monitor| !monitor.readiness.enabled));
        for i in 0..22_u32 {
            let next = row(Some(2000 + u64::from(i)), 10.0 + f64::from(i) / HZ);
            engine.handle(Input::Sample(next), &mut transitions);
        }
        assert_eq!(engine.state().unjudged, None);
    }

    proptest! {
        /// Whatever the clock does, each sample is judged, set aside or waits.
        #[test]
        fn every_new_sample_is_accounted_for(
            steps in proptest::collection::vec((-50.0..50.0_f64, 1..40_u64, any::<bool>()), 1..20),
        ) {
            let (mut engine, mut transitions) = (engine(HZ), Vec::new());
            let (mut t_s, mut n) = (0.0, 0);
            for (step_s, rows, numbered) in steps {
                t_s += step_s;
                for _ in 0..rows {
                    t_s += 0.01;
                    let row = row(numbered.then_some(n), t_s);
                    engine.handle(Input::NewSample(row), &mut transitions);
                    n += 1;
                    let state = engine.state();
                    let accounted = state.n_judged + state.n_waiting as u64 + engine.n_set_aside();
                    prop_assert!(accounted == n, "{} of {}", accounted, n);
                }
            }
            engine.handle(Input::End, &mut transitions);
            prop_assert_eq!(engine.state().n_judged + engine.n_set_aside(), n);
            prop_assert!(engine.duration_s().is_finite() && engine.duration_s() >= 0.0);
        }
    }
}
