//! Sessions as MCAP files, as robotics tools record and show them.
//!
//! Each sample is a JSON message of the topic [`SAMPLES`]; only these are read back. A file
//! that is written with an asset file also shows the rig (`mcap_scene.rs`), in Foxglove's own
//! messages, which are in protobuf. All times are those of the device. If its clock counts from 1970,
//! they are absolute, as MCAP has them; times before the zero of the clock are shown at zero.

use super::mcap_file::{McapFile, Topic, json_schema};
use super::mcap_scene::RigScene;
use super::{SessionFileError, SessionInfo};
use crate::telemetry::sample_view;
use offbd_core::vocabulary::Sample;

/// The schema of samples, as the device sent them.
pub(super) const SAMPLE_SCHEMA: &str = "offbd.Sample";

const SAMPLES: Topic = Topic {
    name: "/offbd/samples",
    schema: || json_schema(SAMPLE_SCHEMA, include_str!("mcap_schemas/sample.json")),
};

/// Writes an MCAP file into memory, from where each call takes what is complete.
pub(super) struct McapEncoder {
    file: McapFile,
    /// The rig, if the session has an asset file.
    scene: Option<Box<RigScene>>,
}

impl McapEncoder {
    pub(super) fn new(info: &SessionInfo) -> Result<Self, SessionFileError> {
        let mut file = McapFile::new(info)?;
        file.add(SAMPLES)?;
        let asset = info.asset_file.as_deref();
        let scene = asset.map(RigScene::new).transpose()?.map(Box::new);
        Ok(Self { file, scene })
    }

    pub(super) fn rows(&mut self, samples: &[Sample]) -> Result<Vec<u8>, SessionFileError> {
        for sample in samples {
            self.file.json(SAMPLES, sample.t_s, &sample_view(sample))?;
            if let Some(scene) = &mut self.scene {
                scene.sample(sample, &mut self.file)?;
            }
        }
        Ok(self.file.take())
    }

    pub(super) fn end(mut self) -> Result<Vec<u8>, SessionFileError> {
        if let Some(scene) = &mut self.scene {
            scene.end(&mut self.file)?;
        }
        self.file.end()
    }
}
