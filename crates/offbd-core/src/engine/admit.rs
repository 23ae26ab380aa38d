//! First stage: validates samples, detects duplicates, and checks the clock.
//!
//! A sample is identified by its `seq`, or by `t_s` if it has none: sent twice, it counts
//! once. New samples that cannot be judged are recorded all the same.

use alloc::collections::VecDeque;

use super::{Admission, AxisMapping, Rejection, Rig};
use crate::vocabulary::Sample;

/// Largest plausible time, s. Chosen: over 30 000 years.
const MAX_TIME_S: f64 = 1e12;
/// Largest plausible position, m: ten times half of the largest plate (10 m).
const MAX_POSITION_M: f64 = 50.0;
/// Largest believable command, rad: a full turn.
const MAX_COMMAND_RAD: f64 = core::f64::consts::TAU;

/// Step of the clock beyond which it is doubted, s. Chosen: an hour.
const CLOCK_JUMP_S: f64 = 3600.0;
/// Consecutive samples after a jump of the clock until the new time is accepted. Chosen.
const CLOCK_BELIEVED_AFTER: u32 = 5;
/// Longest interval between two of these samples, s. Chosen.
const CLOCK_STEP_S: f64 = 10.0;

/// Most separate ranges of `seq` that are remembered; bounds the memory. Beyond it the
/// oldest gap is closed: a sample missing in it counts as a duplicate if it still
/// arrives.
const MAX_RANGES: usize = 1024;
/// Most times of samples without `seq` that are remembered; bounds the memory. An older
/// sample counts as a duplicate.
const MAX_TIMES: usize = 16_384;

/// The samples taken so far, to detect duplicates.
#[derive(Clone, Debug, Default)]
struct SeenSamples {
    /// Inclusive ranges of `seq`, ascending, with a gap between any two.
    ranges: VecDeque<(u64, u64)>,
    /// Times without `seq`, ascending.
    times: VecDeque<f64>,
    /// Whether `times` has dropped any.
    forgot: bool,
}

impl SeenSamples {
    /// Records a sample; returns false if it is known already.
    fn note(&mut self, sample: &Sample) -> bool {
        match sample.seq {
            Some(seq) => self.note_seq(seq),
            None => self.note_time(sample.t_s),
        }
    }

    fn note_seq(&mut self, seq: u64) -> bool {
        let after = self.ranges.partition_point(|&(start, _)| start <= seq);
        if after > 0 && self.ranges[after - 1].1 >= seq {
            return false;
        }
        let joins_left = after > 0 && self.ranges[after - 1].1 + 1 == seq;
        let joins_right = after < self.ranges.len() && seq + 1 == self.ranges[after].0;
        match (joins_left, joins_right) {
            (true, true) => {
                self.ranges[after - 1].1 = self.ranges[after].1;
                self.ranges.remove(after);
            }
            (true, false) => self.ranges[after - 1].1 = seq,
            (false, true) => self.ranges[after].0 = seq,
            (false, false) => self.ranges.insert(after, (seq, seq)),
        }
        if self.ranges.len() > MAX_RANGES {
            self.ranges[1].0 = self.ranges[0].0;
            self.ranges.pop_front();
        }
        true
    }

    fn note_time(&mut self, t_s: f64) -> bool {
        if self.forgot && self.times.front().is_some_and(|&oldest| t_s < oldest) {
            return false;
        }
        let at = match self.times.back() {
            Some(&newest) if t_s > newest => self.times.len(),
            _ => self.times.partition_point(|&t| t < t_s),
        };
        if self.times.get(at).is_some_and(|&t| t == t_s) {
            return false;
        }
        self.times.insert(at, t_s);
        if self.times.len() > MAX_TIMES {
            self.times.pop_front();
            self.forgot = true;
        }
        true
    }
}

/// A jump of the clock that has not been accepted yet.
#[derive(Clone, Copy, Debug)]
struct SuspectedClockJump {
    t_s: f64,
    n: u32,
}

/// The stage: validation, duplicates, clock.
#[derive(Clone, Debug)]
pub(super) struct Admit {
    max_command: f64,
    max_position: f64,
    seen: SeenSamples,
    newest_s: Option<f64>,
    suspect: Option<SuspectedClockJump>,
}

/// Returns why the engine of `rig` would reject `sample`, whatever came before it; `None`
/// if it would not.
#[must_use]
pub fn rejection(rig: &Rig, sample: &Sample) -> Option<Rejection> {
    Admit::new(&rig.mapping).check(sample).err()
}

impl Admit {
    pub(super) fn new(mapping: &AxisMapping) -> Self {
        Self {
            max_command: MAX_COMMAND_RAD / mapping.command_unit_rad,
            max_position: MAX_POSITION_M / mapping.position_unit_m,
            seen: SeenSamples::default(),
            newest_s: None,
            suspect: None,
        }
    }

