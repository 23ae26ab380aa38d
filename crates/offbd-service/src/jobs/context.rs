//! The context of background jobs.

use crate::asset::Shards;
use crate::job::JobProgress;
use crate::writing::Handles;

/// The handles that a job uses. Cheap to clone.
#[derive(Clone)]
pub(crate) struct JobContext {
    pub(crate) handles: Handles,
    pub(crate) progress: JobProgress,
    pub(crate) shards: Shards,
}

impl JobContext {
    pub(crate) fn new(handles: Handles, shards: Shards) -> Self {
        Self { handles, progress: JobProgress::default(), shards }
    }
}
