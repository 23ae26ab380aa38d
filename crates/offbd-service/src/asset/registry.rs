//! Replacing the asset file and deleting the asset.

use super::actor::Asset;
use super::turn::Turn;
use crate::{EntityTag, Expected, ServiceError, views};
use offbd_core::engine::Rig;
use offbd_store::{AccessWrite, Write};
use offbd_wire::asset::{self, AssetView};

impl Asset {
    /// Checks that a request may replace the asset file.
    fn check_edition(&self, expected: &Expected) -> Result<(), ServiceError> {
        let file: AssetView = views::from_json(&self.row.document)?;
        expected.check(Some(&EntityTag::of(&file)?))
    }

    /// Replaces the asset file by that of `rig` if it is the expected one.
    pub(super) fn replace(
        &mut self,
        rig: Rig,
        expected: &Expected,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        self.check_edition(expected)?;
        self.write_file(views::to_json(&asset::view(&rig))?, turn);
        if self.rig.calibration != rig.calibration {
            // The calibration in the file is not one of the stored calibration jobs.
            let (asset, id) = (self.row.name.clone(), String::new());
            turn.writes.push(Write::ActivateCalibration { asset, id, by: None, at: turn.at });
            self.learning.calibration_replaced();
        } else if self.rig.calibration.is_none() && self.rig != rig {
            self.learning.description_changed();
        }
        self.rig = rig;
        self.write_learning(turn)?;
        self.learn_if_due(turn)
    }

    /// Hides the asset, whose data are deleted later, and revokes the tokens of its
    /// devices, if its file is the expected one.
    pub(super) fn delete(
        &mut self,
        expected: &Expected,
        turn: &mut Turn<'_>,
    ) -> Result<(), ServiceError> {
        self.check_edition(expected)?;
        self.deleted = true;
        let name = self.row.name.clone();
        let revoke = AccessWrite::RevokeDevices { asset: name.clone(), at: turn.at };
        turn.writes.push(Write::HideAsset { name, at: turn.at });
        turn.writes.push(Write::Access(revoke));
        Ok(())
    }

    /// Writes `document` as the asset file.
    pub(super) fn write_file(&mut self, document: String, turn: &mut Turn<'_>) {
        self.row.document = document;
        self.row.revision += 1;
        self.row.updated_at = turn.at;
        turn.writes.push(Write::UpdateAsset(self.row.clone()));
    }
}
