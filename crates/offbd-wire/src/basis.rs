//! Short ids of what a verdict is based on: the calibration, and all other settings.

use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::asset::{AssetView, calibration_id, view};
use offbd_core::diagnosis::{MemoryRules, Settings};
use offbd_core::engine::{JUDGEMENT, Setup};

/// The ids of the calibration and the settings with which a fault was judged.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Basis {
    /// `id` of the calibration in the asset file; `None` if the rig is not calibrated.
    pub calibration_id: Option<String>,
    /// The first 16 hexadecimal digits of the SHA-256 of everything else that the
    /// verdict depends on: the rig's description without its name, the profile, every
    /// setting in use, and the version of the judgement, [`JUDGEMENT`].
    pub settings_id: String,
}

impl Basis {
    /// Returns the ids of `setup`.
    #[must_use]
    pub fn of(setup: &Setup) -> Self {
        let mut file = view(&setup.rig);
        (file.name, file.calibration, file.columns) = (String::new(), None, None);
        // The profile in use counts, which may differ from that of the file.
        file.diagnostics.get_or_insert_default().profile = None;
        let hash = Sha256::digest(canonical(&file, &setup.settings).to_string());
        Self {
            calibration_id: setup.rig.calibration.as_deref().map(calibration_id),
            settings_id: HEXLOWER.encode(&hash[..8]),
        }
    }
}

/// Returns the document of which [`Basis::settings_id`] is the hash. The id must change
/// only with the settings, not with the code: keys are literals, `serde_json` sorts them,
/// and a document of another form has another `version`. Infinite numbers become null.
fn canonical(file: &AssetView, settings: &Settings) -> Value {
    // Lists every field, so that a new one does not compile until it is added here.
    let Settings {
        profile,
        twin_accuracy_m_s2,
        window_s,
        period_s,
        gap_s,
        reorder_s,
        fail_s,
        readings_fail_s,
        noise_fail_s,
        pass_s,
        leak_s,
        confirm_s,
        readings_confirm_s,
        gather_s,
        suspect_nats,
        confirm_nats,
        learnt,
        memory,
    } = *settings;
    let MemoryRules { confirmation_threshold, indicator, healing_cycles, aging_cycles } = memory;
    json!({
        "version": 1,
        "judgement": JUDGEMENT,
        "rig": file,
        "profile": profile.as_str(),
        "twin_accuracy_m_s2": twin_accuracy_m_s2,
        "window_s": window_s,
        "period_s": period_s,
        "gap_s": gap_s,
        "reorder_s": reorder_s,
        "fail_s": fail_s,
        "readings_fail_s": readings_fail_s,
        "noise_fail_s": noise_fail_s,
        "pass_s": pass_s,
        "leak_s": leak_s,
        "confirm_s": confirm_s,
        "readings_confirm_s": readings_confirm_s,
        "gather_s": gather_s,
        "suspect_nats": suspect_nats,
        "confirm_nats": confirm_nats,
        "learnt": learnt,
        "confirmation_threshold": confirmation_threshold,
        "indicator": indicator,
        "healing_cycles": healing_cycles,
        "aging_cycles": aging_cycles,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::Profile;
    use offbd_core::engine::Rig;

    fn settings_id(rig: &Rig, profile: Option<Profile>) -> String {
        Basis::of(&Setup::new(rig.clone(), profile).unwrap()).settings_id
    }

    #[test]
    fn the_id_changes_with_the_settings_but_not_with_the_name() {
        let rig = Rig::chapter("a");
        let id = settings_id(&rig, None);
        assert_eq!(id.len(), 16);
        assert_eq!(settings_id(&Rig::chapter("b"), None), id, "the name has no influence");
        assert_ne!(settings_id(&rig, Some(Profile::Textbook)), id);
        let mut slow = rig.clone();
        slow.diagnostics.debounce_s = Some(2.0);
        assert_ne!(settings_id(&slow, None), id);
        let mut textbook = rig;
        textbook.diagnostics.profile = Profile::Textbook;
        let asked = settings_id(&Rig::chapter("a"), Some(Profile::Textbook));
        assert_eq!(settings_id(&textbook, None), asked, "set by file or by argument");
    }

    /// Ids are stored with every fault: if one changed without a change of the settings,
    /// equal judgements would seem to differ.
    #[test]
    fn regress_the_id_is_the_same_in_every_build() {
        let ids = [None, Some(Profile::Textbook)].map(|p| settings_id(&Rig::chapter("a"), p));
        assert_eq!(ids, ["0a7bb14c9a343a4c", "5f8716892e5ba043"]);
    }
}
