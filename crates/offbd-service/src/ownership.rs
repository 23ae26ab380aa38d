//! Which partitions this process owns. Without a cluster it owns all of them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, PoisonError, RwLock};

use offbd_store::{PartitionId, Partitions};

/// The owned partitions, each with its epoch. Cheap to clone; all clones share them.
#[derive(Clone, Debug)]
pub(crate) struct Ownership {
    partitions: Partitions,
    epochs: Arc<RwLock<BTreeMap<PartitionId, i64>>>,
    n_disconnections: Arc<AtomicU64>,
}

impl Ownership {
    /// The partitions `owned`. `n_disconnections` counts how often the connection was lost that
    /// keeps them.
    pub(crate) fn new(
        partitions: Partitions,
        owned: Vec<(PartitionId, i64)>,
        n_disconnections: Arc<AtomicU64>,
    ) -> Self {
        let epochs = Arc::new(RwLock::new(owned.into_iter().collect()));
        Self { partitions, epochs, n_disconnections }
    }

    /// How often the database server may have released the owned partitions so far.
    pub(crate) fn n_disconnections(&self) -> u64 {
        self.n_disconnections.load(Ordering::SeqCst)
    }

    /// Notes that another connection to the database was lost, and perhaps all.
    pub(crate) fn note_disconnected(&self) {
        self.n_disconnections.fetch_add(1, Ordering::SeqCst);
    }

    pub(crate) const fn n_partitions(&self) -> usize {
        self.partitions.count() as usize
    }

    /// The partition of `asset`.
    pub(crate) fn partition_of(&self, asset: &str) -> PartitionId {
        self.partitions.of(asset)
    }

    /// The epoch of the partition of `asset`; `None` if another process owns it, or none.
    pub(crate) fn epoch_of(&self, asset: &str) -> Option<i64> {
        self.epoch(self.partition_of(asset))
    }

    /// The epoch of `partition`; `None` if another process owns it, or none.
    pub(crate) fn epoch(&self, partition: PartitionId) -> Option<i64> {
        self.epochs.read().unwrap_or_else(PoisonError::into_inner).get(&partition).copied()
    }

    /// The owned partitions as a filter for queries; `None` if all are.
    pub(crate) fn filter(&self) -> Option<Vec<PartitionId>> {
        (!self.is_whole()).then(|| self.owned())
    }

    pub(crate) fn owns(&self, asset: &str) -> bool {
        self.epoch_of(asset).is_some()
    }

    pub(crate) fn owned(&self) -> Vec<PartitionId> {
        self.epochs.read().unwrap_or_else(PoisonError::into_inner).keys().copied().collect()
    }

    /// The owned partitions, each with its epoch.
    pub(crate) fn epochs(&self) -> Vec<(PartitionId, i64)> {
        let epochs = self.epochs.read().unwrap_or_else(PoisonError::into_inner);
        epochs.iter().map(|(partition, epoch)| (*partition, *epoch)).collect()
    }

    /// Whether this process owns all partitions.
    pub(crate) fn is_whole(&self) -> bool {
        let n = self.epochs.read().unwrap_or_else(PoisonError::into_inner).len();
        n == self.partitions.count() as usize
    }

    pub(crate) fn add(&self, partition: PartitionId, epoch: i64) {
        self.epochs.write().unwrap_or_else(PoisonError::into_inner).insert(partition, epoch);
    }

    pub(crate) fn remove(&self, partition: PartitionId) {
        self.epochs.write().unwrap_or_else(PoisonError::into_inner).remove(&partition);
    }
}
