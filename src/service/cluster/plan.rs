//! Decides which partitions a node takes and which it hands over: a state machine without
//! clock, database or network. It need not be right for correctness, which the fence of the
//! store guarantees; it is what makes a take-over fast and the distribution even.

use std::collections::BTreeSet;
use std::time::Duration;

use sha2::{Digest, Sha256};

use crate::store::{NodeRow, PartitionId, PartitionRow};

/// How long the members must have been the same before partitions move to balance the load.
/// Chosen: longer than a restart.
const SETTLED_AFTER: Duration = Duration::from_secs(10);

/// Partitions that a node hands over at a time to balance the load. Chosen: few devices have
/// to wait at a time.
const HANDED_OVER_AT_ONCE: usize = 2;

/// What a node does next.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct OwnershipStep {
    pub(super) take: Vec<PartitionId>,
    pub(super) hand_over: Vec<PartitionId>,
}

/// The plan of one node.
#[derive(Clone, Debug)]
pub(super) struct OwnershipPlan {
    me: String,
    members: BTreeSet<String>,
    /// When the members changed last.
    changed_at: Duration,
    leaving: bool,
}

impl OwnershipPlan {
    /// The plan of the node with the id `me`.
    pub(super) fn new(me: String) -> Self {
        Self { me, members: BTreeSet::new(), changed_at: Duration::ZERO, leaving: false }
    }

    /// From now on the node takes nothing and hands everything over.
    pub(super) fn leave(&mut self) {
        self.leaving = true;
    }

    /// Returns what to do at the time `now`, which never goes back, when these `nodes` are
    /// alive, `partitions` have these owners, and this node owns `owned`. A partition that it
    /// has lost, and that no other node has taken, it takes back: others take it for the owner.
    pub(super) fn step(
        &mut self,
        now: Duration,
        nodes: &[NodeRow],
        partitions: &[PartitionRow],
        owned: &[PartitionId],
    ) -> OwnershipStep {
        let members: BTreeSet<_> = nodes.iter().map(|node| node.id.clone()).collect();
        if members != self.members {
            (self.members, self.changed_at) = (members, now);
        }
        let is_settled = now.saturating_sub(self.changed_at) >= SETTLED_AFTER;
        let staying: Vec<_> = nodes.iter().filter(|node| self.stays(node)).collect();
        let mut step = OwnershipStep::default();
        for row in partitions {
            let partition = row.partition();
            let wanted = staying.iter().max_by_key(|node| weight(node, partition));
            let is_wanted = wanted.is_some_and(|node| node.id == self.me);
            match row.owner.as_ref().filter(|owner| self.members.contains(*owner)) {
                None if is_wanted => step.take.push(partition),
                Some(owner) if *owner == self.me && !owned.contains(&partition) => {
                    step.take.push(partition);
                }
                Some(owner)
                    if *owner == self.me
                        && wanted.is_some()
                        && !is_wanted
                        && (self.leaving
                            || is_settled && step.hand_over.len() < HANDED_OVER_AT_ONCE) =>
                {
                    step.hand_over.push(partition);
                }
                _ => {}
            }
        }
        step
    }

    fn stays(&self, node: &NodeRow) -> bool {
        node.leaving == 0 && !(self.leaving && node.id == self.me)
    }
}

