//! Decides whether the data of one rig stay away. Time is an argument; both directions are
//! debounced, so that a rig whose link flaps is lost once, and back once.

use crate::config_section;
use std::time::Duration;

use crate::notifications::micros;
use offbd_store::Micros;

config_section! {
    /// When the data of a rig count as lost, and as back. Chosen: several times the interval of
    /// a device that sends batches every few seconds.
    CommunicationSettings as "communication" |_this| {
        /// Silence of a rig with an open session after which its data count as lost, s.
        lost_after_s: u64 = 30, 1..=86_400;
        /// Time for which data must arrive, without a silence of `lost_after_s`, to count as
        /// back, s.
        back_after_s: u64 = 10, 0..=86_400;
    }
}

/// A change of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LinkChange {
    Lost,
    Back,
}

/// What is known of the link of one rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link {
    /// Arrival of the last data or, before any, the time from which the link waits for them.
    pub(super) seen_at: Micros,
    is_lost: bool,
    /// Arrival of the first data of the present run, while the link is lost.
    arriving_since: Option<Micros>,
}

impl Link {
    /// A link that waits for data from `now` on.
    pub(super) const fn new(now: Micros, is_lost: bool) -> Self {
        Self { seen_at: now, is_lost, arriving_since: None }
    }

    /// Whether the data stay away.
    pub(super) const fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Waits again from `now` on, because the clock has jumped or the process has slept.
    pub(super) fn wait_from(&mut self, now: Micros) {
        self.seen_at = self.seen_at.max(now);
        self.arriving_since = None;
    }

