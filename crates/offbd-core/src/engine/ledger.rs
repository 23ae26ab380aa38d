//! The ledger of the samples taken so far, which recognises retransmissions.
//!
//! The key of a sample is its `seq` or, without one, its `t_s`. The same key with the same
//! values is a retransmission; with other values it is a conflict: the device has started
//! again, or two devices use one name. Keys beyond the memory of the ledger are not guessed:
//! the caller can look them up in the recording.

use alloc::collections::VecDeque;
use serde::{Deserialize, Serialize};

use crate::vocabulary::Sample;

/// Samples of each kind (with and without `seq`) whose values are remembered; bounds the
/// memory to 1.5 KiB each. Chosen: a usual batch of 100 rows that is sent again; those of a
/// larger one are looked up in the recording.
const MAX_RECENT: usize = 128;

/// Most separate ranges of keys that are remembered; bounds the memory. Beyond it the
/// oldest gap is closed: whether a key in it was taken is then unknown.
const MAX_RANGES: usize = 1024;

/// What is known of a sample before it is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recognition {
    /// No sample with its key has been taken.
    New,
    /// The same sample has been taken.
    Same,
    /// A sample with its key and other values has been taken.
    Conflict,
    /// A sample with its key has been taken, before those whose values are remembered.
    Taken,
    /// A sample with its key may have been taken, before those that are remembered.
    Unknown,
}

/// A key that is in order.
trait Key: Copy + PartialOrd {
    /// Whether no key fits between this one and the later `next`: that of the next sample,
    /// or, for times, one that is at most `gap_s` later.
    fn joins(self, next: Self, gap_s: f64) -> bool;

    /// Whether each key of a range was taken.
    const IS_DENSE: bool;
}

impl Key for u64 {
    fn joins(self, next: Self, _: f64) -> bool {
        self.checked_add(1) == Some(next)
    }

    const IS_DENSE: bool = true;
}

impl Key for f64 {
    fn joins(self, next: Self, gap_s: f64) -> bool {
        next - self <= gap_s
    }

    const IS_DENSE: bool = false;
}

/// The keys of one kind.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Keys<K> {
    /// The latest keys, ascending.
    recent: VecDeque<K>,
    /// The fingerprint of the sample of each.
    fingerprints: VecDeque<u32>,
    /// The largest key that `recent` has dropped.
    dropped: Option<K>,
    /// Inclusive ranges of keys, ascending, with a gap between any two.
    ranges: VecDeque<(K, K)>,
    /// The largest start of a range before which a gap was closed.
    closed: Option<K>,
    /// The key that was taken first.
    first: Option<K>,
}

impl<K> Default for Keys<K> {
    fn default() -> Self {
        Self {
            recent: VecDeque::new(),
            fingerprints: VecDeque::new(),
            dropped: None,
            ranges: VecDeque::new(),
            closed: None,
            first: None,
        }
    }
}

impl<K: Key> Keys<K> {
    fn recognise(&self, key: K, fingerprint: impl FnOnce() -> u32) -> Recognition {
        // Those that were dropped are older than all that are remembered.
        if self.recent.back().is_none_or(|&newest| key > newest) {
            return Recognition::New;
        }
        let at = self.recent.partition_point(|&k| k < key);
        match self.recent.get(at) {
            Some(&k) if k == key && self.fingerprints[at] == fingerprint() => Recognition::Same,
            Some(&k) if k == key => Recognition::Conflict,
            _ if self.dropped.is_none_or(|dropped| key > dropped) => Recognition::New,
            _ if !self.cover(key) => Recognition::New,
            _ if K::IS_DENSE && self.closed.is_none_or(|closed| key >= closed) => {
                Recognition::Taken
            }
            _ => Recognition::Unknown,
        }
    }

    /// Whether `key` is in one of the ranges.
    fn cover(&self, key: K) -> bool {
        let after = self.ranges.partition_point(|&(start, _)| start <= key);
        after > 0 && self.ranges[after - 1].1 >= key
    }