    /// Judges a sample; `judged_s` is the time of the last sample that left the reorder
    /// window.
    pub(super) fn take(&mut self, sample: &Sample, judged_s: Option<f64>) -> Admission {
        if let Err(rejection) = self.check(sample) {
            return Admission::Rejected(rejection);
        }
        if !self.seen.note(sample) {
            return Admission::Duplicate;
        }
        if let Some(behind_s) = judged_s.map(|j| j - sample.t_s).filter(|&b| b >= 0.0) {
            return Admission::SetAside(Rejection::Late { behind_s });
        }
        if let Some(ahead_s) = self.jumps(sample.t_s) {
            return Admission::SetAside(Rejection::Jump { ahead_s });
        }
        self.newest_s = Some(self.newest_s.map_or(sample.t_s, |n| n.max(sample.t_s)));
        Admission::Accepted
    }

    /// Checks the numbers of a sample, whatever came before it.
    fn check(&self, sample: &Sample) -> Result<(), Rejection> {
        let fields = [
            ("t_s", Some(sample.t_s), MAX_TIME_S),
            ("cmd_qx_rad", sample.cmd_qx_rad, self.max_command),
            ("cmd_qy_rad", sample.cmd_qy_rad, self.max_command),
            ("x_m", sample.x_m, self.max_position),
            ("y_m", sample.y_m, self.max_position),
        ];
        for (field, value, limit) in fields {
            let Some(value) = value else { continue };
            if !value.is_finite() {
                return Err(Rejection::NotFinite { field });
            }
            if value.abs() > limit {
                return Err(Rejection::Absurd { field, value, limit });
            }
        }
        Ok(())
    }

    /// Returns how far `t_s` is ahead of the clock if that is a jump, unless enough
    /// samples have followed from there.
    fn jumps(&mut self, t_s: f64) -> Option<f64> {
        let ahead_s = self.newest_s.map(|n| t_s - n).filter(|&a| a > CLOCK_JUMP_S);
        let Some(ahead_s) = ahead_s else {
            self.suspect = None;
            return None;
        };
        let n = match self.suspect {
            Some(d) if (0.0..=CLOCK_STEP_S).contains(&(t_s - d.t_s)) => d.n + 1,
            _ => 1,
        };
        self.suspect = Some(SuspectedClockJump { t_s, n });
        (n < CLOCK_BELIEVED_AFTER).then_some(ahead_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::collections::BTreeSet;
    use proptest::prelude::*;

    fn at(t_s: f64) -> Sample {
        Sample { t_s, x_m: Some(0.0), ..Sample::default() }
    }

    fn admit() -> Admit {
        Admit::new(&AxisMapping::default())
    }

    #[test]
    fn what_is_no_sample_is_named() {
        let nan = Sample { y_m: Some(f64::NAN), ..at(1.0) };
        let reason = Rejection::NotFinite { field: "y_m" };
        assert_eq!(admit().take(&nan, None), Admission::Rejected(reason));
        let far = Sample { x_m: Some(-1e9), ..at(1.0) };
        let Admission::Rejected(reason) = admit().take(&far, None) else { panic!("taken") };
        assert_eq!(reason.to_string(), "x_m is -1000000000, beyond ±50");
    }

    #[test]
    fn a_lone_jump_is_set_aside_and_a_new_clock_is_believed() {
        let mut admit = admit();
        assert_eq!(admit.take(&at(0.0), None), Admission::Accepted);
        let year = 3.15e7;
        assert!(matches!(admit.take(&at(year), None), Admission::SetAside(Rejection::Jump { .. })));
        assert_eq!(admit.take(&at(0.1), None), Admission::Accepted);
        let taken: Vec<bool> = (1..=6)
            .map(|i| admit.take(&at(year + f64::from(i)), None) == Admission::Accepted)
            .collect();
        assert_eq!(taken, [false, false, false, false, true, true]);
    }

    #[test]
    fn a_full_ledger_of_times_never_takes_twice() {
        let mut seen = SeenSamples::default();
        for i in 0..(MAX_TIMES + 10) {
            assert!(seen.note_time(i as f64));
        }
        assert!(!seen.note_time(3.0), "older than what is remembered");
        assert!(!seen.note_time(100.0));
    }

    proptest! {
        #[test]
        fn every_seq_counts_once(seqs in proptest::collection::vec(0..300_u64, 1..500)) {
            let (mut seen, mut truth) = (SeenSamples::default(), BTreeSet::new());
            for seq in seqs {
                prop_assert_eq!(seen.note_seq(seq), truth.insert(seq));
            }
        }
    }
}
