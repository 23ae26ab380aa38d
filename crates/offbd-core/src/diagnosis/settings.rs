//! The numbers by which a rig is judged, as named profiles.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::fmt;
use core::str::FromStr;

use super::servo::GATHERED_NATS;
use super::{AxisCalibration, MemoryRules};
use crate::vocabulary::{FaultCode, FaultKind, Invalid, UnknownWord, in_range, positive};

/// A named set of [`Settings`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Profile {
    /// Debounced, gated, noise-aware: for real rigs.
    #[default]
    Default,
    /// The chapter's rule to the letter: enable at 0.08 rad or 0.5 m/s²,
    /// fault at 0.01 m/s², every 0.1 s, no debounce. For teaching.
    Textbook,
}

impl Profile {
    pub const ALL: [Self; 2] = [Self::Default, Self::Textbook];

    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Textbook => "textbook",
        }
    }
}

impl fmt::Display for Profile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Profile {
    type Err = UnknownWord;
    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        Self::ALL.into_iter().find(|p| p.as_str() == word).ok_or_else(|| UnknownWord {
            word: word.to_owned(),
            expected: "default, textbook".to_owned(),
        })
    }
}

/// Periods without a sample that make a gap, where that is longer than `gap_s`.
const GAP_PERIODS: f64 = 4.0;

/// Time for which a step of the readings counts as evidence, beyond the debounce that
/// the owner asks for, s.
const JUMP_S: f64 = 2.0;

/// Longest window that is judged, s: beyond it the ball has crossed the plate.
const LONGEST_WINDOW_S: f64 = 1.0;

/// Noise in the limit, as a share of its floor.
const NOISE_SHARE: f64 = 0.25;

/// What `offbd soak` has measured on healthy rigs, no two alike, with hands and
/// air: so often a year a servo is accused by so many nats, and e times more
/// seldom with every so many more. For true models that would be one; 0.6 to 0.8
/// were found between 6.5 and 8.5, and the tail beyond is heavier.
const SOAKED_NATS: f64 = 7.5;
const SOAKED_PER_YEAR: f64 = 6300.0;
const NATS_PER_E: f64 = 1.0;
/// Evidence that confirms at least, and at most: healthy rigs pass the one some
/// times an hour, and a monitor keeps little more than the other.
const LEAST_NATS: f64 = 6.0;
const MOST_NATS: f64 = 0.9 * GATHERED_NATS;
/// Share of what confirms that makes the test fail.
const SUSPECT_SHARE: f64 = 2.0 / 3.0;

/// What it takes to confirm a fault of a servo against which evidence was found while
/// it was healthy: so many times that, and so many nats more, for the tail is the
/// longer, the worse the twin fits. With 1.7 times and none more, and friction that acts
/// for 0.1 s (`servo`), 2 of 378 healthy runs of real rigs were accused, with these none.
const EVIDENCE_FACTOR: f64 = 2.0;
const EVIDENCE_MARGIN_NATS: f64 = 4.0;

/// How a rig is judged; immutable while a session runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    pub profile: Profile,
    /// Acceleration that the twin's model may leave out, m/s².
    pub twin_accuracy_m_s2: f64,
    /// Length of the acceleration filter, s.
    pub window_s: f64,
    /// Least time between two judgements, s; 0 judges every sample.
    pub period_s: f64,
    /// Missing time beyond which nothing is differenced across, s.
    pub gap_s: f64,
    /// How long a sample may wait for an earlier one, s.
    pub reorder_s: f64,
    /// Continuous failure before the test fails (pending), s.
    pub fail_s: f64,
    /// The same for what the readings themselves show, and for a ball that
    /// stands where it can be nothing else, s.
    pub readings_fail_s: f64,
    /// The same for readings that scatter, s.
    pub noise_fail_s: f64,
    /// Continuous agreement before the test passes, s.
    pub pass_s: f64,
    /// Agreement that takes back all the evidence against a servo, s; for the
    /// other codes, `pass_s` does.
    pub leak_s: f64,
    /// Further failure before it counts as a trip (confirmed), s.
    pub confirm_s: f64,
    /// The same for readings and ball, as above, s.
    pub readings_confirm_s: f64,
    /// How long evidence against a servo must have gathered before its test
    /// fails, s: what the owner asks for, if anything.
    pub gather_s: f64,
    /// Evidence by which a servo's test fails (pending), nats.
    pub suspect_nats: f64,
    /// Evidence that counts as a trip (confirmed), nats.
    pub confirm_nats: f64,
    /// Whether the rig is learnt: what holds its ball when healthy is known.
    pub learnt: bool,
    pub memory: MemoryRules,
}

impl Settings {
    /// The numbers of `profile`.
    #[must_use]
    pub fn of(profile: Profile) -> Self {
        let default = Self {
            profile,
            // A twentieth of the smallest limit that a learnt rig gets.
            twin_accuracy_m_s2: 0.0075,
            window_s: 0.5,
            // What is judged are means over this long.
            period_s: 0.05,
            gap_s: 0.3,
            reorder_s: 0.1,
            // A push by hand shows in the filter for one window.
            fail_s: 0.6,
            // A push shows in no reading by itself, nor does it stop a ball.
            readings_fail_s: 0.3,
            // Two outliers show in the scatter for its memory of 0.4 s.
            noise_fail_s: 0.45,
            pass_s: 1.0,
            // Two hardest pushes confirm nothing unless within half a second.
            leak_s: 3.0,
            confirm_s: 0.2,
            // Two judgements more: no healthy rig that was soaked needed longer.
            readings_confirm_s: 0.1,
            gather_s: 0.0,
            suspect_nats: 10.0,
            confirm_nats: 13.0,
            learnt: false,
            memory: MemoryRules::default(),
        };
        match profile {
            Profile::Default => default,
            Profile::Textbook => Self {
                window_s: 0.3,
                period_s: 0.1,
                twin_accuracy_m_s2: 0.0005,
                fail_s: 0.0,
                readings_fail_s: 0.0,
                noise_fail_s: 0.0,
                pass_s: 0.0,
                leak_s: 0.0,
                confirm_s: 0.0,
                readings_confirm_s: 0.0,
                suspect_nats: f64::INFINITY,
                confirm_nats: f64::INFINITY,
                ..default
            },
        }
    }

