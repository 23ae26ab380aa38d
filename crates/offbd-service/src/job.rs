//! Background jobs and the progress of the running ones.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Limit of queued jobs; at the limit further ones are refused.
pub(super) const MAX_QUEUED: usize = 64;

/// A background job, by the id of its row in the store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Job {
    Replay(String),
    Calibration(String),
}

/// The progress of each running job, 0 to 1, by its id.
#[derive(Clone, Debug, Default)]
pub(super) struct JobProgress {
    shares: Arc<Mutex<BTreeMap<String, f64>>>,
}

impl JobProgress {
    pub(super) fn get(&self, id: &str) -> Option<f64> {
        self.shares.lock().unwrap_or_else(PoisonError::into_inner).get(id).copied()
    }

    pub(super) fn set(&self, id: &str, share: f64) {
        let mut shares = self.shares.lock().unwrap_or_else(PoisonError::into_inner);
        shares.insert(id.to_owned(), share);
    }

    pub(super) fn remove(&self, id: &str) {
        self.shares.lock().unwrap_or_else(PoisonError::into_inner).remove(id);
    }
}
