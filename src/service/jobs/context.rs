//! The context of background jobs.

use crate::service::asset::Shards;
use crate::service::job::JobProgress;
use crate::service::writing::Handles;

/// The handles that a job uses. Cheap to clone.
#[derive(Clone)]
pub(in crate::service) struct JobContext {
    pub(in crate::service) handles: Handles,
    pub(in crate::service) progress: JobProgress,
    pub(in crate::service) shards: Shards,
}

impl JobContext {
    pub(in crate::service) fn new(handles: Handles, shards: Shards) -> Self {
        Self { handles, progress: JobProgress::default(), shards }
    }
}
