//! Changes on their way to the writer, and the engine that they belong to.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::ServiceError;
use offbd_store::{PartitionId, Write};

/// One instance of an asset's engine, from loading to dropping it. Once invalidated, the
/// engine is ahead of the store and none of its write sets is committed any more.
#[derive(Clone, Debug, Default)]
pub(crate) struct EngineGeneration {
    invalid: Arc<AtomicBool>,
}

impl EngineGeneration {
    pub(crate) fn invalidate(&self) {
        self.invalid.store(true, Ordering::SeqCst);
    }

    pub(crate) fn is_invalid(&self) -> bool {
        self.invalid.load(Ordering::SeqCst)
    }

    /// Whether some of its write sets may not be committed or refused yet; each holds a clone.
    pub(crate) fn has_unsettled(&mut self) -> bool {
        Arc::get_mut(&mut self.invalid).is_none()
    }
}

/// Called once the write set is durable, or with the reason why it is not.
pub(crate) type Completion = Box<dyn FnOnce(Result<(), ServiceError>) + Send>;

/// Changes that are committed together.
pub(crate) struct WriteSet {
    /// The partition of the asset; `None` for changes that concern none.
    pub(crate) partition: Option<PartitionId>,
    pub(crate) writes: Vec<Write>,
    /// Whether nobody is held up if it is committed some milliseconds later: it is of a device
    /// that sends at its own pace, not as fast as it is acknowledged.
    pub(crate) can_wait: bool,
    pub(crate) generation: EngineGeneration,
    pub(crate) completion: Completion,
}
