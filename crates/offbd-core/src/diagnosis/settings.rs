//! The settings of the diagnosis, as named profiles.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::fmt;
use core::str::FromStr;
use serde::{Deserialize, Serialize};

use super::limits::LEAST_FLOOR_M_S2;
use super::servo::{BLOCK_S, MAX_NATS};
use super::{AxisCalibration, MemoryRules};
use crate::vocabulary::{FaultCode, FaultKind, Invalid, UnknownWord, in_range, positive};

/// A named set of [`Settings`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Profile {
    /// Debounced, with enable conditions and noise-dependent limits: for real rigs.
    #[default]
    Default,
    /// The chapter's rule as written: enabled at 0.08 rad or 0.5 m/s², fault at 0.01
    /// m/s², every 0.1 s, no debounce. For teaching.
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

    /// Whether it tests for faults of `code`: that of the book tests the servos only.
    #[must_use]
    pub const fn has_test(self, code: FaultCode) -> bool {
        matches!(self, Self::Default) || code.axis().is_some()
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

/// Sample periods without a sample that make a gap, if longer than `gap_s`. Chosen.
const GAP_PERIODS: f64 = 4.0;
/// Longest interval between samples that is not a gap, s: the longest that the twin
/// computes in one call.
pub const LONGEST_GAP_S: f64 = 5.0;

/// Time for which a jump of the readings counts as evidence, s; the debounce that the
/// owner asks for is added. Chosen.
const JUMP_LASTS_S: f64 = 2.0;

/// Longest estimation window, s: beyond it the ball has crossed the plate.
const LONGEST_WINDOW_S: f64 = 1.0;

/// Part of the limit that is due to noise, as a fraction of its floor. Chosen.
const NOISE_SHARE: f64 = 0.25;

/// `offbd soak` measured on healthy rigs, all different, with pushes and gusts: evidence
/// against a servo beyond this, nats, occurs [`SOAKED_PER_YEAR`] times a year.
const SOAKED_NATS: f64 = 7.5;
/// Rate, per year, at which healthy rigs exceed [`SOAKED_NATS`].
const SOAKED_PER_YEAR: f64 = 6300.0;
/// Further evidence, nats, that makes a false alarm e times rarer. Theory gives 1 for
/// true models; 0.6 to 0.8 were found between 6.5 and 8.5 nats, and the tail beyond is
/// heavier.
const NATS_PER_E: f64 = 1.0;
/// Least evidence that confirms, nats: healthy rigs exceed it some times an hour.
const MIN_CONFIRM_NATS: f64 = 6.0;
/// Most evidence that confirms, nats: the accumulated evidence is limited to little more.
const MAX_CONFIRM_NATS: f64 = 0.9 * MAX_NATS;
/// Evidence that makes the test fail, as a fraction of what confirms. Chosen.
const SUSPECT_SHARE: f64 = 2.0 / 3.0;

/// Factor on the evidence that was found against a healthy servo: with
/// [`EVIDENCE_MARGIN_NATS`] it gives the evidence that confirms a fault of that servo,
/// since the tail is longer, the worse the twin fits. Chosen: the largest that costs little. On the 47
/// simulated rigs of `PATH_SUPPORT_NATS`, factors from 0 to 2 found 274 to 272 of 522 faults and 3
/// found 263, with 3 false alarms each.
const EVIDENCE_FACTOR: f64 = 2.0;
/// Margin added to that evidence, nats.
const EVIDENCE_MARGIN_NATS: f64 = 4.0;

/// How a rig is judged; constant during a session.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub profile: Profile,
    /// Acceleration that the twin's model may neglect, m/s².
    pub twin_accuracy_m_s2: f64,
    /// Length of the estimation window, s.
    pub window_s: f64,
    /// Least time between two judgements, s; 0 judges every sample.
    pub period_s: f64,
    /// Interval without samples that makes a gap, across which nothing is differenced, s.
    pub gap_s: f64,
    /// Longest time for which a sample waits for an earlier one, s.
    pub reorder_s: f64,
    /// Time of failure before the test fails (pending), s.
    pub fail_s: f64,
    /// Time of failure before the test fails for readings, and for a ball that stands
    /// without a rival cause, s.
    pub readings_fail_s: f64,
    /// Time of failure before the test fails for noisy readings, s.
    pub noise_fail_s: f64,
    /// Time of agreement before the test passes, s.
    pub pass_s: f64,
    /// Time of agreement that takes back a full counter of a servo, s; for the other
    /// codes it is `pass_s`.
    pub leak_s: f64,
    /// Further time of failure before it counts as a trip (confirmed), s.
    pub confirm_s: f64,
    /// Further time of failure before it counts as a trip for readings and ball, s.
    pub readings_confirm_s: f64,
    /// Time for which evidence against a servo must have accumulated before its test
    /// fails, s; zero unless the owner asks for it.
    pub gather_s: f64,
    /// Evidence at which a servo's test fails (pending), nats.
    pub suspect_nats: f64,
    /// Evidence that counts as a trip (confirmed), nats. The default 13 comes from
    /// the soak test in docs/benchmarks.md.
    pub confirm_nats: f64,
    /// Whether the rig is calibrated, so that its healthy behaviour is known.
    pub learnt: bool,
    pub memory: MemoryRules,
}