/// Rendezvous hashing: the partition belongs to the node with the largest weight, so that a
/// node that comes or goes moves only its own share. By name, so that a node that restarts
/// gets the same partitions.
fn weight(node: &NodeRow, partition: PartitionId) -> ([u8; 32], &str) {
    let hash = Sha256::new()
        .chain_update(node.name.as_bytes())
        .chain_update([0])
        .chain_update(partition.0.to_le_bytes());
    (hash.finalize().into(), &node.id)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};
    use std::slice::from_ref;

    use proptest::prelude::*;

    use super::*;

    const N_NODES: usize = 4;
    const N_PARTITIONS: u32 = 8;

    /// A model of PostgreSQL: locks that end with their session, and epochs.
    #[derive(Default)]
    struct Database {
        /// The node and session that hold the lock of each partition.
        locks: BTreeMap<u32, (usize, u64)>,
        epochs: BTreeMap<u32, i64>,
        owners: BTreeMap<u32, String>,
        /// The session of each node that is connected.
        sessions: BTreeMap<usize, u64>,
        leaving: BTreeSet<usize>,
        n_sessions: u64,
        /// Every commit: partition, epoch.
        commits: Vec<(u32, i64)>,
    }

    impl Database {
        fn connect(&mut self, node: usize) -> u64 {
            self.end(node);
            self.n_sessions += 1;
            self.sessions.insert(node, self.n_sessions);
            self.n_sessions
        }

        fn end(&mut self, node: usize) {
            if let Some(session) = self.sessions.remove(&node) {
                self.locks.retain(|_, holder| *holder != (node, session));
            }
        }

        fn view(&self) -> (Vec<NodeRow>, Vec<PartitionRow>) {
            let node = |&node: &usize| NodeRow {
                id: format!("id-{node}"),
                name: format!("node-{node}"),
                leaving: i64::from(self.leaving.contains(&node)),
                ..NodeRow::default()
            };
            let partition = |id| PartitionRow {
                id: i64::from(id),
                epoch: self.epochs.get(&id).copied().unwrap_or_default(),
                owner: self.owners.get(&id).cloned(),
                n_commits: 0,
            };
            let nodes = self.sessions.keys().map(node).collect();
            (nodes, (0..N_PARTITIONS).map(partition).collect())
        }

        /// Takes the lock, then increments the epoch, as the store does.
        fn take(&mut self, node: usize, session: u64, partition: u32) -> Option<i64> {
            if self.sessions.get(&node) != Some(&session) || self.locks.contains_key(&partition) {
                return None;
            }
            self.locks.insert(partition, (node, session));
            self.owners.insert(partition, format!("id-{node}"));
            let epoch = self.epochs.entry(partition).or_default();
            *epoch += 1;
            Some(*epoch)
        }

        /// A transaction with the fence; returns whether it is committed.
        fn commit(&mut self, node: usize, session: u64, partition: u32, epoch: i64) -> bool {
            let is_connected = self.sessions.get(&node) == Some(&session);
            let is_owner = self.epochs.get(&partition) == Some(&epoch);
            if is_connected && is_owner {
                self.commits.push((partition, epoch));
            }
            is_connected && is_owner
        }
    }

    struct Node {
        plan: OwnershipPlan,
        session: u64,
        owned: BTreeMap<u32, i64>,
        is_paused: bool,
    }

    #[derive(Clone, Debug)]
    enum Event {
        Tick(usize),
        Commit(usize, u32),
        /// Stops a process; its session ends if the server loses patience.
        Pause(usize, bool),
        Resume(usize),
        Kill(usize),
        Leave(usize),
        Wait(u64),
    }

    fn event() -> impl Strategy<Value = Event> {
        let node = || 0..N_NODES;
        prop_oneof![
            10 => node().prop_map(Event::Tick),
            10 => (node(), 0..N_PARTITIONS).prop_map(|(node, p)| Event::Commit(node, p)),
            2 => (node(), any::<bool>()).prop_map(|(node, ends)| Event::Pause(node, ends)),
            3 => node().prop_map(Event::Resume),
            2 => node().prop_map(Event::Kill),
            1 => node().prop_map(Event::Leave),
            2 => (0..12_000_u64).prop_map(Event::Wait),
        ]
    }

    struct World {
        now: Duration,
        database: Database,
        nodes: Vec<Node>,
    }

    impl World {
        fn new() -> Self {
            let mut database = Database::default();
            let nodes = (0..N_NODES).map(|node| Node {
                plan: OwnershipPlan::new(format!("id-{node}")),
                session: database.connect(node),
                owned: BTreeMap::new(),
                is_paused: false,
            });
            let nodes = nodes.collect();
            Self { now: Duration::ZERO, database, nodes }
        }

        fn tick(&mut self, i: usize) {
            let Self { now, database, nodes } = self;
            let node = &mut nodes[i];
            if node.is_paused {
                return;
            }
            if database.sessions.get(&i) != Some(&node.session) {
                // The connection is lost: connect again, and keep what has the same epoch.
                node.session = database.connect(i);
                let (session, owned) = (node.session, std::mem::take(&mut node.owned));
                node.owned = owned
                    .into_iter()
                    .filter(|(partition, epoch)| {
                        let is_mine = database.epochs.get(partition) == Some(epoch)
                            && !database.locks.contains_key(partition);
                        if is_mine {
                            database.locks.insert(*partition, (i, session));
                        }
                        is_mine
                    })
                    .collect();
            }
            let (rows, partitions) = database.view();
            let owned: Vec<_> = node.owned.keys().copied().map(PartitionId).collect();
            let step = node.plan.step(*now, &rows, &partitions, &owned);
            for PartitionId(partition) in step.hand_over {
                if node.owned.remove(&partition).is_some() {
                    database.owners.remove(&partition);
                    database.locks.remove(&partition);
                }
            }
            for PartitionId(partition) in step.take {
                if let Some(epoch) = database.take(i, node.session, partition) {
                    node.owned.insert(partition, epoch);
                }
            }
        }

        fn apply(&mut self, event: &Event) {
            match *event {
                Event::Tick(node) => self.tick(node),
                Event::Commit(i, partition) => {
                    let node = &mut self.nodes[i];
                    let owned = node.owned.get(&partition).filter(|_| !node.is_paused);
                    let Some(&epoch) = owned else { return };
                    if !self.database.commit(i, node.session, partition, epoch) {
                        node.owned.remove(&partition);
                    }
                }
                Event::Pause(node, session_ends) => {
                    self.nodes[node].is_paused = true;
                    if session_ends {
                        self.database.end(node);
                    }
                }
                Event::Resume(node) => self.nodes[node].is_paused = false,
                Event::Kill(node) => {
                    // The process starts anew under the same name; ids are not reused, but the
                    // model's nodes own nothing after a start, which is what counts.
                    self.nodes[node].owned.clear();
                    self.nodes[node].is_paused = false;
                    self.nodes[node].session = self.database.connect(node);
                    let id = format!("id-{node}");
                    self.database.owners.retain(|_, owner| *owner != id);
                    self.nodes[node].plan = OwnershipPlan::new(id);
                    self.database.leaving.remove(&node);
                }
                Event::Leave(node) => {
                    self.nodes[node].plan.leave();
                    self.database.leaving.insert(node);
                }
                Event::Wait(ms) => self.now += Duration::from_millis(ms),
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn no_two_nodes_commit_under_one_epoch_and_each_partition_gets_an_owner(
            events in prop::collection::vec(event(), 1..400),
        ) {
            let mut world = World::new();
            for event in &events {
                world.apply(event);
                for (partition, epoch) in &world.database.epochs {
                    let owners = world.nodes.iter().filter(|n| n.owned.get(partition) == Some(epoch));
                    prop_assert!(owners.count() <= 1, "two nodes have epoch {epoch}");
                }
            }
            let mut last = BTreeMap::new();
            for (partition, epoch) in &world.database.commits {
                let before = last.insert(*partition, *epoch).unwrap_or_default();
                prop_assert!(before <= *epoch, "a commit of an earlier owner");
            }
            // Once nothing fails any more, every partition has the owner that it should have.
            (0..N_NODES).for_each(|node| world.apply(&Event::Resume(node)));
            let alone = world.database.leaving.len() == N_NODES;
            for _ in 0..N_PARTITIONS + 4 {
                world.apply(&Event::Wait(11_000));
                (0..N_NODES).for_each(|node| world.tick(node));
            }
            if !alone {
                for partition in 0..N_PARTITIONS {
                    let staying = (0..N_NODES).filter(|n| !world.database.leaving.contains(n));
                    let wanted = staying.max_by_key(|n| {
                        let name = format!("node-{n}");
                        let id = format!("id-{n}");
                        let row = NodeRow { id: id.clone(), name, ..NodeRow::default() };
                        (weight(&row, PartitionId(partition)).0, id)
                    });
                    let owners: Vec<_> = (0..N_NODES)
                        .filter(|&n| world.nodes[n].owned.contains_key(&partition))
                        .collect();
                    prop_assert_eq!(owners, Vec::from_iter(wanted), "partition {}", partition);
                }
            }
        }
    }

    #[test]
    fn a_share_is_about_even_and_only_the_share_of_a_lost_node_moves() {
        let node =
            |i: usize| NodeRow { id: i.to_string(), name: i.to_string(), ..NodeRow::default() };
        let nodes: Vec<_> = (0..3).map(node).collect();
        let owner = |nodes: &[NodeRow], p| {
            nodes.iter().max_by_key(|node| weight(node, PartitionId(p))).unwrap().id.clone()
        };
        for i in 0..3 {
            let n = (0..64).filter(|&p| owner(&nodes, p) == i.to_string()).count();
            assert!((10..=34).contains(&n), "node {i} has {n} of 64");
        }
        for p in 0..64 {
            let before = owner(&nodes, p);
            assert!(before == "2" || owner(&nodes[..2], p) == before);
        }
    }

    #[test]
    fn a_node_that_leaves_keeps_its_partitions_until_another_can_take_them() {
        let me =
            NodeRow { id: "a".to_owned(), name: "a".to_owned(), leaving: 1, ..NodeRow::default() };
        let row = PartitionRow { owner: Some("a".to_owned()), ..PartitionRow::default() };
        let mut plan = OwnershipPlan::new("a".to_owned());
        plan.leave();
        let other = NodeRow { id: "b".to_owned(), name: "b".to_owned(), ..NodeRow::default() };
        let now = Duration::ZERO;
        let owned = [PartitionId(0)];
        assert_eq!(plan.step(now, from_ref(&me), from_ref(&row), &owned), OwnershipStep::default());
        let step = plan.step(now, &[me, other], &[row], &owned);
        assert_eq!(step.hand_over, [PartitionId(0)]);
    }
}
