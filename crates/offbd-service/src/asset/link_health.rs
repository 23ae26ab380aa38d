//! How the samples of an asset arrive: rate, spacing, gaps, delay, duplicates and rows that are
//! not judged, since the session began and in the last minutes.
//!
//! Arithmetic over times that are passed in, in bounded memory. It is not part of an engine or
//! of a verdict, is not stored, and begins again when the asset is loaded.

use std::ops::RangeInclusive;

use super::link_tally::{LinkTally, Spread};
use crate::clock::rfc3339;
use offbd_store::Micros;
use offbd_wire::link::LinkView;
use offbd_wire::telemetry::UnknownKeyView;
use offbd_wire::words::UnjudgedWord;

/// Minutes of which the last ones consist, with the present one.
const RECENT_MINUTES: usize = 5;

const MINUTE: Micros = 60_000_000;

/// How the samples of an asset arrive. Boxed: most assets of a fleet may be silent.
#[derive(Debug, Default)]
pub(super) struct LinkHealth(Option<Box<Counted>>);

#[derive(Debug, Default)]
struct Counted {
    /// Id of the session that is counted; empty before the first sample.
    session: String,
    /// Since when it is counted.
    since: Micros,
    /// Latest time of its samples, s on the device's clock.
    newest_t_s: Option<f64>,
    doubted: Option<DoubtedRun>,
    /// The interval without a sample that makes a gap, s.
    gap_s: Option<f64>,
    clock_offset_s: Option<f64>,
    whole: LinkTally,
    /// The keys that are not understood of the last batch that has any, and when it arrived.
    unknown: Option<Box<(Micros, Vec<UnknownKeyView>)>>,
    /// The tally of each of the last minutes, at the minute modulo their number.
    recent: [(Micros, LinkTally); RECENT_MINUTES],
}

/// The last samples, while the engine doubts their times: after a gap or a step of the clock, until
/// the next samples confirm them.
#[derive(Clone, Copy, Debug)]
struct DoubtedRun {
    first_t_s: f64,
    last_t_s: f64,
    spacing: Spread,
}

impl DoubtedRun {
    /// The time from its last sample to one at `t_s` that continues it.
    fn continued_at(&self, t_s: f64, gap_s: f64) -> Option<f64> {
        let step_s = t_s - self.last_t_s;
        (step_s > 0.0 && step_s <= gap_s).then_some(step_s)
    }
}

impl Counted {
    /// Counts the step to a sample at `t_s`, which becomes the latest.
    fn step_to(&mut self, t_s: f64, at: Micros) {
        let gap_s = self.gap_s.unwrap_or(f64::INFINITY);
        let step_s = self.newest_t_s.map(|newest_s| t_s - newest_s);
        // The clock was set back.
        let step_s = step_s.filter(|step_s| *step_s >= -gap_s);
        if step_s.is_none_or(|step_s| step_s > 0.0) {
            self.newest_t_s = Some(t_s);
        }
        if let Some(step_s) = step_s {
            self.tallies(at).into_iter().for_each(|tally| tally.step(step_s, gap_s));
        }
    }

    /// The tallies that count what arrives at `at`: that of the session and that of the minute.
    fn tallies(&mut self, at: Micros) -> [&mut LinkTally; 2] {
        let minute = minute(at);
        let slot = &mut self.recent[minute.rem_euclid(RECENT_MINUTES as Micros) as usize];
        if slot.0 != minute {
            *slot = (minute, LinkTally::default());
        }
        [&mut self.whole, &mut slot.1]
    }
}

impl LinkHealth {
    fn counted(&mut self, at: Micros) -> &mut Counted {
        self.0.get_or_insert_with(|| Box::new(Counted { since: at, ..Counted::default() }))
    }

    /// Counts for `session` from now on, in which a longer interval than `gap_s` is a gap.
    /// Another session than before begins at `at`; the last minutes go on.
    pub(super) fn follow(&mut self, session: &str, gap_s: f64, at: Micros) {
        let counted = self.counted(at);
        if counted.session != session {
            let (recent, unknown) = (counted.recent, counted.unknown.take());
            *counted = Counted {
                session: session.to_owned(),
                since: at,
                gap_s: Some(gap_s),
                recent,
                unknown,
                ..Counted::default()
            };
        }
    }

