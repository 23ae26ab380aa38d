//! The counts of one session, of a rig, or of all rigs; they can be added.

use std::collections::BTreeMap;
use std::fmt::Display;

use super::SESSION_S;

/// Counts by fault code, or by code and kind.
pub(super) type ByName = BTreeMap<String, u64>;

/// Levels of evidence whose exceedances by peaks are counted, nats; chosen.
pub(super) const PEAKS: [f64; 8] = [4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0, 22.0];

/// The counts of a soak, or of a part of it.
#[derive(Clone, Debug, Default)]
pub(super) struct SoakCounts {
    pub n_sessions: u64,
    pub samples: u64,
    /// Number of rigs watched.
    pub n_rigs: u64,
    /// Number of rigs with a false alarm.
    pub n_rigs_alarmed: u64,
    /// Rigs whose calibration was refused, with the reasons; they are not watched.
    pub refusals: Vec<String>,
    /// False alarms by monitor: `CODE:KIND`, or `CODE` without a kind.
    pub confirmations: ByName,
    /// Sessions with a false alarm, by code.
    pub confirmed: ByName,
    /// Sessions with a pending fault and no confirmed one of the same code, by code.
    pub pending: ByName,
    /// Number of peaks of the evidence against a servo at or above each of [`PEAKS`].
    pub peaks: [u64; PEAKS.len()],
    /// Descriptions of the false alarms.
    pub alarms: Vec<String>,
}

impl SoakCounts {
    /// Returns the counts of a rig before its first session.
    pub(super) fn rig() -> Self {
        Self { n_rigs: 1, ..Self::default() }
    }

    /// Returns the counts of a rig whose calibration was refused.
    pub(super) fn refused(name: &str, why: &impl Display) -> Self {
        Self { refusals: vec![format!("{name}: {why}")], ..Self::default() }
    }

    /// Completes the counts of one rig: sets the number of rigs with a false alarm.
    pub(super) fn of_one_rig(mut self) -> Self {
        self.n_rigs_alarmed = u64::from(!self.alarms.is_empty());
        self
    }

    pub(super) fn with(mut self, other: Self) -> Self {
        self.n_sessions += other.n_sessions;
        self.samples += other.samples;
        self.n_rigs += other.n_rigs;
        self.n_rigs_alarmed += other.n_rigs_alarmed;
        self.refusals.extend(other.refusals);
        add(&mut self.confirmations, other.confirmations);
        add(&mut self.confirmed, other.confirmed);
        add(&mut self.pending, other.pending);
        self.peaks.iter_mut().zip(other.peaks).for_each(|(all, one)| *all += one);
        self.alarms.extend(other.alarms);
        self
    }

    /// Counts one peak of the evidence against a servo, nats.
    pub(super) fn peak(&mut self, nats: f64) {
        let reached = self.peaks.iter_mut().zip(PEAKS).filter(|(_, level)| nats >= *level);
        reached.for_each(|(n, _)| *n += 1);
    }

    pub(super) fn rig_days(&self) -> f64 {
        self.n_sessions as f64 * SESSION_S / 86_400.0
    }

    /// Returns `n` per rig-day; `None` if nothing was watched.
    pub(super) fn per_rig_day(&self, n: u64) -> Option<f64> {
        (self.n_sessions > 0).then(|| n as f64 / self.rig_days())
    }
}

fn add(to: &mut ByName, from: ByName) {
    from.into_iter().for_each(|(code, n)| *to.entry(code).or_default() += n);
}
