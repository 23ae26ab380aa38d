//! The shapes of SOVD (ISO 17978-3), for the adapter in the interface: the same data under the
//! names that its clients know. Values of status bits are the strings `0` and `1`, keys that
//! are not of the standard begin with `x-offbd`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::asset::AssetView;
use super::memory::{FaultRecordView, StatusBitsView};
use super::service::{FaultEntryView, SessionView, StateView};
use super::verdict::{
    CandidateView, EvidenceView, code_words, fault_title, is_probable, kind_weight,
};
use super::words::{CodeWord, KindWord, StatusWord};

/// The versions of SOVD that the service speaks.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdInfoView {
    pub sovd_info: Vec<SovdVersionView>,
}

/// One version of SOVD.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdVersionView {
    pub version: String,
    /// Path below which the entities are.
    pub base_uri: String,
    pub vendor_info: SovdVendorView,
}

/// The program that speaks SOVD.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdVendorView {
    pub name: String,
    pub version: String,
}

/// References to entities, categories or values.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdReferencesView {
    pub items: Vec<SovdReferenceView>,
}

/// A reference to an entity, a category or a value.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdReferenceView {
    pub id: String,
    pub name: String,
    /// Of a value: `identData` or `currentData`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub category: Option<String>,
    /// Path of the resource.
    pub href: String,
}

/// The service as the root of the entities.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdRootView {
    pub id: String,
    pub name: String,
    /// Path of the components.
    pub components: String,
}

/// A component: one rig.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdComponentView {
    pub id: String,
    pub name: String,
    /// Path of its faults.
    pub faults: String,
    /// Path of its values.
    pub data: String,
    /// Path of its recordings.
    #[serde(rename = "bulk-data")]
    pub bulk_data: String,
}

/// The faults of a component.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdFaultsView {
    pub items: Vec<SovdFaultView>,
}

/// A fault of a component.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdFaultView {
    pub code: CodeWord,
    /// Always `rig`.
    pub scope: String,
    /// Code and kind.
    pub display_code: String,
    /// Name for people; with its kind and the likelihood while this kind is only probable.
    pub fault_name: String,
    /// 2 (error) if the fault is confirmed, else 3 (warning).
    pub severity: u32,
    /// The failure mode; null if the evidence does not determine it.
    pub symptom: Option<String>,
    pub status: SovdStatusView,
}

/// The ISO 14229 status byte by its bits, each `0` or `1`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "camelCase")]
pub struct SovdStatusView {
    /// `active` while pending or confirmed, `passive` once healed, else `cleared`.
    pub aggregated_status: String,
    pub test_failed: String,
    pub test_failed_this_operation_cycle: String,
    #[serde(rename = "pendingDTC")]
    pub pending_dtc: String,
    #[serde(rename = "confirmedDTC")]
    pub confirmed_dtc: String,
    pub test_not_completed_since_last_clear: String,
    pub test_failed_since_last_clear: String,
    pub test_not_completed_this_operation_cycle: String,
    pub warning_indicator_requested: String,
    /// The byte, two hexadecimal digits.
    pub mask: String,
}

/// A fault with the environment in which it occurred.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdFaultDetailView {
    pub item: SovdFaultView,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub environment_data: Option<SovdEnvironmentView>,
    /// The record as in the interface of the service.
    #[serde(rename = "x-offbd")]
    pub record: Box<FaultEntryView>,
}

/// The environment of a fault; a part is missing if the query excludes it.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdEnvironmentView {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extended_data_records: Option<SovdExtendedView>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub snapshots: Option<Vec<SovdSnapshotView>>,
}

/// Counters and times of a fault.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdExtendedView {
    pub data: SovdExtendedDataView,
    /// Always empty.
    pub errors: Vec<String>,
}

/// Counters and times of a fault.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdExtendedDataView {
    /// Time of the first occurrence, RFC 3339; null if there is none.
    pub first_occurrence: Option<String>,
    /// Time of the last occurrence, RFC 3339; null if there is none.
    pub last_occurrence: Option<String>,
    pub occurrence_counter: u32,
    pub healing_counter: u8,
    pub aging_counter: u8,
}

