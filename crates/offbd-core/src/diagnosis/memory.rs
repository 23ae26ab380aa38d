//! The fault memory of one rig: per code the status byte, the trip, healing
//! and aging counters, occurrences, the freeze frame, whether it has been
//! acknowledged, and how often its monitor could judge.
//!
//! One session is one operation cycle. Knows nothing of sensors or thresholds:
//! it is told FAILED, PASSED, cycle start and cycle end.

use super::{Evidence, Suspicion};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{FaultCode, FaultKind, FaultStatus, SimTime};

use super::StatusByte;

/// When a fault counts as confirmed, healed and aged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRules {
    /// Operation cycles with a confirmed failure before bit 3 is set; ≥ 1.
    pub confirmation_threshold: u8,
    /// Whether confirmation asks for the warning indicator (bit 7).
    pub indicator: bool,
    /// Good cycles until the indicator goes out; ≥ 1.
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

/// How often a monitor has been in a position to find its fault: the in-use
/// performance of SAE J1979. Neither clearing nor aging erases it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InUse {
    /// Operation cycles that have ended.
    pub cycles: u32,
    /// Those that brought enough data to judge by.
    pub with_data: u32,
    /// Those in which the gate was open long enough to have found a fault.
    pub judged: u32,
}

impl InUse {
    /// How much longer than a fault takes to be confirmed there must be data:
    /// a gate that is open for a tenth of the time is wide enough, one that is
    /// stricter shows as a low ratio. Chosen, not measured.
    const DATA_FACTOR: f64 = 10.0;

    /// Counts a cycle that ends, with `data_s` seconds of data and the gate
    /// open for `judged_s` of them, for a fault that takes `needed_s` to be
    /// confirmed. A cycle that judged had enough data, so that
    /// `judged` ≤ `with_data` ≤ `cycles`.
    pub fn count(&mut self, data_s: f64, judged_s: f64, needed_s: f64) {
        let judged = Self::judges(judged_s, needed_s);
        let with_data = judged || (data_s > 0.0 && data_s >= Self::DATA_FACTOR * needed_s);
        self.cycles = self.cycles.saturating_add(1);
        self.with_data = self.with_data.saturating_add(u32::from(with_data));
        self.judged = self.judged.saturating_add(u32::from(judged));
    }

    /// Whether `judged_s` seconds with the gate open are long enough to have found
    /// a fault that takes `needed_s` to be confirmed.
    #[must_use]
    pub fn judges(judged_s: f64, needed_s: f64) -> bool {
        judged_s > 0.0 && judged_s >= needed_s
    }

    /// Judged cycles over those with data, 0 to 1; none before there is one.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        (self.with_data > 0).then(|| f64::from(self.judged) / f64::from(self.with_data))
    }
}

/// What is remembered of one code.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultRecord {
    pub status: StatusByte,
    /// Cycles in which the failure lasted long enough to count as a trip.
    pub trips: u8,
    /// Whether this cycle has counted as a trip already.
    pub tripped_this_cycle: bool,
    /// Good cycles in a row since the last failure.
    pub good_cycles: u8,
    /// Whether good cycles have put the fault to rest (cleared by a failure).
    pub healed: bool,
    /// Times the test went from not failed to failed since the last clear.
    pub occurrences: u32,
    /// Onset of the first of them, on the clock of its session.
    pub first_onset: Option<SimTime>,
    /// Onset of the last of them, on the clock of its session.
    pub last_onset: Option<SimTime>,
    /// Operation cycles with a failure since the last clear.
    pub failed_cycles: u32,
    /// Whether the current occurrence has been acknowledged.
    pub acknowledged: bool,
    /// What was suspected when the test last failed.
    pub suspicion: Option<Suspicion>,
    /// The moment of the first failure of the current occurrence. Boxed: most
    /// records have none, and every asset has several.
    pub freeze_frame: Option<Box<Evidence>>,
    /// How often the monitor could judge at all.
    pub in_use: InUse,
}

impl FaultRecord {
    /// Good cycles that count towards healing.
    #[must_use]
    pub fn healing_counter(&self, rules: &MemoryRules) -> u8 {
        if self.status.confirmed() { self.good_cycles.min(rules.healing_cycles) } else { 0 }
    }

