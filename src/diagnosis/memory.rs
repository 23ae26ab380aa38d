//! The fault memory of one rig: per code the status byte, the trip, healing
//! and aging counters, occurrences, the freeze frame and who acknowledged.
//!
//! One session is one operation cycle. Knows nothing of sensors or thresholds:
//! it is told FAILED, PASSED, cycle start and cycle end.

use super::{Evidence, Suspicion};
use crate::vocabulary::{FaultCode, FaultKind, FaultStatus};

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
    /// Whether the current occurrence has been acknowledged.
    pub acknowledged: bool,
    /// What was suspected when the test last failed.
    pub suspicion: Option<Suspicion>,
    /// The moment of the first failure of the current occurrence.
    pub freeze_frame: Option<Evidence>,
}

impl FaultRecord {
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
            record.freeze_frame = Some(frame.clone());
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
                let status = record.status;
                *record = FaultRecord { status, ..FaultRecord::default() };
            }
        }
    }

    /// Erases everything stored of `code`: it has never run.
    pub fn clear(&mut self, code: FaultCode) {
        *self.record_mut(code) = FaultRecord::default();
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
mod tests {
    use super::*;

    const CODE: FaultCode = FaultCode::XServo;

    struct Bench {
        memory: FaultMemory,
        rules: MemoryRules,
    }

    impl Bench {
        fn new(confirmation_threshold: u8, indicator: bool) -> Self {
            let rules = MemoryRules {
                confirmation_threshold,
                indicator,
                healing_cycles: 1,
                aging_cycles: 1,
            };
            Self { memory: FaultMemory::default(), rules }
        }

        fn byte(&self) -> String {
            self.memory.record(CODE).status.to_string()
        }

        fn failed(&mut self) -> String {
            self.memory.failed(CODE, &Suspicion::default(), &Evidence::default());
            self.memory.trip(CODE, &Suspicion::default(), &self.rules);
            self.byte()
        }

        fn passed(&mut self) -> String {
            self.memory.passed(CODE);
            self.byte()
        }

        fn start(&mut self) -> String {
            self.memory.start_cycle();
            self.byte()
        }

        fn end(&mut self) -> String {
            self.memory.end_cycle(&self.rules);
            self.byte()
        }
    }

    /// The published vectors for a confirmation threshold of 1, with and
    /// without the warning indicator. Healing takes the first good cycle,
    /// aging the second, so that "cycle end" and "healed" coincide here.
    #[test]
    fn validate_vectors_with_indicator() {
        let mut bench = Bench::new(1, true);
        bench.rules.healing_cycles = 2;
        assert_eq!(bench.byte(), "50");
        assert_eq!(bench.start(), "50");
        assert_eq!(bench.failed(), "AF");
        assert_eq!(bench.passed(), "AE");
        assert_eq!(bench.end(), "AE", "a cycle with a failure does not end pending");
        assert_eq!(bench.start(), "EC");
        assert_eq!(bench.passed(), "AC");
        assert_eq!(bench.end(), "A8");
        bench.start();
        bench.passed();
        assert_eq!(bench.end(), "28", "healed");
        bench.start();
        bench.passed();
        assert_eq!(bench.end(), "20", "aged");
    }

    #[test]
    fn validate_vectors_without_indicator() {
        let mut bench = Bench::new(1, false);
        bench.start();
        assert_eq!(bench.failed(), "2F");
        assert_eq!(bench.passed(), "2E");
        bench.end();
        assert_eq!(bench.start(), "6C");
        assert_eq!(bench.passed(), "2C");
        assert_eq!(bench.end(), "28");
        bench.start();
        bench.passed();
        assert_eq!(bench.end(), "20", "aged");
    }

    #[test]
    fn validate_vectors_with_threshold_two() {
        let mut bench = Bench::new(2, false);
        bench.start();
        assert_eq!(bench.failed(), "27");
        assert_eq!(bench.failed(), "27", "one cycle counts once");
        bench.end();
        bench.start();
        assert_eq!(bench.failed(), "2F");
    }

    #[test]
    fn a_good_cycle_in_between_restarts_the_trip_counter() {
        let mut bench = Bench::new(2, false);
        bench.start();
        bench.failed();
        bench.end();
        bench.start();
        bench.passed();
        bench.end();
        bench.start();
        assert_eq!(bench.failed(), "27");
    }

    #[test]
    fn a_cycle_without_a_result_neither_heals_nor_ends_pending() {
        let mut bench = Bench::new(1, true);
        bench.start();
        bench.failed();
        bench.passed();
        bench.end();
        bench.start();
        assert_eq!(bench.end(), "EC");
        assert_eq!(bench.memory.record(CODE).good_cycles, 0);
    }

    #[test]
    fn clearing_and_acknowledging_are_different_acts() {
        let mut bench = Bench::new(1, true);
        assert!(!bench.memory.acknowledge(CODE), "nothing to acknowledge");
        bench.failed();
        assert!(bench.memory.acknowledge(CODE));
        assert_eq!(bench.byte(), "AF");
        bench.passed();
        bench.failed();
        assert!(!bench.memory.record(CODE).acknowledged, "a new occurrence asks again");
        bench.memory.clear(CODE);
        assert_eq!(bench.memory.record(CODE), &FaultRecord::default());
        assert_eq!(bench.byte(), "50");
    }
}