    fn note(&mut self, key: K, fingerprint: u32, gap_s: f64) {
        self.first.get_or_insert(key);
        self.note_recent(key, fingerprint);
        self.note_range(key, gap_s);
    }

    fn note_recent(&mut self, key: K, fingerprint: u32) {
        if self.recent.len() >= MAX_RECENT {
            let oldest = self.recent.front().copied();
            if oldest.is_some_and(|oldest| key < oldest) {
                self.dropped = later(self.dropped, Some(key));
                return;
            }
            self.dropped = later(self.dropped, oldest);
            self.recent.pop_front();
            self.fingerprints.pop_front();
        }
        if self.recent.back().is_none_or(|&newest| key > newest) {
            self.recent.push_back(key);
            self.fingerprints.push_back(fingerprint);
        } else {
            let at = self.recent.partition_point(|&k| k < key);
            self.recent.insert(at, key);
            self.fingerprints.insert(at, fingerprint);
        }
    }

    fn note_range(&mut self, key: K, gap_s: f64) {
        let ranges = &mut self.ranges;
        if let Some((_, end)) = ranges.back_mut().filter(|(_, end)| key > *end)
            && end.joins(key, gap_s)
        {
            *end = key;
            return;
        }
        let after = ranges.partition_point(|&(start, _)| start <= key);
        if after > 0 && ranges[after - 1].1 >= key {
            return;
        }
        let joins_left = after > 0 && ranges[after - 1].1.joins(key, gap_s);
        let joins_right = after < ranges.len() && key.joins(ranges[after].0, gap_s);
        match (joins_left, joins_right) {
            (true, true) => {
                ranges[after - 1].1 = ranges[after].1;
                ranges.remove(after);
            }
            (true, false) => ranges[after - 1].1 = key,
            (false, true) => ranges[after].0 = key,
            (false, false) => ranges.insert(after, (key, key)),
        }
        if ranges.len() > MAX_RANGES {
            self.closed = later(self.closed, Some(ranges[1].0));
            ranges[1].0 = ranges[0].0;
            ranges.pop_front();
        }
    }
}

/// Returns the later of two keys.
fn later<K: Key>(a: Option<K>, b: Option<K>) -> Option<K> {
    if a > b { a } else { b }
}

/// The samples taken so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Ledger {
    by_seq: Keys<u64>,
    by_time: Keys<f64>,
}

impl Ledger {
    /// Returns what is known of `sample`, whose numbers must be finite.
    pub(super) fn recognise(&self, sample: &Sample) -> Recognition {
        let fingerprint = || fingerprint(sample);
        match sample.seq {
            Some(seq) => self.by_seq.recognise(seq, fingerprint),
            None => self.by_time.recognise(sample.t_s, fingerprint),
        }
    }

    /// Notes a new sample. Samples without `seq` that are at most `gap_s` apart are of one
    /// stretch.
    pub(super) fn note(&mut self, sample: &Sample, gap_s: f64) {
        match sample.seq {
            Some(seq) => self.by_seq.note(seq, fingerprint(sample), gap_s),
            None => self.by_time.note(sample.t_s, fingerprint(sample), gap_s),
        }
    }

    /// Whether a new sample can be one that was lost and is sent late: its key is after
    /// the first one taken, and for times in a gap.
    pub(super) fn fits_gap(&self, sample: &Sample) -> bool {
        let t_s = sample.t_s;
        match sample.seq {
            Some(seq) => self.by_seq.first.is_some_and(|first| seq > first),
            None => {
                self.by_time.first.is_some_and(|first| t_s > first) && !self.has_stretch_at(t_s)
            }
        }
    }

    /// Whether the key of a sample is before the first one taken.
    pub(super) fn precedes(&self, sample: &Sample) -> bool {
        match sample.seq {
            Some(seq) => self.by_seq.first.is_some_and(|first| seq < first),
            None => self.by_time.first.is_some_and(|first| sample.t_s < first),
        }
    }

    /// Whether `t_s` lies in a stretch of samples without `seq`, and not in a gap.
    pub(super) fn has_stretch_at(&self, t_s: f64) -> bool {
        self.by_time.cover(t_s)
    }
}