    /// Good cycles after healing, which count towards aging.
    #[must_use]
    pub fn aging_counter(&self, rules: &MemoryRules) -> u8 {
        let past = self.good_cycles.saturating_sub(rules.healing_cycles);
        if self.status.confirmed() { past.min(rules.aging_cycles) } else { 0 }
    }

    /// The same with nothing on record but `status` and the monitor's use.
    fn erased(&self, status: StatusByte) -> Self {
        Self { status, in_use: self.in_use, ..Self::default() }
    }

    /// The contract's word for the status byte.
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

    /// The kind last suspected, where the evidence said one.
    #[must_use]
    pub fn kind(&self) -> Option<FaultKind> {
        self.suspicion.as_ref().and_then(|s| s.kind)
    }
}

/// The four codes of one rig.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultMemory {
    records: [FaultRecord; FaultCode::COUNT],
}

impl FaultMemory {
    /// The record of `code`.
    #[must_use]
    pub const fn record(&self, code: FaultCode) -> &FaultRecord {
        &self.records[code as usize]
    }

    /// A memory with `record` in the place of `code`, as read from a store.
    #[must_use]
    pub fn with(mut self, code: FaultCode, record: FaultRecord) -> Self {
        self.records[code as usize] = record;
        self
    }

    const fn record_mut(&mut self, code: FaultCode) -> &mut FaultRecord {
        &mut self.records[code as usize]
    }

    /// FAILED for `code`. Returns whether the byte changed.
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
        record.suspicion = Some(suspicion.clone());
        record.good_cycles = 0;
        record.healed = false;
        record.status.failed();
        record.status != before
    }

    /// The failure has lasted long enough to count for this cycle. Returns
    /// whether the byte changed.
    pub fn trip(&mut self, code: FaultCode, suspicion: &Suspicion, rules: &MemoryRules) -> bool {
        let record = self.record_mut(code);
        let before = record.status;
        record.suspicion = Some(suspicion.clone());
        if !record.tripped_this_cycle {
            record.tripped_this_cycle = true;
            record.trips = record.trips.saturating_add(1);
        }
        if record.trips >= rules.confirmation_threshold {
            record.status.confirm(rules.indicator);
        }
        record.status != before
    }

    /// The kind of a fault on record may show only after its confirmation: takes
    /// `suspicion` where it says one and the record does not. Returns whether it
    /// did.
    pub fn name(&mut self, code: FaultCode, suspicion: &Suspicion) -> bool {
        let record = self.record_mut(code);
        let named = record.kind().is_none() && suspicion.kind.is_some();
        let named = named && record.status.test_failed() && record.status.confirmed();
        if named {
            record.suspicion = Some(suspicion.clone());
        }
        named
    }

    /// PASSED for `code`. Returns whether the byte changed.
    pub fn passed(&mut self, code: FaultCode) -> bool {
        let record = self.record_mut(code);
        let before = record.status;
        record.status.passed();
        record.status != before
    }

    /// A new operation cycle begins for every code.
    pub fn start_cycle(&mut self) {
        for record in &mut self.records {
            record.status.start_cycle();
            record.tripped_this_cycle = false;
        }
    }

    /// The operation cycle ends: pending falls, healing and aging advance.
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

    /// Takes note of how much of the cycle that ends `code` could be judged;
    /// see [`InUse::count`].
    pub fn count_use(&mut self, code: FaultCode, data_s: f64, judged_s: f64, needed_s: f64) {
        self.record_mut(code).in_use.count(data_s, judged_s, needed_s);
    }

    /// Erases everything stored of `code`: it has never run. How often its
    /// monitor could judge stays, as SAE J1979 has it.
    pub fn clear(&mut self, code: FaultCode) {
        let record = self.record_mut(code);
        *record = record.erased(StatusByte::default());
    }

    /// Marks the current occurrence of `code` as seen by a person. Returns
    /// whether there was an occurrence to acknowledge.
    pub fn acknowledge(&mut self, code: FaultCode) -> bool {
        let record = self.record_mut(code);
        let present = record.status.pending() || record.status.confirmed();
        record.acknowledged |= present;
        present
    }
}

#[cfg(test)]
mod tests;