    /// Time without a sample beyond which nothing is differenced, of samples `period_s`
    /// apart, s.
    #[must_use]
    pub fn gap_after_s(&self, period_s: f64) -> f64 {
        self.gap_s.max(GAP_PERIODS * period_s)
    }

    /// Time for which a step of the readings counts as evidence, s.
    #[must_use]
    pub fn jump_lasts_s(&self) -> f64 {
        JUMP_S + self.gather_s
    }

    /// The same through the window, s, that `needed_s` says for a share of
    /// noise in the limit: one that is long enough to see small faults through
    /// the noise. Only for a learnt rig, whose noise is known.
    ///
    /// A push shows in a filter for one window: the longer that is, the longer
    /// a failure must last.
    #[must_use]
    pub fn through(&self, needed_s: impl Fn(f64) -> f64) -> Self {
        let window_s = needed_s(NOISE_SHARE).clamp(self.window_s, LONGEST_WINDOW_S);
        let fail_s = (self.fail_s + window_s - self.window_s).max(0.0);
        Self { window_s, fail_s, learnt: true, ..*self }
    }

    /// Evidence that confirms a fault of an axis' servo, nats: more on a rig that
    /// has come near to it while it was healthy.
    #[must_use]
    pub fn confirming_nats(&self, learnt: Option<&AxisCalibration>) -> f64 {
        let most_nats = learnt.map_or(0.0, |l| l.most_nats);
        let beyond = EVIDENCE_FACTOR * most_nats + EVIDENCE_MARGIN_NATS;
        self.confirm_nats.max(beyond.min(MOST_NATS))
    }

    /// Whether a failure of `code` may be confirmed: on a rig that is not learnt
    /// only what no healthy rig shows, and nothing of its servos or its ball.
    #[must_use]
    pub fn confirms(&self, code: FaultCode, kind: Option<FaultKind>) -> bool {
        let known = self.learnt || self.profile == Profile::Textbook;
        known || code == FaultCode::Sensor && kind != Some(FaultKind::Noise)
    }

    /// The same for a wanted number of false alarms per rig and year, in
    /// (0, 1e6]: it sets the evidence that confirms a servo's fault.
    ///
    /// # Errors
    /// [`Invalid`] naming `/diagnostics/false_alarms_per_rig_year`.
    pub fn with_false_alarms(self, per_year: f64) -> Result<Self, Invalid> {
        let per_year = positive("/diagnostics/false_alarms_per_rig_year", per_year, 1e6)?;
        let nats = SOAKED_NATS + NATS_PER_E * (SOAKED_PER_YEAR / per_year).ln();
        let confirm_nats = nats.clamp(LEAST_NATS, MOST_NATS);
        let suspect_nats = self.suspect_nats.min(SUSPECT_SHARE * confirm_nats);
        Ok(Self { confirm_nats, suspect_nats, ..self })
    }

    /// The same with the debounce before a failure set to `fail_s` in [0, 60] s,
    /// for every monitor: servos, ball and sensor.
    ///
    /// # Errors
    /// [`Invalid`] naming `/diagnostics/debounce_s`.
    pub fn with_debounce(self, fail_s: f64) -> Result<Self, Invalid> {
        let fail_s = in_range("/diagnostics/debounce_s", fail_s, 0.0..=60.0)?;
        let (readings_fail_s, noise_fail_s, gather_s) = (fail_s, fail_s, fail_s);
        Ok(Self { fail_s, readings_fail_s, noise_fail_s, gather_s, ..self })
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::of(Profile::Default)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fewer false alarms take more evidence, e times fewer always as much more.
    #[test]
    fn evidence_goes_with_the_false_alarms_wanted() {
        let nats = |n: f64| Settings::default().with_false_alarms(n).unwrap().confirm_nats;
        let e = core::f64::consts::E;
        assert!((nats(10.0) - nats(10.0 * e) - NATS_PER_E).abs() < 1e-9);
        assert!((nats(SOAKED_PER_YEAR) - SOAKED_NATS).abs() < 1e-9);
        assert_eq!((nats(1e6), nats(1e-9)), (LEAST_NATS, MOST_NATS));
        for n in [0.0, -1.0, f64::NAN, 1e7] {
            let error = Settings::default().with_false_alarms(n).unwrap_err();
            assert_eq!(error.element, "/diagnostics/false_alarms_per_rig_year");
        }
    }

    /// A failure must outlast a push through whichever window: by 0.1 s.
    #[test]
    fn the_debounce_goes_with_the_window() {
        let given = Settings::default();
        // Noise that asks for 0.4 s at the full share asks for 4^(2/5) of it
        // at a quarter.
        let long = given.through(|share: f64| 0.4 * share.powf(-0.4));
        assert!((long.window_s - 0.4 * 4.0_f64.powf(0.4)).abs() < 1e-12);
        assert!((long.fail_s - long.window_s - 0.1).abs() < 1e-12);
        assert_eq!(given.through(|_| 9.0).window_s, LONGEST_WINDOW_S);
        assert_eq!(given.through(|_| 0.1).window_s, given.window_s);
    }
}