/// What was recorded of a fault.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum SovdSnapshotView {
    FreezeFrame(SovdFreezeFrameView),
    Recording(SovdFaultRecordingView),
}

/// The recording of the session of a fault's last occurrence.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdFaultRecordingView {
    /// Always `recording`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Name of the session.
    pub name: String,
    /// Path of the recording among the bulk data.
    pub bulk_data_uri: String,
}

/// The freeze frame of a fault.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdFreezeFrameView {
    /// Always `freeze_frame`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Always `first_failed`: it is that of the first failure of the occurrence.
    pub name: String,
    pub data: Box<EvidenceView>,
}

/// A value of a component.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdDataView {
    pub id: String,
    pub data: SovdValueView,
    /// Always empty.
    pub errors: Vec<String>,
}

/// What a component's value is: its state or its description.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum SovdValueView {
    State(Box<StateView>),
    Description(Box<AssetView>),
}

/// The recordings of a component, newest first; at most 500, all with the interface of the
/// service.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdRecordingsView {
    pub items: Vec<SovdRecordingView>,
    /// Path of the service's own list of the older recordings; absent if all are listed.
    #[serde(rename = "x-offbd-next", skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}

/// A recording.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SovdRecordingView {
    pub id: String,
    pub name: String,
    /// Always `text/csv`.
    pub mimetype: String,
    /// Time at which the session was opened, RFC 3339.
    pub creation_date: String,
    /// Path of the recording.
    pub href: String,
    #[serde(rename = "x-offbd")]
    pub session: Box<SessionView>,
}

/// What an error response has for clients of SOVD, beside the members of a problem.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SovdErrorView {
    /// One of the standard's words.
    pub error_code: &'static str,
    pub message: Box<str>,
    /// The last part of the problem's type.
    pub vendor_code: Box<str>,
    /// The invalid query parameter, or the pointer to the invalid element.
    pub parameters: BTreeMap<&'static str, Box<str>>,
}

const fn bit(value: bool) -> &'static str {
    if value { "1" } else { "0" }
}

fn status_view(record: &FaultRecordView) -> SovdStatusView {
    let StatusBitsView {
        test_failed,
        test_failed_this_operation_cycle,
        pending,
        confirmed,
        test_not_completed_since_last_clear,
        test_failed_since_last_clear,
        test_not_completed_this_operation_cycle,
        warning_indicator_requested,
    } = record.status_bits;
    let text = |value: bool| bit(value).to_owned();
    SovdStatusView {
        aggregated_status: match record.status {
            StatusWord::Pending | StatusWord::Confirmed => "active",
            StatusWord::Healed => "passive",
            StatusWord::Cleared => "cleared",
        }
        .to_owned(),
        test_failed: text(test_failed),
        test_failed_this_operation_cycle: text(test_failed_this_operation_cycle),
        pending_dtc: text(pending),
        confirmed_dtc: text(confirmed),
        test_not_completed_since_last_clear: text(test_not_completed_since_last_clear),
        test_failed_since_last_clear: text(test_failed_since_last_clear),
        test_not_completed_this_operation_cycle: text(test_not_completed_this_operation_cycle),
        warning_indicator_requested: text(warning_indicator_requested),
        mask: record.status_byte.clone(),
    }
}

impl SovdStatusView {
    /// Whether the status has `value` under `key`, in any case; bits also as `true` and
    /// `false`, and of `mask` any bit. `None` if there is no such key or value.
    #[must_use]
    pub fn matches(&self, key: &str, value: &str) -> Option<bool> {
        if key.eq_ignore_ascii_case("mask") {
            let wanted = u8::from_str_radix(value.trim_start_matches("0x"), 16).ok()?;
            let present = u8::from_str_radix(&self.mask, 16).unwrap_or_default();
            return Some(wanted & present != 0);
        }
        if key.eq_ignore_ascii_case("aggregatedStatus") {
            let known = ["active", "passive", "cleared"].contains(&value);
            return known.then(|| self.aggregated_status == value);
        }
        let bits = [
            ("testFailed", &self.test_failed),
            ("testFailedThisOperationCycle", &self.test_failed_this_operation_cycle),
            ("pendingDTC", &self.pending_dtc),
            ("confirmedDTC", &self.confirmed_dtc),
            ("testNotCompletedSinceLastClear", &self.test_not_completed_since_last_clear),
            ("testFailedSinceLastClear", &self.test_failed_since_last_clear),
            ("testNotCompletedThisOperationCycle", &self.test_not_completed_this_operation_cycle),
            ("warningIndicatorRequested", &self.warning_indicator_requested),
        ];
        let (_, present) = bits.into_iter().find(|(name, _)| name.eq_ignore_ascii_case(key))?;
        let wanted = match value {
            "1" | "true" => "1",
            "0" | "false" => "0",
            _ => return None,
        };
        Some(present == wanted)
    }
}

