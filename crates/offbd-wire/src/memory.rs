//! The fault memory, as the API returns it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::verdict::{CandidateView, EvidenceView, candidate_view, evidence_view};
use super::words::{AxisWord, CodeWord, CommandWord, KindWord, StatusWord};
use offbd_core::diagnosis::{FaultRecord, InUse, MemoryRules, StatusByte};
use offbd_core::vocabulary::{FaultCode, SimTime};

/// The record of one fault code in the fault memory.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FaultRecordView {
    pub code: CodeWord,
    /// Failure mode; null if the evidence does not determine it.
    pub kind: Option<KindWord>,
    pub status: StatusWord,
    /// ISO 14229 status byte, two hexadecimal digits.
    pub status_byte: String,
    pub status_bits: StatusBitsView,
    /// Ball axis of a servo fault; null for other codes.
    pub axis: Option<AxisWord>,
    /// Plate angle that the servo turns: `qy` for x, `qx` for y; null for other codes.
    pub command: Option<CommandWord>,
    /// Estimated time at which the deviation of the last failure began, s on the device's
    /// clock in the session of the last occurrence; null if unknown.
    pub onset_s: Option<f64>,
    /// Causes that would explain the last failure equally; empty if there is only one.
    pub candidates: Vec<CandidateView>,
    /// Occurrences since the last clear: changes of the test from passed to failed.
    pub occurrences: u32,
    /// Onset of the first occurrence, s on the device's clock in its session; null if
    /// unknown.
    pub first_onset_s: Option<f64>,
    /// Onset of the last occurrence, s on the device's clock in its session; null if
    /// unknown.
    pub last_onset_s: Option<f64>,
    /// Operation cycles (sessions) with a failure since the last clear.
    pub failed_cycles: u32,
    /// Whether the current occurrence has been acknowledged.
    pub acknowledged: bool,
    /// Operation cycles in which the failure lasted long enough to count as a trip.
    pub trips: u8,
    /// Whether the current operation cycle has already counted as a trip.
    pub tripped_this_cycle: bool,
    /// Consecutive operation cycles without a failure.
    pub good_cycles: u8,
    /// Whether enough good operation cycles have followed the last failure.
    pub healed: bool,
    /// Good operation cycles of a confirmed fault that count towards healing.
    pub healing_counter: u8,
    /// Good operation cycles that healing requires.
    pub healing_cycles: u8,
    /// Good operation cycles since healing, which count towards aging.
    pub aging_counter: u8,
    /// Good operation cycles after healing at which the record is erased (aging).
    pub aging_cycles: u8,
    /// The evidence at the first failure of the current occurrence; null if none is stored.
    pub freeze_frame: Option<EvidenceView>,
    pub in_use: InUseView,
}

/// The ISO 14229 status byte, bit by bit from 0 to 7.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct StatusBitsView {
    /// Bit 0: the latest result of the test is a failure.
    pub test_failed: bool,
    /// Bit 1: the test has failed in this session.
    pub test_failed_this_operation_cycle: bool,
    /// Bit 2: the test has failed in this session or in the last one that had a result.
    pub pending: bool,
    /// Bit 3: the fault is confirmed; set until the record ages or is cleared.
    pub confirmed: bool,
    /// Bit 4: the test has had no result since the code was last cleared.
    pub test_not_completed_since_last_clear: bool,
    /// Bit 5: the test has failed since the code was last cleared.
    pub test_failed_since_last_clear: bool,
    /// Bit 6: the test has had no result in this session.
    pub test_not_completed_this_operation_cycle: bool,
    /// Bit 7: a warning indicator is requested.
    pub warning_indicator_requested: bool,
}

/// How often a monitor was able to find its fault: the in-use performance of SAE J1979.
/// Counted at the end of each session; neither clearing nor aging erases it.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ToSchema)]
pub struct InUseView {
    /// Operation cycles (sessions) that have ended.
    pub operation_cycles: u32,
    /// Operation cycles with enough data to judge.
    pub cycles_with_data: u32,
    /// Operation cycles in which the monitor was enabled for long enough to find a fault.
    pub cycles_judged: u32,
    /// `cycles_judged` divided by `cycles_with_data`, 0 to 1; null if `cycles_with_data` is
    /// 0. A low ratio means that the enable condition is too strict for this rig.
    pub ratio: Option<f64>,
}

/// Returns the view of one record.
#[must_use]
pub fn record_view(code: FaultCode, record: &FaultRecord, rules: &MemoryRules) -> FaultRecordView {
    let suspicion = record.suspicion.as_ref();
    FaultRecordView {
        code: code.into(),
        kind: record.kind().map(KindWord::from),
        status: record.word().into(),
        status_byte: record.status.to_string(),
        status_bits: status_bits(record.status),
        axis: code.axis().map(AxisWord::from),
        command: code.axis().map(CommandWord::from),
        onset_s: suspicion.and_then(|s| s.onset).map(SimTime::seconds),
        candidates: suspicion
            .map(|s| s.candidates.iter().map(candidate_view).collect())
            .unwrap_or_default(),
        occurrences: record.occurrences,
        first_onset_s: record.first_onset.map(SimTime::seconds),
        last_onset_s: record.last_onset.map(SimTime::seconds),
        failed_cycles: record.failed_cycles,
        acknowledged: record.acknowledged,
        trips: record.trips,
        tripped_this_cycle: record.tripped_this_cycle,
        good_cycles: record.good_cycles,
        healed: record.healed,
        healing_counter: record.healing_counter(rules),
        healing_cycles: rules.healing_cycles,
        aging_counter: record.aging_counter(rules),
        aging_cycles: rules.aging_cycles,
        freeze_frame: record.freeze_frame.as_deref().map(evidence_view),
        in_use: in_use_view(&record.in_use),
    }
}

const fn status_bits(byte: StatusByte) -> StatusBitsView {
    StatusBitsView {
        test_failed: byte.test_failed(),
        test_failed_this_operation_cycle: byte.failed_this_cycle(),
        pending: byte.pending(),
        confirmed: byte.confirmed(),
        test_not_completed_since_last_clear: !byte.completed_since_clear(),
        test_failed_since_last_clear: byte.failed_since_clear(),
        test_not_completed_this_operation_cycle: !byte.completed_this_cycle(),
        warning_indicator_requested: byte.indicator_requested(),
    }
}

fn in_use_view(in_use: &InUse) -> InUseView {
    InUseView {
        operation_cycles: in_use.cycles,
        cycles_with_data: in_use.with_data,
        cycles_judged: in_use.judged,
        ratio: in_use.ratio(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ISO 14229-1, D.2: bit 0 is the lowest.
    #[test]
    fn validate_each_status_bit_has_its_iso_14229_position() {
        let names = [
            "test_failed",
            "test_failed_this_operation_cycle",
            "pending",
            "confirmed",
            "test_not_completed_since_last_clear",
            "test_failed_since_last_clear",
            "test_not_completed_this_operation_cycle",
            "warning_indicator_requested",
        ];
        for (i, name) in names.iter().enumerate() {
            let bits = serde_json::to_value(status_bits(StatusByte::from_bits(1 << i))).unwrap();
            for other in names {
                assert_eq!(bits[other], other == *name, "bit {i}: {bits}");
            }
        }
    }
}
