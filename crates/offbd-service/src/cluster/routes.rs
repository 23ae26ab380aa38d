//! Which node owns the partition of an asset, as last read from the database.

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::ownership::Ownership;
use offbd_store::{NodeRow, PartitionId, PartitionRow};

/// How long after the start of a look nothing can have been taken from this node, unless its
/// connection was lost: the server holds its locks for at least a second after a statement.
const VALID_FOR: Duration = Duration::from_secs(1);

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

impl Route {
    /// Whether it leads to the node at `address`.
    pub(super) fn is_at(&self, address: &str) -> bool {
        matches!(self, Self::Node { address: at, .. } if at == address)
    }
}

/// The owner of each partition. Cheap to clone; all clones share it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Routes {
    table: Arc<RwLock<Table>>,
    looked: watch::Sender<Option<Look>>,
}

/// A look at the database, by its start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// On the monotonic clock of this process.
    at: Instant,
    n_disconnections: u64,
}

impl Look {
    /// Begins a look.
    #[expect(clippy::disallowed_methods, reason = "partitions move by the time of this process")]
    pub(super) fn begin(ownership: &Ownership) -> Self {
        Self { at: Instant::now(), n_disconnections: ownership.n_disconnections() }
    }

    /// Whether nothing can have been taken from this node since.
    pub(super) fn is_valid(&self, ownership: &Ownership) -> bool {
        self.n_disconnections == ownership.n_disconnections() && self.at.elapsed() < VALID_FOR
    }
}

#[derive(Debug, Default)]
struct Table {
    owners: BTreeMap<PartitionId, NodeRow>,
    nodes: Vec<NodeRow>,
}

impl Routes {
    /// Sets what `look` has found.
    pub(super) fn set(&self, look: Look, nodes: &[NodeRow], partitions: &[PartitionRow]) {
        let owner = |row: &PartitionRow| {
            let owner = nodes.iter().find(|node| Some(&node.id) == row.owner.as_ref())?;
            Some((row.partition(), owner.clone()))
        };
        let table =
            Table { owners: partitions.iter().filter_map(owner).collect(), nodes: nodes.to_vec() };
        *self.table.write().unwrap_or_else(PoisonError::into_inner) = table;
        self.looked.send_replace(Some(look));
    }

    /// The last look.
    pub(super) fn looked(&self) -> watch::Receiver<Option<Look>> {
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
    pub(crate) fn nodes(&self) -> Vec<(NodeRow, usize)> {
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        let n_owned = |node: &NodeRow| table.owners.values().filter(|o| o.id == node.id).count();
        table.nodes.iter().map(|node| (node.clone(), n_owned(node))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_store::Partitions;

    #[test]
    fn a_look_is_void_once_the_connection_is_lost() {
        let ownership = Ownership::new(Partitions::ONE, Vec::new(), Arc::default());
        let look = Look::begin(&ownership);
        assert!(look.is_valid(&ownership));
        ownership.note_disconnected();
        assert!(!look.is_valid(&ownership), "others may have taken everything");
        assert!(Look::begin(&ownership).is_valid(&ownership));
        let old = Look { at: look.at.checked_sub(VALID_FOR).unwrap(), ..Look::begin(&ownership) };
        assert!(!old.is_valid(&ownership));
    }
}