impl Settings {
    /// Returns the settings of `profile`.
    #[must_use]
    pub fn of(profile: Profile) -> Self {
        let default = Self {
            profile,
            // A twentieth of the least limit of a learnt rig.
            twin_accuracy_m_s2: LEAST_FLOOR_M_S2 / 20.0,
            window_s: 0.5,
            // Servo evidence is computed from means over this time.
            period_s: BLOCK_S,
            gap_s: 0.3,
            reorder_s: 0.1,
            // The estimate shows a push by hand for one window (`window_s`); 0.1 s are added.
            fail_s: 0.6,
            // A push neither shows in the readings themselves nor stops a ball.
            readings_fail_s: 0.3,
            // Two outliers show in the scatter for its time constant of 0.4 s.
            noise_fail_s: 0.45,
            pass_s: 1.0,
            // Two hardest pushes confirm nothing unless within half a second.
            leak_s: 3.0,
            confirm_s: 0.2,
            // Two more judgements: no healthy rig of `offbd soak` needed longer.
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

    /// Returns the interval without a sample that makes a gap, s, for samples `period_s`
    /// apart; at most [`LONGEST_GAP_S`].
    #[must_use]
    pub fn gap_after_s(&self, period_s: f64) -> f64 {
        self.gap_s.max(GAP_PERIODS * period_s).min(LONGEST_GAP_S)
    }

    /// Time for which a jump of the readings counts as evidence, s.
    #[must_use]
    pub fn jump_lasts_s(&self) -> f64 {
        JUMP_LASTS_S + self.gather_s
    }

    /// Returns the settings with the window, s, that `needed_s` gives for a fraction of
    /// noise in the limit: long enough to see small faults through the noise. Only for a
    /// learnt rig, whose noise is known.
    ///
    /// A push shows in the estimate for one window, so the debounce is extended with the
    /// window.
    #[must_use]
    pub fn with_window(&self, needed_s: impl Fn(f64) -> f64) -> Self {
        let window_s = needed_s(NOISE_SHARE).clamp(self.window_s, LONGEST_WINDOW_S);
        let fail_s = (self.fail_s + window_s - self.window_s).max(0.0);
        Self { window_s, fail_s, learnt: true, ..*self }
    }

    /// Returns the evidence that confirms a fault of an axis' servo, nats: more on a rig
    /// that came near to it while healthy.
    #[must_use]
    pub fn confirming_nats(&self, learnt: Option<&AxisCalibration>) -> f64 {
        let most_nats = learnt.map_or(0.0, |l| l.most_nats);
        let beyond = EVIDENCE_FACTOR * most_nats + EVIDENCE_MARGIN_NATS;
        self.confirm_nats.max(beyond.min(MAX_CONFIRM_NATS))
    }

    /// Whether a failure of `code` may be confirmed. On a rig that is not learnt only
    /// sensor faults other than noise are, which no healthy rig shows.
    #[must_use]
    pub fn confirms(&self, code: FaultCode, kind: Option<FaultKind>) -> bool {
        let known = self.learnt || self.profile == Profile::Textbook;
        known || code == FaultCode::Sensor && kind != Some(FaultKind::Noise)
    }

    /// Sets the evidence that confirms a servo's fault for a wanted number of false
    /// alarms per rig and year, in (0, 1e6].
    ///
    /// # Errors
    /// [`Invalid`] naming `/diagnostics/false_alarms_per_rig_year`.
    pub fn with_false_alarms(self, per_year: f64) -> Result<Self, Invalid> {
        let per_year = positive("/diagnostics/false_alarms_per_rig_year", per_year, 1e6)?;
        let nats = SOAKED_NATS + NATS_PER_E * (SOAKED_PER_YEAR / per_year).ln();
        let confirm_nats = nats.clamp(MIN_CONFIRM_NATS, MAX_CONFIRM_NATS);
        let suspect_nats = self.suspect_nats.min(SUSPECT_SHARE * confirm_nats);
        Ok(Self { confirm_nats, suspect_nats, ..self })
    }

    /// Sets the debounce before a failure to `fail_s` in [0, 60] s for every monitor.
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

    /// Fewer false alarms require more evidence: e times fewer always the same amount
    /// more.
    #[test]
    fn evidence_goes_with_the_false_alarms_wanted() {
        let nats = |n: f64| Settings::default().with_false_alarms(n).unwrap().confirm_nats;
        let e = core::f64::consts::E;
        assert!((nats(10.0) - nats(10.0 * e) - NATS_PER_E).abs() < 1e-9);
        assert!((nats(SOAKED_PER_YEAR) - SOAKED_NATS).abs() < 1e-9);
        assert_eq!((nats(1e6), nats(1e-9)), (MIN_CONFIRM_NATS, MAX_CONFIRM_NATS));
        for n in [0.0, -1.0, f64::NAN, 1e7] {
            let error = Settings::default().with_false_alarms(n).unwrap_err();
            assert_eq!(error.element, "/diagnostics/false_alarms_per_rig_year");
        }
    }

    /// With any window a failure must outlast a push by 0.1 s.
    #[test]
    fn the_debounce_goes_with_the_window() {
        let given = Settings::default();
        // Noise that needs 0.4 s at the full share needs 4^(2/5) times that at a quarter.
        let long = given.with_window(|share: f64| 0.4 * share.powf(-0.4));
        assert!((long.window_s - 0.4 * 4.0_f64.powf(0.4)).abs() < 1e-12);
        assert!((long.fail_s - long.window_s - 0.1).abs() < 1e-12);
        assert_eq!(given.with_window(|_| 9.0).window_s, LONGEST_WINDOW_S);
        assert_eq!(given.with_window(|_| 0.1).window_s, given.window_s);
    }
}