    /// Counts a recorded sample with the time `t_s` that arrives at `at`.
    pub(super) fn sample(&mut self, t_s: f64, at: Micros) {
        let counted = self.counted(at);
        let gap_s = counted.gap_s.unwrap_or(f64::INFINITY);
        counted.tallies(at).into_iter().for_each(LinkTally::sample);
        let run = counted.doubted.take();
        if let Some(run) = run.filter(|run| run.continued_at(t_s, gap_s).is_some()) {
            counted.step_to(run.first_t_s, at);
            counted.newest_t_s = Some(run.last_t_s);
            counted.tallies(at).into_iter().for_each(|tally| tally.spacings(&run.spacing));
        }
        counted.step_to(t_s, at);
    }

    /// Counts a recorded sample whose time is doubted until the next ones confirm it.
    pub(super) fn doubted_sample(&mut self, t_s: f64, at: Micros) {
        let counted = self.counted(at);
        let gap_s = counted.gap_s.unwrap_or(f64::INFINITY);
        counted.tallies(at).into_iter().for_each(LinkTally::sample);
        let new = DoubtedRun { first_t_s: t_s, last_t_s: t_s, spacing: Spread::default() };
        let run = counted.doubted.get_or_insert(new);
        match run.continued_at(t_s, gap_s) {
            Some(step_s) => {
                run.spacing.add(step_s);
                run.last_t_s = t_s;
            }
            None => *run = new,
        }
    }

    /// Counts a recorded sample that came too late to be in any spacing.
    pub(super) fn late_sample(&mut self, at: Micros) {
        self.counted(at).tallies(at).into_iter().for_each(LinkTally::sample);
    }

    /// Counts a batch with a sample that is `delay_s` later than the fastest one of the session,
    /// for which the service's clock is `clock_offset_s` ahead of the device's.
    pub(super) fn batch(&mut self, delay_s: f64, clock_offset_s: f64, at: Micros) {
        let counted = self.counted(at);
        counted.clock_offset_s = Some(clock_offset_s);
        counted.tallies(at).into_iter().for_each(|tally| tally.batch(delay_s));
    }

    /// Counts `n` rows that were recorded already.
    pub(super) fn duplicates(&mut self, n: usize, at: Micros) {
        self.counted(at).tallies(at).into_iter().for_each(|tally| tally.duplicates(n));
    }

    /// Counts `n` rows that are not judged.
    pub(super) fn unjudged(&mut self, reason: UnjudgedWord, n: u64, at: Micros) {
        self.counted(at).tallies(at).into_iter().for_each(|tally| tally.unjudged(reason, n));
    }

    /// Notes the keys of a batch that are not understood, if it has any.
    pub(super) fn unknown(&mut self, keys: Vec<UnknownKeyView>, at: Micros) {
        if !keys.is_empty() {
            self.counted(at).unknown = Some(Box::new((at, keys)));
        }
    }

    /// Returns the view of `asset`, whose file states the rate `expected_rate_hz`, at `now`.
    pub(super) fn view(&self, asset: &str, expected_rate_hz: f64, now: Micros) -> LinkView {
        let counted = self.0.as_deref();
        let of_session = counted.filter(|counted| !counted.session.is_empty());
        LinkView {
            asset: asset.to_owned(),
            session_id: of_session.map(|counted| counted.session.clone()),
            expected_rate_hz,
            gap_s: of_session.and_then(|counted| counted.gap_s),
            clock_offset_s: of_session.and_then(|counted| counted.clock_offset_s),
            session: of_session.map(|counted| counted.whole.view(rfc3339(counted.since))),
            recent: counted.and_then(|counted| {
                let (first, recent) = recent(counted, now)?;
                Some(recent.view(rfc3339(first * MINUTE)))
            }),
            unknown: counted.map(|counted| unknown(counted, now)).unwrap_or_default(),
        }
    }
}

/// Returns the keys that are not understood of the last batch that has any, if it arrived in the last
/// minutes at `now`.
fn unknown(counted: &Counted, now: Micros) -> Vec<UnknownKeyView> {
    let recent = counted.unknown.as_deref().filter(|(at, _)| minutes(now).contains(&minute(*at)));
    recent.map(|(_, keys)| keys.clone()).unwrap_or_default()
}

