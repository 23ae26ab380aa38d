//! Decides which partitions a node takes and which it hands over: a state machine without
//! clock, database or network. It need not be right for correctness, which the fence of the
//! store guarantees; it is what makes a take-over fast and the distribution even.

use std::collections::BTreeSet;
use std::time::Duration;

use sha2::{Digest, Sha256};

use offbd_store::{NodeRow, PartitionId, PartitionRow};

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

    /// Number of interleavings, unless the variable `PROPTEST_CASES` is set.
    const CASES: u32 = 300;

    /// A model of PostgreSQL: locks that end with their session, and owners.
    #[derive(Default)]
    struct Database {
        /// The node and session that hold the lock of each partition, and how often.
        locks: BTreeMap<u32, (usize, u64, u32)>,
        epochs: BTreeMap<u32, i64>,
        owners: BTreeMap<u32, String>,
        /// The session of each node that is connected.
        sessions: BTreeMap<usize, u64>,
        leaving: BTreeSet<usize>,
        n_sessions: u64,
    }

    /// What a node has read of the database.
    type View = (Vec<NodeRow>, Vec<PartitionRow>);

    impl Database {
        fn connect(&mut self, node: usize) -> u64 {
            self.end(node);
            self.n_sessions += 1;
            self.sessions.insert(node, self.n_sessions);
            self.n_sessions
        }

        fn end(&mut self, node: usize) {
            if let Some(session) = self.sessions.remove(&node) {
                self.locks.retain(|_, (holder, of, _)| (*holder, *of) != (node, session));
            }
        }

        fn view(&self) -> View {
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

        /// Takes a lock if no other session has it; counts one that this session has.
        fn lock(&mut self, node: usize, session: u64, partition: u32) -> bool {
            let is_connected = self.sessions.get(&node) == Some(&session);
            let lock = self.locks.entry(partition).or_insert((node, session, 0));
            let is_mine = is_connected && (lock.0, lock.1) == (node, session);
            lock.2 += u32::from(is_mine);
            self.locks.retain(|_, (_, _, n)| *n > 0);
            is_mine
        }

        fn begin_epoch(&mut self, node: usize, partition: u32) -> i64 {
            self.owners.insert(partition, format!("id-{node}"));
            let epoch = self.epochs.entry(partition).or_default();
            *epoch += 1;
            *epoch
        }

        fn release(&mut self, partition: u32) {
            self.owners.remove(&partition);
            if let Some((_, _, n)) = self.locks.get_mut(&partition) {
                *n -= 1;
            }
            self.locks.retain(|_, (_, _, n)| *n > 0);
        }
    }

    struct Node {
        plan: OwnershipPlan,
        session: u64,
        /// What the writer owns, with its epoch.
        held: BTreeMap<u32, i64>,
        /// What the service takes requests for: less than the writer owns while partitions are
        /// handed over.
        owned: BTreeSet<u32>,
        /// The last look, which may be old when it is acted on.
        view: Option<View>,
        /// The members of the last look that it acted on, and since when they are the same.
        members: (BTreeSet<String>, Duration),
        is_paused: bool,
    }

    impl Node {
        fn new(i: usize, session: u64) -> Self {
            Self {
                plan: OwnershipPlan::new(format!("id-{i}")),
                session,
                held: BTreeMap::new(),
                owned: BTreeSet::new(),
                view: None,
                members: (BTreeSet::new(), Duration::ZERO),
                is_paused: false,
            }
        }
    }

    #[derive(Clone, Debug)]
    enum Event {
        Look(usize),
        /// Does what the plan says about the last look; hand-overs may stop before the release.
        Act(usize, bool),
        /// Stops a process; its session ends if the server loses patience.
        Pause(usize, bool),
        Resume(usize),
        /// The server ends the session of a process.
        Disconnect(usize),
        Kill(usize),
        Leave(usize),
        Wait(u64),
    }

    fn event() -> impl Strategy<Value = Event> {
        let node = || 0..N_NODES;
        prop_oneof![
            10 => node().prop_map(Event::Look),
            10 => (node(), prop::bool::weighted(0.2)).prop_map(|(n, fails)| Event::Act(n, fails)),
            2 => (node(), any::<bool>()).prop_map(|(node, ends)| Event::Pause(node, ends)),
            3 => node().prop_map(Event::Resume),
            2 => node().prop_map(Event::Disconnect),
            1 => node().prop_map(Event::Kill),
            1 => node().prop_map(Event::Leave),
            3 => (0..12_000_u64).prop_map(Event::Wait),
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
            let nodes = (0..N_NODES).map(|node| Node::new(node, database.connect(node))).collect();
            Self { now: Duration::ZERO, database, nodes }
        }

        /// Connects again if the connection is lost, and keeps what has the same epoch.
        fn look(&mut self, i: usize) {
            let Self { database, nodes, .. } = self;
            let node = &mut nodes[i];
            if node.is_paused {
                return;
            }
            if database.sessions.get(&i) != Some(&node.session) {
                node.session = database.connect(i);
                let session = node.session;
                node.held.retain(|partition, epoch| {
                    database.epochs.get(partition) == Some(&*epoch)
                        && database.lock(i, session, *partition)
                });
                node.owned.retain(|partition| node.held.contains_key(partition));
            }
            node.view = Some(database.view());
        }

        /// Does what the plan says. Returns an error if that is not allowed.
        fn act(&mut self, i: usize, hand_over_fails: bool) -> Result<OwnershipStep, String> {
            let (now, me) = (self.now, format!("id-{i}"));
            let node = &mut self.nodes[i];
            let is_connected = self.database.sessions.get(&i) == Some(&node.session);
            let Some(view) = node.view.take_if(|_| !node.is_paused && is_connected) else {
                return Ok(OwnershipStep::default());
            };
            let members: BTreeSet<_> = view.0.iter().map(|node| node.id.clone()).collect();
            if members != node.members.0 {
                node.members = (members, now);
            }
            let owned: Vec<_> = node.owned.iter().copied().map(PartitionId).collect();
            let step = node.plan.step(now, &view.0, &view.1, &owned);
            check(&step, &view, &me, now.saturating_sub(node.members.1) >= SETTLED_AFTER)?;
            for PartitionId(partition) in &step.hand_over {
                node.owned.remove(partition);
                if !hand_over_fails && node.held.remove(partition).is_some() {
                    self.database.release(*partition);
                }
            }
            for &PartitionId(partition) in &step.take {
                let is_held = node.held.contains_key(&partition);
                if is_held || self.database.lock(i, node.session, partition) {
                    node.held.insert(partition, self.database.begin_epoch(i, partition));
                    node.owned.insert(partition);
                }
            }
            Ok(step)
        }

        fn apply(&mut self, event: &Event) -> Result<(), String> {
            match *event {
                Event::Look(node) => self.look(node),
                Event::Act(node, fails) => return self.act(node, fails).map(drop),
                Event::Pause(node, session_ends) => {
                    self.nodes[node].is_paused = true;
                    if session_ends {
                        self.database.end(node);
                    }
                }
                Event::Resume(node) => self.nodes[node].is_paused = false,
                Event::Disconnect(node) => self.database.end(node),
                Event::Kill(node) => {
                    // The process restarts under the same name; ids are not reused, but the
                    // model's nodes own nothing after a start, which is what counts.
                    let session = self.database.connect(node);
                    self.nodes[node] = Node::new(node, session);
                    let id = format!("id-{node}");
                    self.database.owners.retain(|_, owner| *owner != id);
                    self.database.leaving.remove(&node);
                }
                Event::Leave(node) => {
                    self.nodes[node].plan.leave();
                    self.nodes[node].view = None;
                    self.database.leaving.insert(node);
                }
                Event::Wait(ms) => self.now += Duration::from_millis(ms),
            }
            Ok(())
        }

        /// Lets time pass until nothing moves any more, without further faults.
        fn settle(&mut self) -> Result<(), String> {
            (0..N_NODES).for_each(|node| self.nodes[node].is_paused = false);
            for _ in 0..N_PARTITIONS + 4 {
                self.now += SETTLED_AFTER;
                (0..N_NODES).for_each(|node| self.look(node));
                (0..N_NODES).try_for_each(|node| self.act(node, false).map(drop))?;
            }
            for node in 0..N_NODES {
                self.look(node);
                let step = self.act(node, false)?;
                if step != OwnershipStep::default() {
                    return Err(format!("node {node} does not come to rest: {step:?}"));
                }
            }
            Ok(())
        }

        /// The node that should own a partition at rest; `None` if all leave.
        fn wanted(&self, partition: u32) -> Option<usize> {
            let staying = (0..N_NODES).filter(|n| !self.database.leaving.contains(n));
            staying.max_by_key(|n| {
                let (name, id) = (format!("node-{n}"), format!("id-{n}"));
                let row = NodeRow { id: id.clone(), name, ..NodeRow::default() };
                (weight(&row, PartitionId(partition)).0, id)
            })
        }
    }

    /// Checks what the node `me` would do after a look: nothing is taken from one that lives,
    /// and what moves to balance the load moves a little at a time, once the members are settled.
    fn check(
        step: &OwnershipStep,
        (nodes, partitions): &View,
        me: &str,
        is_settled: bool,
    ) -> Result<(), String> {
        let owner = |partition: &PartitionId| partitions[partition.0 as usize].owner.as_deref();
        let is_alive = |owner: &str| nodes.iter().any(|node| node.id == owner);
        let is_others = |p: &&PartitionId| owner(p).is_some_and(|o| o != me && is_alive(o));
        if let Some(partition) = step.take.iter().find(is_others) {
            return Err(format!("partition {partition} is taken from a node that is alive"));
        }
        if step.hand_over.iter().any(|partition| owner(partition) != Some(me)) {
            return Err("what another node owns is handed over".to_owned());
        }
        let is_leaving = nodes.iter().any(|node| node.id == me && node.leaving == 1);
        let is_allowed = is_settled && step.hand_over.len() <= HANDED_OVER_AT_ONCE;
        if !step.hand_over.is_empty() && !is_leaving && !is_allowed {
            return Err(format!("{} partitions move, settled: {is_settled}", step.hand_over.len()));
        }
        Ok(())
    }

    fn config() -> ProptestConfig {
        let cases = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok());
        ProptestConfig { cases: cases.unwrap_or(CASES), ..ProptestConfig::default() }
    }

    proptest! {
        #![proptest_config(config())]

        /// That no two nodes commit under one epoch is not shown here: the database guarantees
        /// it, whatever the plan is.
        #[test]
        fn nothing_is_taken_from_the_living_and_in_the_end_each_partition_has_its_owner(
            events in prop::collection::vec(event(), 1..400),
        ) {
            let mut world = World::new();
            let run = events.iter().try_for_each(|event| world.apply(event));
            run.and_then(|()| world.settle()).map_err(TestCaseError::fail)?;
            for partition in 0..N_PARTITIONS {
                let Some(wanted) = world.wanted(partition) else { continue };
                let owners = (0..N_NODES).filter(|&n| world.nodes[n].owned.contains(&partition));
                prop_assert_eq!(owners.collect::<Vec<_>>(), [wanted], "partition {}", partition);
                let lock = (wanted, world.nodes[wanted].session, 1);
                prop_assert_eq!(world.database.locks.get(&partition), Some(&lock));
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
    fn what_a_failed_hand_over_has_left_is_taken_back() {
        let me = NodeRow { id: "a".to_owned(), name: "a".to_owned(), ..NodeRow::default() };
        let row = PartitionRow { owner: Some("a".to_owned()), ..PartitionRow::default() };
        let mut plan = OwnershipPlan::new("a".to_owned());
        let mut step =
            |owned: &[PartitionId]| plan.step(Duration::ZERO, from_ref(&me), from_ref(&row), owned);
        assert_eq!(step(&[]).take, [PartitionId(0)]);
        assert_eq!(step(&[PartitionId(0)]), OwnershipStep::default());
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
