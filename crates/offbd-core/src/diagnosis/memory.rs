//! The fault memory of one rig: per code the status byte, the trip, healing and aging
//! counters, occurrences, the freeze frame, whether it has been acknowledged, and how
//! often its monitor could judge.
//!
//! One session is one operation cycle. Independent of sensors and limits: its inputs are
//! FAILED, PASSED, and the start and end of a cycle.

use super::{Evidence, Suspicion};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{FaultCode, FaultKind, FaultStatus, SimTime};
use serde::{Deserialize, Serialize};

use super::StatusByte;

/// When a fault counts as confirmed, healed and aged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemoryRules {
    /// Number of operation cycles with a trip after which bit 3 (confirmedDTC) is set; at least 1.
    pub confirmation_threshold: u8,
    /// Whether confirmation requests the warning indicator (bit 7).
    pub indicator: bool,
    /// Good cycles until the indicator is switched off; ≥ 1.
    pub healing_cycles: u8,
    /// Further good cycles until the stored data is erased; ≥ 1.
    pub aging_cycles: u8,
}

impl Default for MemoryRules {
    /// Confirm in the first cycle, no indicator, heal after 3 good cycles and
    /// age after 40 more: the counts of OBD II (SAE J2012, 40 warm-up cycles).
    fn default() -> Self {
        Self { confirmation_threshold: 1, indicator: false, healing_cycles: 3, aging_cycles: 40 }
    }
}

/// How often a monitor could have found its fault: the in-use performance ratio of SAE
/// J1979. Neither clearing nor aging erases it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InUse {
    /// Operation cycles that have ended.
    pub cycles: u32,
    /// Cycles with enough data to judge.
    pub with_data: u32,
    /// Cycles in which the monitor was enabled for long enough to find a fault.
    pub judged: u32,
}

impl InUse {
    /// Data that a cycle must bring, in multiples of the time that a fault takes to be
    /// confirmed: an enable condition that holds for a tenth of the time suffices, a
    /// stricter one shows as a low ratio. Chosen, not measured.
    const DATA_FACTOR: f64 = 10.0;

    /// Counts a cycle with `data_s` seconds of data and the monitor enabled for
    /// `judged_s` of them, for a fault that takes `needed_s` to be confirmed. A judged
    /// cycle always counts as one with data, so that `judged` ≤ `with_data` ≤ `cycles`.
    pub fn count(&mut self, data_s: f64, judged_s: f64, needed_s: f64) {
        let judged = Self::judges(judged_s, needed_s);
        let with_data = judged || (data_s > 0.0 && data_s >= Self::DATA_FACTOR * needed_s);
        self.cycles = self.cycles.saturating_add(1);
        self.with_data = self.with_data.saturating_add(u32::from(with_data));
        self.judged = self.judged.saturating_add(u32::from(judged));
    }

    /// Whether `judged_s` seconds of judging suffice to find a fault that takes
    /// `needed_s` to be confirmed.
    #[must_use]
    pub fn judges(judged_s: f64, needed_s: f64) -> bool {
        judged_s > 0.0 && judged_s >= needed_s
    }

    /// Judged cycles over cycles with data, 0 to 1; `None` if there are none.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        (self.with_data > 0).then(|| f64::from(self.judged) / f64::from(self.with_data))
    }
}

/// The record of one code.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaultRecord {
    pub status: StatusByte,
    /// Cycles in which the failure lasted for long enough to count as a trip.
    pub trips: u8,
    /// Whether this cycle has already counted as a trip.
    pub tripped_this_cycle: bool,
    /// Consecutive good cycles since the last failure.
    pub good_cycles: u8,
    /// Whether enough good cycles have followed; reset by a failure.
    pub healed: bool,
    /// Transitions of the test from not failed to failed since the last clear.
    pub occurrences: u32,
    /// Onset of the first occurrence, on the clock of its session.
    pub first_onset: Option<SimTime>,
    /// Onset of the last occurrence, on the clock of its session.
    pub last_onset: Option<SimTime>,
    /// Operation cycles with a failure since the last clear.
    pub failed_cycles: u32,
    /// Whether the current occurrence has been acknowledged.
    pub acknowledged: bool,
    /// The suspicion when the test last failed. Boxed: most records have none, and every
    /// asset has several.
    pub suspicion: Option<Box<Suspicion>>,
    /// The evidence at the first failure of the current occurrence. Boxed likewise.
    pub freeze_frame: Option<Box<Evidence>>,
    /// How often the monitor could judge.
    pub in_use: InUse,
}

impl FaultRecord {
    /// Good cycles counted towards healing.
    #[must_use]
    pub fn healing_counter(&self, rules: &MemoryRules) -> u8 {
        if self.status.confirmed() { self.good_cycles.min(rules.healing_cycles) } else { 0 }
    }

    /// Good cycles after healing, counted towards aging.
    #[must_use]
    pub fn aging_counter(&self, rules: &MemoryRules) -> u8 {
        let past = self.good_cycles.saturating_sub(rules.healing_cycles);
        if self.status.confirmed() { past.min(rules.aging_cycles) } else { 0 }
    }

    /// Returns an empty record with `status` and the monitor's in-use counts.
    fn erased(&self, status: StatusByte) -> Self {
        Self { status, in_use: self.in_use, ..Self::default() }
    }

    /// The state that the status byte stands for.
    #[must_use]
    pub const fn word(&self) -> FaultStatus {
        if self.healed && self.status.confirmed() {
            FaultStatus::Healed
        } else if self.status.confirmed() {
            FaultStatus::Confirmed
        } else if self.status.pending() {
            FaultStatus::Pending
        } else {
            FaultStatus::Cleared
        }
    }