const fn minute(at: Micros) -> Micros {
    at.div_euclid(MINUTE)
}

/// The last minutes at `now`.
const fn minutes(now: Micros) -> RangeInclusive<Micros> {
    let last = minute(now);
    last - (RECENT_MINUTES as Micros - 1)..=last
}

/// Returns the tally of the last minutes at `now`, and the first of them; `None` if nothing has
/// arrived. Minutes of a clock that has been set back since are left out.
fn recent(counted: &Counted, now: Micros) -> Option<(Micros, LinkTally)> {
    let last = minutes(now);
    let found = counted.recent.iter().filter(|(minute, _)| last.contains(minute));
    let sum = found.fold(LinkTally::default(), |sum, (_, tally)| sum.plus(tally));
    (sum != LinkTally::default()).then_some((*last.start(), sum))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Time of arrival in s.
    fn at(s: f64) -> Micros {
        1_800_000_000_000_000 + (s * 1e6) as Micros
    }

    fn counted(rows: &[(f64, f64)]) -> LinkHealth {
        let mut health = LinkHealth::default();
        for (arrival_s, t_s) in rows {
            health.follow("s", 0.3, at(*arrival_s));
            health.sample(*t_s, at(*arrival_s));
        }
        health
    }

    /// Ten thousand assets are held.
    #[test]
    fn a_link_is_small() {
        assert!(size_of::<LinkHealth>() == 8 && size_of::<Counted>() < 1000);
    }

    #[test]
    fn a_session_is_counted_by_itself_and_the_last_minutes_go_on() {
        let mut health = counted(&[(0.0, 5.0), (1.0, 5.25), (2.0, 5.5)]);
        health.batch(0.5, 1e9, at(2.0));
        health.follow("other", 0.5, at(3.0));
        health.sample(0.0, at(3.0));
        let view = health.view("a", 100.0, at(4.0));
        let (session, recent) = (view.session.unwrap(), view.recent.unwrap());
        assert_eq!((view.session_id.as_deref(), view.gap_s), (Some("other"), Some(0.5)));
        assert_eq!((session.samples, session.spacing_s, session.batches), (1, None, 0));
        assert_eq!(view.clock_offset_s, None, "another session may have another clock");
        assert_eq!((recent.samples, recent.spacing_s, recent.batches), (4, Some(0.25), 1));
    }

    #[test]
    fn the_last_minutes_end_and_a_clock_that_is_set_back_hides_none() {
        let mut health = counted(&[(0.0, 0.0), (300.0, 300.0)]);
        let samples = |health: &LinkHealth, s| {
            health.view("a", 100.0, at(s)).recent.map(|recent| recent.samples)
        };
        assert_eq!(samples(&health, 300.0), Some(1));
        assert_eq!(samples(&health, 539.0), Some(1));
        assert_eq!(samples(&health, 600.0), None);
        health.sample(301.0, at(-3600.0));
        assert_eq!(samples(&health, -3600.0), Some(1));
        assert_eq!(health.view("a", 100.0, at(0.0)).session.unwrap().samples, 3);
    }

    #[test]
    fn keys_that_are_not_understood_are_told_for_some_minutes() {
        let key = |key: &str| UnknownKeyView { key: key.to_owned(), meant: None };
        let mut health = counted(&[(0.0, 0.0)]);
        health.unknown(vec![key("ball")], at(0.0));
        health.unknown(Vec::new(), at(1.0));
        health.follow("other", 0.3, at(2.0));
        let told = |health: &LinkHealth, s| health.view("a", 100.0, at(s)).unknown;
        assert_eq!(told(&health, 2.0), [key("ball")]);
        assert_eq!(told(&health, 600.0), []);
        health.unknown(vec![key("plate")], at(3.0));
        assert_eq!(told(&health, 4.0), [key("plate")]);
    }

    #[test]
    fn nothing_is_told_of_an_asset_that_has_sent_nothing() {
        let view = LinkHealth::default().view("a", 50.0, at(0.0));
        assert_eq!((view.session_id, view.session, view.recent), (None, None, None));
        let mut health = LinkHealth::default();
        health.unjudged(UnjudgedWord::Form, 3, at(0.0));
        let view = health.view("a", 50.0, at(0.0));
        assert_eq!(view.session, None);
        assert_eq!(view.recent.unwrap().unjudged[0].rows, 3);
    }

    #[test]
    fn a_clock_that_is_set_back_makes_no_gap_and_is_followed() {
        let health = counted(&[(0.0, 100.0), (0.1, 100.1), (0.2, 0.0), (0.3, 0.1), (0.4, 0.2)]);
        let session = health.view("a", 10.0, at(1.0)).session.unwrap();
        assert_eq!((session.gaps, session.unordered), (0, 0));
        assert!((session.spacing_s.unwrap() - 0.1).abs() < 1e-9);
    }

    #[test]
    fn samples_whose_time_was_doubted_count_once_it_is_confirmed() {
        let mut health = counted(&[(0.0, 1.0), (0.25, 1.25)]);
        // A wrong time, and then samples after a gap.
        for (t_s, is_doubted) in
            [(900.0, true), (1.5, false), (3.0, true), (3.25, true), (3.5, false), (3.75, false)]
        {
            let add = if is_doubted { LinkHealth::doubted_sample } else { LinkHealth::sample };
            add(&mut health, t_s, at(1.0));
        }
        let session = health.view("a", 4.0, at(1.0)).session.unwrap();
        assert_eq!((session.samples, session.gaps, session.longest_gap_s), (8, 1, Some(1.5)));
        assert_eq!((session.spacing_s, session.jitter_s), (Some(0.25), Some(0.0)));
        assert_eq!(session.unordered, 0);
    }

    proptest! {
        #[test]
        fn all_numbers_are_those_of_a_direct_computation(
            // Of the device's clock and of the arrival, s.
            steps in prop::collection::vec((-0.25..1.0_f64, 0.0..40.0_f64), 2..200),
        ) {
            let mut rows = vec![(0.0, 0.0)];
            for (step_s, wait_s) in &steps {
                let (arrival_s, t_s) = *rows.last().unwrap();
                rows.push((arrival_s + wait_s, t_s + step_s));
            }
            let now = rows.last().unwrap().0;
            let view = counted(&rows).view("a", 100.0, at(now));
            let first_minute = (now / 60.0).floor() - 4.0;
            let is_recent = |arrival_s: f64| (arrival_s / 60.0).floor() >= first_minute;
            for (found, is_whole) in [(view.session.unwrap(), true), (view.recent.unwrap(), false)] {
                let mut newest = f64::NEG_INFINITY;
                let (mut n, mut unordered, mut spacings, mut gaps) = (0, 0, vec![], vec![]);
                for &(arrival_s, t_s) in &rows {
                    let counts = is_whole || is_recent(arrival_s);
                    let step_s = t_s - newest;
                    n += u64::from(counts);
                    let is_set_back = step_s < -0.3;
                    unordered += u64::from(counts && step_s <= 0.0 && !is_set_back);
                    if counts && step_s > 0.0 && step_s.is_finite() {
                        if step_s > 0.3 { gaps.push(step_s) } else { spacings.push(step_s) }
                    }
                    newest = if is_set_back { t_s } else { newest.max(t_s) };
                }
                prop_assert_eq!((found.samples, found.unordered), (n, unordered));
                prop_assert_eq!(found.gaps, gaps.len() as u64);
                prop_assert!((found.gaps_s - gaps.iter().sum::<f64>()).abs() < 1e-9);
                prop_assert_eq!(found.longest_gap_s, gaps.iter().copied().reduce(f64::max));
                let count = spacings.len() as f64;
                let mean = spacings.iter().sum::<f64>() / count;
                let squares: f64 = spacings.iter().map(|s| (s - mean).powi(2)).sum();
                let near = |found: Option<f64>, n_needed: usize, expected: f64| match found {
                    Some(found) => (found - expected).abs() < 1e-9 * expected.max(1.0),
                    None => spacings.len() < n_needed,
                };
                prop_assert!(near(found.spacing_s, 1, mean), "{:?} {}", found.spacing_s, mean);
                prop_assert!(near(found.rate_hz, 1, 1.0 / mean));
                prop_assert!(near(found.jitter_s, 2, (squares / (count - 1.0)).sqrt()));
            }
        }
    }
}
