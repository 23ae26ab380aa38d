//! Which node owns the partition of an asset, as last read from the database.

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Instant;

use tokio::sync::watch;

use crate::store::{NodeRow, PartitionId, PartitionRow};

/// Where requests about an asset are answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Route {
    Here,
    /// At the node with this name and address.
    Node {
        name: String,
        address: String,
    },
    /// Nowhere at the moment: the partition has no owner that is alive.
    Nowhere,
}

/// The owner of each partition. Cheap to clone; all clones share it.
#[derive(Clone, Debug, Default)]
pub(in crate::service) struct Routes {
    table: Arc<RwLock<Table>>,
    /// The start of the last look at the database, on the monotonic clock of this process.
    looked: watch::Sender<Option<Instant>>,
}

#[derive(Debug, Default)]
struct Table {
    owners: BTreeMap<PartitionId, NodeRow>,
    nodes: Vec<NodeRow>,
}

impl Routes {
    /// Sets what a look that began at `looked_at` has found.
    pub(super) fn set(&self, looked_at: Instant, nodes: &[NodeRow], partitions: &[PartitionRow]) {
        let owner = |row: &PartitionRow| {
            let owner = nodes.iter().find(|node| Some(&node.id) == row.owner.as_ref())?;
            Some((row.partition(), owner.clone()))
        };
        let table =
            Table { owners: partitions.iter().filter_map(owner).collect(), nodes: nodes.to_vec() };
        *self.table.write().unwrap_or_else(PoisonError::into_inner) = table;
        self.looked.send_replace(Some(looked_at));
    }

    /// The start of the last look.
    pub(super) fn looked(&self) -> watch::Receiver<Option<Instant>> {
        self.looked.subscribe()
    }

    /// The owner of `partition`, if it has one that is not the node `me`.
    pub(super) fn of(&self, partition: PartitionId, me: &str) -> Route {
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        match table.owners.get(&partition).filter(|node| node.id != me) {
            Some(NodeRow { name, address, .. }) => {
                Route::Node { name: name.clone(), address: address.clone() }
            }
            None => Route::Nowhere,
        }
    }

    /// The nodes that are alive, each with the number of its partitions.
    pub(in crate::service) fn nodes(&self) -> Vec<(NodeRow, usize)> {
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        let n_owned = |node: &NodeRow| table.owners.values().filter(|o| o.id == node.id).count();
        table.nodes.iter().map(|node| (node.clone(), n_owned(node))).collect()
    }
}