/// Returns a hash of all values of a sample (FNV-1a over 64-bit words, with a final mix).
/// Equal samples have equal fingerprints; −0 equals 0. Of 4 · 10⁹ conflicts, one is taken for
/// a retransmission.
fn fingerprint(sample: &Sample) -> u32 {
    let Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m } = *sample;
    let bits = |value: Option<f64>| value.map_or(u64::MAX, |v| (v + 0.0).to_bits());
    let words = [
        seq.map_or(u64::MAX, |seq| seq),
        bits(Some(t_s)),
        bits(cmd_qx_rad),
        bits(cmd_qy_rad),
        bits(x_m),
        bits(y_m),
    ];
    let hash = words.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
        let mixed = (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        mixed ^ (mixed >> 32)
    });
    (hash.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::collections::{BTreeMap, BTreeSet};
    use proptest::prelude::*;

    fn sample(seq: Option<u64>, t_s: f64, x_m: f64) -> Sample {
        Sample { seq, t_s, x_m: Some(x_m), ..Sample::default() }
    }

    #[test]
    fn the_same_key_with_other_values_is_a_conflict() {
        let mut ledger = Ledger::default();
        for seq in [None, Some(7)] {
            let first = sample(seq, 1.0, 0.1);
            assert_eq!(ledger.recognise(&first), Recognition::New);
            ledger.note(&first, 0.25);
            assert_eq!(ledger.recognise(&first), Recognition::Same);
            assert_eq!(ledger.recognise(&sample(seq, 1.0, 0.2)), Recognition::Conflict);
            let none = Sample { x_m: None, ..first };
            assert_eq!(ledger.recognise(&none), Recognition::Conflict);
        }
        assert_eq!(ledger.recognise(&sample(Some(7), 1.1, 0.1)), Recognition::Conflict, "its time");
    }

    #[test]
    fn every_single_bit_of_the_values_counts() {
        let base = sample(Some(3), 0.5, 0.1);
        let mut seen = BTreeSet::from([fingerprint(&base)]);
        for bit in 0..63 {
            let flip = |v: f64| f64::from_bits(v.to_bits() ^ 1 << bit);
            for changed in [
                Sample { t_s: flip(0.5), ..base },
                Sample { x_m: Some(flip(0.1)), ..base },
                Sample { y_m: Some(flip(0.1)), ..base },
                Sample { cmd_qx_rad: Some(flip(0.1)), ..base },
                Sample { cmd_qy_rad: Some(flip(0.1)), ..base },
                Sample { seq: Some(3 ^ 1 << bit), ..base },
            ] {
                assert!(seen.insert(fingerprint(&changed)), "{changed:?}");
            }
        }
        let (zero, minus) = (sample(None, 0.0, 0.0), sample(None, -0.0, -0.0));
        assert_eq!(fingerprint(&zero), fingerprint(&minus));
    }

    #[test]
    fn a_gap_that_is_filled_late_is_new_however_long_ago() {
        let mut ledger = Ledger::default();
        let t_s = |i: i32| f64::from(i) * 0.01;
        let outage = 1000..16_000;
        for i in (0..40_000).filter(|i| !outage.contains(i)) {
            ledger.note(&sample(None, t_s(i), 0.0), 0.25);
        }
        for i in outage {
            let row = sample(None, t_s(i), 0.0);
            let near_the_end = i > 15_975; // within 0.25 s of what is known
            let expected = if near_the_end { Recognition::Unknown } else { Recognition::New };
            assert_eq!(ledger.recognise(&row), expected, "{i}");
            ledger.note(&row, 0.25);
        }
        assert_eq!(ledger.recognise(&sample(None, t_s(5000), 0.0)), Recognition::Unknown);
    }

    #[test]
    fn what_is_no_longer_remembered_is_never_called_a_duplicate() {
        let mut ledger = Ledger::default();
        for seq in (0..6000).step_by(2) {
            ledger.note(&sample(Some(seq), seq as f64, 0.0), 0.25);
        }
        for seq in (1..6000).step_by(2) {
            let known = ledger.recognise(&sample(Some(seq), seq as f64, 0.0));
            assert!(matches!(known, Recognition::New | Recognition::Unknown), "{seq}: {known:?}");
        }
        for seq in (4000..4900).step_by(2) {
            let known = ledger.recognise(&sample(Some(seq), seq as f64, 0.0));
            assert_eq!(known, Recognition::Taken, "{seq}");
        }
    }

    #[test]
    fn the_first_key_divides_what_is_earlier_from_what_may_have_been_lost() {
        let mut ledger = Ledger::default();
        for sample in [
            sample(Some(5), 1.0, 0.0),
            sample(None, 2.0, 0.0),
            sample(None, 2.2, 0.0),
            sample(None, 10.0, 0.0),
        ] {
            ledger.note(&sample, 0.25);
        }
        let keys = |seq, t_s| {
            let sample = sample(seq, t_s, 0.0);
            (ledger.precedes(&sample), ledger.fits_gap(&sample))
        };
        assert_eq!(
            [4, 5, 6].map(|seq| keys(Some(seq), 0.0)),
            [(true, false), (false, false), (false, true)]
        );
        let at = |t_s| keys(None, t_s);
        assert_eq!([at(1.9), at(2.0), at(2.1)], [(true, false), (false, false), (false, false)]);
        assert_eq!([at(5.0), at(11.0)], [(false, true), (false, true)]);
        // Between two samples that are remembered none was taken.
        assert_eq!(ledger.recognise(&sample(None, 2.1, 0.0)), Recognition::New);
    }

    #[test]
    fn keys_next_to_each_other_are_one_range() {
        let mut ledger = Ledger::default();
        let mut ranges = |keys: &[u64]| {
            keys.iter().for_each(|&seq| ledger.note(&sample(Some(seq), 0.0, 0.0), 0.25));
            ledger.by_seq.ranges.iter().copied().collect::<Vec<_>>()
        };
        assert_eq!(ranges(&[0, 1, 5, 6, 3]), [(0, 1), (3, 3), (5, 6)]);
        assert_eq!(ranges(&[2, 4]), [(0, 6)]);
        assert_eq!(ranges(&[10, 9, 7]), [(0, 7), (9, 10)]);
    }

    #[test]
    fn the_memory_is_bounded_and_forgets_the_oldest() {
        let mut ledger = Ledger::default();
        let row = |seq| sample(Some(seq), 0.0, 0.0);
        for seq in 0..MAX_RECENT as u64 {
            ledger.note(&row(1000 + seq), 0.25);
        }
        // Older than all that are remembered.
        ledger.note(&row(5), 0.25);
        assert_eq!(ledger.recognise(&row(5)), Recognition::Taken);
        for seq in (2000..10_000).step_by(2) {
            ledger.note(&row(seq), 0.25);
        }
        assert_eq!(ledger.by_seq.recent.len(), MAX_RECENT);
        assert_eq!(ledger.by_seq.ranges.len(), MAX_RANGES);
        assert_eq!(ledger.recognise(&row(9998)), Recognition::Same);
    }

    proptest! {
        /// Against a model that remembers everything: what is stated is true.
        #[test]
        fn what_is_said_is_true(
            rows in proptest::collection::vec((any::<bool>(), 0..4000_u16, 0..2_u8), 1..3000),
        ) {
            let (mut ledger, mut truth) = (Ledger::default(), BTreeMap::new());
            for (numbered, key, value) in rows {
                let seq = numbered.then_some(u64::from(key));
                let row = sample(seq, f64::from(key), f64::from(value));
                let known = truth.get(&(numbered, key));
                let expected = match known {
                    None => Recognition::New,
                    Some(&v) if v == value => Recognition::Same,
                    Some(_) => Recognition::Conflict,
                };
                match ledger.recognise(&row) {
                    Recognition::Taken => prop_assert!(known.is_some()),
                    Recognition::Unknown => {}
                    found => prop_assert_eq!(found, expected),
                }
                if known.is_none() {
                    ledger.note(&row, 0.25);
                    truth.insert((numbered, key), value);
                }
            }
        }
    }
}