    /// Takes note of the last arrival, if there was one, and returns the change at `now`.
    pub(super) fn advance(
        &mut self,
        now: Micros,
        arrival: Option<Micros>,
        settings: &CommunicationSettings,
    ) -> Option<LinkChange> {
        let arrival = arrival.filter(|&arrival| arrival > self.seen_at);
        self.seen_at = arrival.unwrap_or(self.seen_at);
        let lost_after = micros(Duration::from_secs(settings.lost_after_s));
        let is_silent = now - self.seen_at >= lost_after;
        if !self.is_lost {
            self.is_lost = is_silent;
            return is_silent.then_some(LinkChange::Lost);
        }
        // Judged at the arrival, not at `now`: a look that comes late still sees data that came
        // back for a moment. What was there between the arrivals that two looks see is not known.
        if let Some(arrival) = arrival {
            let run = arrival - *self.arriving_since.get_or_insert(arrival);
            if run >= micros(Duration::from_secs(settings.back_after_s)) {
                (self.is_lost, self.arriving_since) = (false, None);
                return Some(LinkChange::Back);
            }
        }
        if is_silent {
            self.arriving_since = None;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SECOND: Micros = 1_000_000;

    /// Runs a link for `n` seconds, with data in the seconds that `arrives`; returns the
    /// changes with their times in seconds.
    fn changes(n: i64, arrives: impl Fn(i64) -> bool) -> Vec<(i64, LinkChange)> {
        let (settings, mut link) = (CommunicationSettings::default(), Link::new(0, false));
        let mut last = None;
        let mut found = Vec::new();
        for s in 0..n {
            if arrives(s) {
                last = Some(s * SECOND);
            }
            let change = link.advance(s * SECOND, last, &settings);
            found.extend(change.map(|change| (s, change)));
        }
        found
    }

    #[test]
    fn a_silence_is_lost_once_and_back_once() {
        let found = changes(200, |s| s <= 50 || s >= 100);
        assert_eq!(found, [(80, LinkChange::Lost), (110, LinkChange::Back)]);
    }

    #[test]
    fn short_silences_are_none() {
        assert_eq!(changes(500, |s| s % 29 == 0), []);
    }

    /// A batch now and then does not bring a link back, and is not a new loss.
    #[test]
    fn flapping_is_one_loss() {
        let found = changes(1000, |s| s < 10 || s % 40 == 0 || s > 800);
        assert_eq!(found, [(39, LinkChange::Lost), (810, LinkChange::Back)]);
    }

    #[test]
    fn a_rig_that_was_lost_before_a_restart_is_lost_until_data_arrive() {
        let settings = CommunicationSettings::default();
        let mut link = Link::new(0, true);
        for s in 0..100 {
            assert_eq!(link.advance(s * SECOND, None, &settings), None);
        }
        for s in 100..110 {
            assert_eq!(link.advance(s * SECOND, Some(s * SECOND), &settings), None, "{s}");
        }
        let back = link.advance(110 * SECOND, Some(110 * SECOND), &settings);
        assert_eq!(back, Some(LinkChange::Back));
    }

    /// A busy service looks rarely: the data are older than a silence when it sees them.
    #[test]
    fn data_that_a_late_look_finds_are_back_and_then_lost() {
        let settings = CommunicationSettings { lost_after_s: 1, back_after_s: 0 };
        let mut link = Link::new(0, true);
        let back = link.advance(10 * SECOND, Some(5 * SECOND), &settings);
        assert_eq!(back, Some(LinkChange::Back));
        let lost = link.advance(11 * SECOND, Some(5 * SECOND), &settings);
        assert_eq!(lost, Some(LinkChange::Lost));
    }

    /// Every two arrivals that looks see are farther apart than a silence.
    #[test]
    fn data_that_rare_looks_find_again_and_again_are_back() {
        let settings = CommunicationSettings { lost_after_s: 3, back_after_s: 10 };
        let mut link = Link::new(0, true);
        let found: Vec<_> = (1..6)
            .filter_map(|look| link.advance(5 * look * SECOND, Some(5 * look * SECOND), &settings))
            .collect();
        assert_eq!(found, [LinkChange::Back]);
    }

    /// The hour in which the process slept does not count as time with data.
    #[test]
    fn a_jump_of_the_clock_is_not_a_time_with_data() {
        let settings = CommunicationSettings::default();
        let mut link = Link::new(0, true);
        assert_eq!(link.advance(SECOND, Some(SECOND), &settings), None);
        link.wait_from(3600 * SECOND);
        assert_eq!(link.advance(3601 * SECOND, Some(3601 * SECOND), &settings), None);
        let back = link.advance(3611 * SECOND, Some(3611 * SECOND), &settings);
        assert_eq!(back, Some(LinkChange::Back));
    }

    #[test]
    fn a_jump_of_the_clock_is_not_silence() {
        let settings = CommunicationSettings::default();
        let mut link = Link::new(0, false);
        assert_eq!(link.advance(SECOND, Some(SECOND), &settings), None);
        link.wait_from(3600 * SECOND);
        assert_eq!(link.advance(3600 * SECOND, Some(SECOND), &settings), None);
        assert_eq!(link.advance(3630 * SECOND, Some(SECOND), &settings), Some(LinkChange::Lost));
    }

    proptest! {
        /// Whatever arrives: losses and returns alternate, a loss follows 30 s of silence, and
        /// between a loss and the return there are at least 10 s with data.
        #[test]
        fn changes_alternate_and_are_debounced(arrivals in prop::collection::vec(any::<bool>(), 0..400)) {
            let spread: Vec<bool> = arrivals.iter().flat_map(|a| [*a, false, false, false]).collect();
            let found = changes(spread.len() as i64, |s| spread[s as usize]);
            for (i, (at, change)) in found.iter().enumerate() {
                let lost = i % 2 == 0;
                prop_assert_eq!(*change == LinkChange::Lost, lost);
                let from = (at - if lost { 29 } else { 10 }).max(0) as usize;
                let some = spread[from..=*at as usize].iter().any(|arrives| *arrives);
                prop_assert_eq!(some, !lost);
            }
            for pair in found.windows(2) {
                prop_assert!(pair[1].0 - pair[0].0 >= 10);
            }
        }
    }
}