    /// The last suspected kind, if the evidence told one.
    #[must_use]
    pub fn kind(&self) -> Option<FaultKind> {
        self.suspicion.as_ref().and_then(|s| s.kind)
    }
}

/// The fault memory of one rig: a record per code.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaultMemory {
    records: [FaultRecord; FaultCode::COUNT],
}

impl FaultMemory {
    /// The record of `code`.
    #[must_use]
    pub const fn record(&self, code: FaultCode) -> &FaultRecord {
        &self.records[code as usize]
    }

    /// Replaces the record of `code`, as when read from a store.
    #[must_use]
    pub fn with(mut self, code: FaultCode, record: FaultRecord) -> Self {
        self.records[code as usize] = record;
        self
    }

    const fn record_mut(&mut self, code: FaultCode) -> &mut FaultRecord {
        &mut self.records[code as usize]
    }

    /// Takes FAILED for `code`. Returns whether the byte changed.
    pub fn failed(&mut self, code: FaultCode, suspicion: &Suspicion, frame: &Evidence) -> bool {
        let record = self.record_mut(code);
        let before = record.status;
        if !before.test_failed() {
            record.occurrences = record.occurrences.saturating_add(1);
            record.acknowledged = false;
            record.freeze_frame = Some(Box::new(frame.clone()));
            record.last_onset = suspicion.onset;
            if record.occurrences == 1 {
                record.first_onset = suspicion.onset;
            }
        }
        if !before.failed_this_cycle() {
            record.failed_cycles = record.failed_cycles.saturating_add(1);
        }
        record.suspicion = Some(Box::new(suspicion.clone()));
        record.good_cycles = 0;
        record.healed = false;
        record.status.failed();
        record.status != before
    }

    /// Takes a trip: the failure has lasted for long enough to count for this cycle.
    /// Returns whether the byte changed.
    pub fn trip(&mut self, code: FaultCode, suspicion: &Suspicion, rules: &MemoryRules) -> bool {
        let record = self.record_mut(code);
        let before = record.status;
        record.suspicion = Some(Box::new(suspicion.clone()));
        if !record.tripped_this_cycle {
            record.tripped_this_cycle = true;
            record.trips = record.trips.saturating_add(1);
        }
        if record.trips >= rules.confirmation_threshold {
            record.status.confirm(rules.indicator);
        }
        record.status != before
    }

    /// Whether the kind of `code` may change: its fault is confirmed and goes on.
    #[must_use]
    pub const fn goes_on(&self, code: FaultCode) -> bool {
        let status = self.record(code).status;
        status.test_failed() && status.confirmed()
    }

    /// Takes the `suspicion` of a confirmed fault that goes on. A kind replaces one that is unknown,
    /// and a sure one replaces one that is only probable, or any other of a servo, whose kinds are
    /// weighed against each other. As long as the kind is not sure, the weights of the candidates
    /// are the present ones. Returns whether the record has another kind, or is sure of it now.
    pub fn revise(&mut self, code: FaultCode, suspicion: &Suspicion) -> bool {
        let goes_on = self.goes_on(code);
        let Some(known) = self.record_mut(code).suspicion.as_deref_mut().filter(|_| goes_on) else {
            return false;
        };
        let is_other = suspicion.kind.is_some() && suspicion.kind != known.kind;
        let (was_sure, is_sure) = (known.is_sure(), suspicion.is_sure());
        let is_weighed = code.axis().is_some();
        let is_surer = is_sure && (!was_sure || is_other && is_weighed);
        let told = is_surer || is_other && known.kind.is_none();
        if told || !was_sure && suspicion.kind == known.kind {
            known.clone_from(suspicion);
        }
        told
    }

    /// Takes PASSED for `code`. Returns whether the byte changed.
    pub fn passed(&mut self, code: FaultCode) -> bool {
        let record = self.record_mut(code);
        let before = record.status;
        record.status.passed();
        record.status != before
    }

    /// Starts a new operation cycle for every code.
    pub fn start_cycle(&mut self) {
        for record in &mut self.records {
            record.status.start_cycle();
            record.tripped_this_cycle = false;
        }
    }

    /// Ends the operation cycle: clears pending, advances healing and aging.
    pub fn end_cycle(&mut self, rules: &MemoryRules) {
        for record in &mut self.records {
            if !record.status.end_cycle() {
                continue;
            }
            record.trips = if record.status.confirmed() { record.trips } else { 0 };
            record.good_cycles = record.good_cycles.saturating_add(1);
            if !record.status.confirmed() {
                continue;
            }
            if record.good_cycles >= rules.healing_cycles {
                record.status.heal();
                record.healed = true;
            }
            if record.good_cycles >= rules.healing_cycles.saturating_add(rules.aging_cycles) {
                record.status.age();
                *record = record.erased(record.status);
            }
        }
    }

    /// Counts how much of the ending cycle `code` could be judged; see [`InUse::count`].
    pub fn count_use(&mut self, code: FaultCode, data_s: f64, judged_s: f64, needed_s: f64) {
        self.record_mut(code).in_use.count(data_s, judged_s, needed_s);
    }

    /// Clears `code`: all its data are erased except for how often its monitor could
    /// judge, as in SAE J1979.
    pub fn clear(&mut self, code: FaultCode) {
        let record = self.record_mut(code);
        *record = record.erased(StatusByte::default());
    }

    /// Marks the current occurrence of `code` as acknowledged by a person. Returns
    /// whether there was one.
    pub fn acknowledge(&mut self, code: FaultCode) -> bool {
        let record = self.record_mut(code);
        let present = record.status.pending() || record.status.confirmed();
        record.acknowledged |= present;
        present
    }
}

#[cfg(test)]
mod tests;
