//! By what a verdict was reached, as short ids: the calibration, and the rest.

use data_encoding::HEXLOWER;
use sha2::{Digest, Sha256};

use super::asset::{calibration_id, view};
use offbd_core::engine::Setup;

/// The ids that a fault carries of what judged it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Basis {
    /// `id` of the calibration in the asset file; none on a rig not learnt.
    pub calibration_id: Option<String>,
    /// The first 16 hexadecimal digits of the SHA-256 of everything else that
    /// the verdict depends on: the rig's description, the profile, every
    /// setting in force. Not the rig's name.
    pub settings_id: String,
}

impl Basis {
    /// The ids of `setup`.
    #[must_use]
    pub fn of(setup: &Setup) -> Self {
        let mut file = view(&setup.rig);
        (file.name, file.calibration) = (String::new(), None);
        // What is in force counts, not what the file asks for.
        file.diagnostics.get_or_insert_default().profile = None;
        let mut hash = Sha256::new();
        // A view of checked numbers is always JSON.
        hash.update(serde_json::to_vec(&file).unwrap_or_default());
        // Debug prints every field, and a number so that it reads back the same.
        hash.update(format!("{:?}", setup.settings));
        Self {
            calibration_id: setup.rig.calibration.as_ref().map(calibration_id),
            settings_id: HEXLOWER.encode(&hash.finalize()[..8]),
        }
    }
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
    fn what_changes_the_verdict_changes_the_id_and_nothing_else_does() {
        let rig = Rig::chapter("a");
        let id = settings_id(&rig, None);
        assert_eq!(id.len(), 16);
        assert_eq!(settings_id(&Rig::chapter("b"), None), id, "a name judges nothing");
        assert_ne!(settings_id(&rig, Some(Profile::Textbook)), id);
        let mut slow = rig.clone();
        slow.diagnostics.debounce_s = Some(2.0);
        assert_ne!(settings_id(&slow, None), id);
        let mut textbook = rig;
        textbook.diagnostics.profile = Profile::Textbook;
        let asked = settings_id(&Rig::chapter("a"), Some(Profile::Textbook));
        assert_eq!(settings_id(&textbook, None), asked, "by file or by wish");
    }
}
