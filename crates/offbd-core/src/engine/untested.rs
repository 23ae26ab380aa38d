//! Whether so many of the last samples are not judged that the rig counts as not tested.

use super::types::{Rejection, Unjudged};

/// Of the last 32 samples, as many must not be judged for a rig to count as not tested.
/// Chosen: of two devices that send under one name in turns, half of the samples are not
/// judged, at least 11 of any 32 if none sends more than 21 in a row. If one sample in twenty
/// comes late, independently of the others, 11 of 32 do with a probability of 2 in 10 million.
pub const UNTESTED_FROM: u64 = 11;

/// Which of the last samples are not judged.
#[derive(Clone, Debug, Default)]
pub(super) struct LastSamples {
    /// The last 32 samples, the newest in the lowest bit; 1 if it is not judged.
    unjudged: u32,
    /// Unjudged samples since they are so many; 0 if they are not.
    n: u64,
    /// Why the last of them is not judged.
    why: Option<Rejection>,
}

impl LastSamples {
    pub(super) fn note_judged(&mut self) {
        self.push(0);
    }

    pub(super) fn note_unjudged(&mut self, why: Rejection) {
        self.why = Some(why);
        self.push(1);
    }

    /// Notes that the last `n` unjudged samples are judged after all.
    pub(super) fn judge_last(&mut self, n: usize) {
        for _ in 0..n {
            self.unjudged &= self.unjudged.saturating_sub(1);
        }
        self.n = self.n.saturating_sub(n as u64).max(1);
        self.n *= u64::from(self.are_many());
    }

    fn push(&mut self, bit: u32) {
        self.unjudged = self.unjudged << 1 | bit;
        self.n = match (self.are_many(), self.n) {
            (false, _) => 0,
            (true, 0) => UNTESTED_FROM,
            (true, n) => n + u64::from(bit),
        };
    }

    fn are_many(&self) -> bool {
        u64::from(self.unjudged.count_ones()) >= UNTESTED_FROM
    }

    /// The unjudged samples, if they are so many that the rig counts as not tested.
    pub(super) fn unjudged(&self) -> Option<Unjudged> {
        let n = self.n;
        self.why.filter(|_| n > 0).map(|why| Unjudged { n, why })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WHY: Rejection = Rejection::TooOld;

    /// The numbers of unjudged samples after each of the samples, `true` for a judged one.
    fn numbers(samples: impl IntoIterator<Item = bool>) -> Vec<u64> {
        let mut last = LastSamples::default();
        let note = |is_judged| {
            if is_judged {
                last.note_judged()
            } else {
                last.note_unjudged(WHY)
            }
            last.unjudged().map_or(0, |unjudged| unjudged.n)
        };
        samples.into_iter().map(note).collect()
    }

    #[test]
    fn a_rig_is_untested_from_eleven_unjudged_samples_on() {
        let numbers = numbers((0..60).map(|i| i >= 30));
        assert_eq!(numbers[..10], [0; 10]);
        assert_eq!(numbers[10..30], (11..31).collect::<Vec<_>>());
        // Of the last 32, 21 are judged, and then 22.
        assert_eq!(numbers[50], 30);
        assert_eq!(numbers[51..], [0; 9]);
    }

    #[test]
    fn two_devices_that_take_turns_are_untested() {
        for in_a_row in 1..=21 {
            let numbers = numbers((0..1000).map(|i| i / in_a_row % 2 == 0));
            assert!(numbers[64..].iter().all(|&n| n > 0), "{in_a_row} in a row");
        }
    }

    #[test]
    fn samples_that_are_judged_after_all_do_not_count() {
        let mut last = LastSamples::default();
        (0..40).for_each(|_| last.note_unjudged(WHY));
        last.judge_last(3);
        assert_eq!(last.unjudged().map(|unjudged| unjudged.n), Some(37));
        last.judge_last(40);
        assert_eq!(last.unjudged(), None);
        last.judge_last(1);
        assert_eq!(last.unjudged(), None);
        last.note_unjudged(WHY);
        assert_eq!(last.unjudged(), None, "it begins again");
    }

    proptest! {
        /// Ten late samples in a row, and fewer than one in three at other times, are not many.
        #[test]
        fn a_healthy_rig_with_late_samples_is_tested(
            pauses in proptest::collection::vec((22..200_usize, 1..=10_usize), 1..50),
        ) {
            let samples = pauses.iter().flat_map(|&(judged, late)| {
                std::iter::repeat_n(true, judged).chain(std::iter::repeat_n(false, late))
            });
            prop_assert!(numbers(samples).iter().all(|&n| n == 0));
        }
    }
}