/// Returns the fault in the shape of SOVD.
#[must_use]
pub fn fault_item(entry: &FaultEntryView) -> SovdFaultView {
    let record = &entry.record;
    let symptom = record.kind.map(|kind| kind.to_string());
    let kind = symptom.as_ref().map(|kind| format!(":{kind}")).unwrap_or_default();
    SovdFaultView {
        code: record.code,
        scope: SCOPE.to_owned(),
        display_code: format!("{}{kind}", record.code),
        fault_name: fault_name(record.code, record.kind, &record.candidates),
        severity: if record.status_bits.confirmed { 2 } else { 3 },
        symptom,
        status: status_view(record),
    }
}

/// The name of a fault for people.
fn fault_name(code: CodeWord, kind: Option<KindWord>, candidates: &[CandidateView]) -> String {
    let name = code_words(code.into());
    let weight = kind_weight(kind, candidates);
    match weight.filter(|&weight| is_probable(weight)) {
        Some(weight) => fault_title(name, kind, weight),
        None => name.to_owned(),
    }
}

/// The scope of all faults.
pub const SCOPE: &str = "rig";

/// Returns the fault with its environment: the counters if `with_extended`; the freeze frame,
/// and the recording if it still exists, if `with_snapshots`.
#[must_use]
pub fn fault_detail(
    entry: FaultEntryView,
    with_extended: bool,
    with_snapshots: bool,
    recording: Option<SovdFaultRecordingView>,
) -> SovdFaultDetailView {
    let record = &entry.record;
    let provenance = &entry.provenance;
    let extended = || SovdExtendedView {
        data: SovdExtendedDataView {
            first_occurrence: provenance.first_occurrence.as_ref().map(|o| o.noted_at.clone()),
            last_occurrence: provenance.last_occurrence.as_ref().map(|o| o.noted_at.clone()),
            occurrence_counter: record.occurrences,
            healing_counter: record.healing_counter,
            aging_counter: record.aging_counter,
        },
        errors: Vec::new(),
    };
    let freeze_frame = |frame: &EvidenceView| SovdFreezeFrameView {
        kind: "freeze_frame".to_owned(),
        name: "first_failed".to_owned(),
        data: Box::new(frame.clone()),
    };
    let frames = record.freeze_frame.iter().map(freeze_frame);
    let snapshots = frames
        .map(SovdSnapshotView::FreezeFrame)
        .chain(recording.map(SovdSnapshotView::Recording))
        .collect();
    let environment = SovdEnvironmentView {
        extended_data_records: with_extended.then(extended),
        snapshots: with_snapshots.then_some(snapshots),
    };
    SovdFaultDetailView {
        item: fault_item(&entry),
        environment_data: (with_extended || with_snapshots).then_some(environment),
        record: Box::new(entry),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The symptom is a word for programs; the name tells people how sure it is.
    #[test]
    fn the_name_tells_that_a_kind_is_only_probable() {
        let (code, kind) = (CodeWord::XServo, Some(KindWord::Dead));
        let of = |weight| fault_name(code, kind, &[CandidateView { code, kind, weight }]);
        assert_eq!(of(0.512), "x servo (probably dead, 51 %)");
        assert_eq!(of(0.9), "x servo");
        assert_eq!(fault_name(code, kind, &[]), "x servo");
    }
}
