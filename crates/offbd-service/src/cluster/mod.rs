//! A node of a cluster: several processes share a PostgreSQL database, and each owns some
//! partitions of the assets. The database decides who owns what (`store/write/ownership.rs`);
//! this task looks at it several times a second, takes partitions without an owner, and hands
//! partitions over.

mod listen;
mod plan;
mod routes;

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::{Notify, mpsc};
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

use self::plan::OwnershipPlan;
use self::routes::Look;
pub use self::routes::Route;
pub(super) use self::routes::Routes;
use super::asset::Shards;
use super::ownership::Ownership;
use super::writing::{Events, Handles, TransferRequest, Transfers};
use super::{Reasons, Service, ServiceError};
use offbd_store::{Micros, NodeIdentity, NodeRow, PartitionId, PartitionRow};
use offbd_wire::cluster::{ClusterView, NodeView, PlaceView};

/// How often a node looks at the partitions. A quarter of the time after which the server
/// ends an idle connection.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// Longest wait for a look before a read is answered.
const CONFIRM_TIMEOUT: Duration = Duration::from_secs(3);

/// Longest time for handing all partitions over at a stop. Chosen: less than
/// `limits.shutdown_s`.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(10);

/// Difference of the clocks of a node and of the database that is logged, µs. Chosen: what the
/// manual asks for.
const WRONG_CLOCK: Micros = 1_000_000;

/// What a process knows of its cluster.
#[derive(Clone)]
pub(crate) struct Cluster {
    pub(crate) me: NodeIdentity,
    pub(crate) routes: Routes,
    /// By which nodes know each other.
    pub(crate) secret: String,
    /// Tells the task to look at once.
    pub(crate) poke: Arc<Notify>,
    /// Cancelled when the node begins to stop.
    pub(crate) leaving: CancellationToken,
    /// Cancelled once nothing is owned any more.
    pub(crate) left: CancellationToken,
}

impl Cluster {
    pub(crate) fn new(me: NodeIdentity, secret: String) -> Self {
        Self {
            me,
            routes: Routes::default(),
            secret,
            poke: Arc::default(),
            leaving: CancellationToken::new(),
            left: CancellationToken::new(),
        }
    }
}

/// The background task of a node.
pub(crate) struct NodeTask {
    pub(crate) cluster: Cluster,
    pub(crate) handles: Handles,
    pub(crate) transfers: Transfers,
    pub(crate) shards: Shards,
    /// Partitions that other nodes have taken.
    pub(crate) lost: mpsc::Receiver<PartitionId>,
    /// Whether it is logged that the clock is wrong.
    pub(crate) clock: Reasons,
}

/// By how much a clock that said `before` and `after` is ahead of one that said `read_at` between
/// the two. 0 if that may be so with equal clocks, however long the answer has taken.
const fn clock_offset(read_at: Micros, before: Micros, after: Micros) -> Micros {
    if read_at < before {
        before - read_at
    } else if read_at > after {
        after - read_at
    } else {
        0
    }
}

/// Starts the tasks of a node on the current runtime. The partitions that are taken are sent to
/// `taken`.
pub(crate) fn spawn(
    task: NodeTask,
    events: &Events,
    taken: mpsc::Sender<Vec<PartitionId>>,
) -> Vec<JoinHandle<()>> {
    let handles = &task.handles;
    let closing = handles.closing.clone();
    vec![
        tokio::spawn(listen::run(handles.clone(), task.cluster.clone(), events.clone())),
        tokio::spawn(events.clone().read_all(closing.clone())),
        tokio::spawn(events.clone().announce_all(closing)),
        tokio::spawn(task.run(taken)),
    ]
}

impl NodeTask {
    /// Looks at the partitions until the service shuts down.
    #[expect(clippy::disallowed_methods, reason = "partitions move by the time of this process")]
    pub(crate) async fn run(mut self, resume: mpsc::Sender<Vec<PartitionId>>) {
        let started = Instant::now();
        let mut plan = OwnershipPlan::new(self.cluster.me.id.clone());
        let (cluster, closing) = (self.cluster.clone(), self.handles.closing.clone());
        let (mut deadline, reasons) = (None, Reasons::default());
        loop {
            if cluster.leaving.is_cancelled() && deadline.is_none() {
                deadline = Some(started.elapsed() + LEAVE_TIMEOUT);
                plan.leave();
                let left = self.transfers.call(TransferRequest::Leave).await;
                left.unwrap_or_else(|error| tracing::warn!(%error, "cannot announce the stop"));
            }
            let looked = self.look(&mut plan, started.elapsed(), &resume).await;
            if let Some(error) = reasons.new_error(looked) {
                tracing::warn!(%error, "cannot look at the partitions; trying again");
            }
            if let Some(deadline) = deadline
                && (self.is_alone_or_empty() || started.elapsed() >= deadline)
            {
                break;
            }
            tokio::select! {
                () = closing.cancelled() => break,
                () = cluster.leaving.cancelled(), if deadline.is_none() => {}
                Some(partition) = self.lost.recv() => self.drop_lost(partition).await,
                () = cluster.poke.notified() => {}
                () = tokio::time::sleep(LOOK_EVERY) => {}
            }
        }
        cluster.left.cancel();
    }

    /// Whether this node owns nothing, or no other node could take what it owns.
    fn is_alone_or_empty(&self) -> bool {
        let staying = |(node, _): &(NodeRow, usize)| node.leaving == 0;
        self.handles.ownership.owned().is_empty()
            || !self.cluster.routes.nodes().iter().any(staying)
    }

    async fn drop_lost(&self, partition: PartitionId) {
        self.shards.release(vec![partition], true).await;
    }

    /// Reads who owns what.
    async fn observe(&self) -> Result<(Vec<NodeRow>, Vec<PartitionRow>), ServiceError> {
        let look = Look::begin(&self.handles.ownership);
        let before = self.handles.clock.now();
        let (nodes, partitions) = self.transfers.call(TransferRequest::Observe).await?;
        self.compare_clocks(&nodes, before);
        self.cluster.routes.set(look, &nodes, &partitions);
        Ok((nodes, partitions))
    }

    /// Compares the clock of this node with that of the database, which was read after `before`.
    fn compare_clocks(&self, nodes: &[NodeRow], before: Micros) {
        let Some(read_at) = nodes.first().map(|node| node.read_at) else { return };
        let offset = clock_offset(read_at, before, self.handles.clock.now());
        metrics::gauge!("offbd_node_clock_offset_seconds").set(offset as f64 / 1e6);
        if offset.abs() < WRONG_CLOCK {
            self.clock.clear();
        } else if self.clock.is_new(&"wrong") {
            let offset_s = offset / 1_000_000;
            tracing::warn!(offset_s, "the clock of this node is not that of the database");
        }
    }

    async fn look(
        &mut self,
        plan: &mut OwnershipPlan,
        now: Duration,
        resume: &mpsc::Sender<Vec<PartitionId>>,
    ) -> Result<(), ServiceError> {
        let (nodes, partitions) = self.observe().await?;
        // Before anything is taken again, the engines of what was lost must be gone.
        while let Ok(partition) = self.lost.try_recv() {
            self.drop_lost(partition).await;
        }
        let step = plan.step(now, &nodes, &partitions, &self.handles.ownership.owned());
        if !step.hand_over.is_empty() {
            self.hand_over(step.hand_over).await?;
        }
        if !step.take.is_empty() {
            let taken =
                self.transfers.call(|answer| TransferRequest::Take(step.take, answer)).await?;
            metrics::counter!("offbd_partitions_taken_total").increment(taken.len() as u64);
            if !taken.is_empty() {
                tracing::info!(n = taken.len(), "partitions taken");
                self.observe().await?;
                if resume.try_send(taken).is_err() {
                    tracing::warn!("too many take-overs at a time; their jobs are not continued");
                }
            }
        }
        Ok(())
    }

    /// Gives partitions up: takes no more requests for them, completes those under way, drops
    /// the engines, and releases them.
    async fn hand_over(&self, partitions: Vec<PartitionId>) -> Result<(), ServiceError> {
        tracing::info!(n = partitions.len(), "handing partitions over");
        let ownership: &Ownership = &self.handles.ownership;
        partitions.iter().for_each(|partition| ownership.remove(*partition));
        self.shards.release(partitions.clone(), false).await;
        self.handles.barrier_async().await?;
        let n = partitions.len() as u64;
        self.transfers.call(|answer| TransferRequest::Release(partitions, answer)).await?;
        metrics::counter!("offbd_partitions_handed_over_total").increment(n);
        Ok(())
    }
}

impl Service {
    /// Where requests about `asset` are answered.
    #[must_use]
    pub fn route(&self, asset: &str) -> Route {
        let ownership = &self.inner.handles.ownership;
        let Some(cluster) = &self.inner.cluster else { return Route::Here };
        if ownership.owns(asset) {
            return Route::Here;
        }
        cluster.routes.of(ownership.partition_of(asset), &cluster.me.id)
    }

    /// Waits until requests about `asset` are not for the node at `address` any more. Does not
    /// keep the service from ending.
    pub fn moved_from(
        &self,
        asset: &str,
        address: &str,
    ) -> impl Future<Output = ()> + Send + use<> {
        let cluster = self.inner.cluster.clone();
        let partition = self.inner.handles.ownership.partition_of(asset);
        let address = address.to_owned();
        async move {
            let Some(Cluster { routes, me, .. }) = cluster else { return };
            let is_there = || routes.of(partition, &me.id).is_at(&address);
            let mut looked = routes.looked();
            while is_there() && looked.changed().await.is_ok() {}
        }
    }

    /// Waits until another node owns `asset`.
    pub async fn moved_away(&self, asset: &str) {
        let Some(cluster) = &self.inner.cluster else { return std::future::pending().await };
        let mut looked = cluster.routes.looked();
        while !matches!(self.route(asset), Route::Node { .. }) {
            // An error means that the service has ended.
            if looked.changed().await.is_err() {
                return;
            }
        }
    }

    /// Waits for another look at the database if the last one is so old that another node may
    /// own, by now, what this one does, or if the connection was lost since. Call it before a
    /// read is answered; writes need no such check, because the database makes it.
    ///
    /// # Errors
    /// [`ServiceError::Moving`] if the database does not answer in time.
    pub async fn confirm_ownership(&self) -> Result<(), ServiceError> {
        let Some(cluster) = &self.inner.cluster else { return Ok(()) };
        let ownership = &self.inner.handles.ownership;
        let is_valid = |look: &Option<Look>| look.is_some_and(|look| look.is_valid(ownership));
        let mut looked = cluster.routes.looked();
        if is_valid(&looked.borrow_and_update()) {
            return Ok(());
        }
        cluster.poke.notify_one();
        match timeout(CONFIRM_TIMEOUT, looked.wait_for(is_valid)).await {
            Ok(Ok(_)) => Ok(()),
            _ => Err(ServiceError::Moving),
        }
    }

    /// Name and address of each other node of the cluster that is alive.
    #[must_use]
    pub fn other_nodes(&self) -> Vec<(String, String)> {
        let Some(cluster) = &self.inner.cluster else { return Vec::new() };
        let others = cluster.routes.nodes().into_iter().map(|(node, _)| node);
        let others = others.filter(|node| node.id != cluster.me.id);
        others.map(|node| (node.name, node.address)).collect()
    }

    /// The number of partitions that this process owns.
    #[must_use]
    pub fn n_partitions_owned(&self) -> usize {
        self.inner.handles.ownership.owned().len()
    }

    /// Whether this process does what one of a cluster does for all.
    #[must_use]
    pub fn is_leader(&self) -> bool {
        self.inner.handles.is_leader()
    }

    /// The nodes of the cluster and their partitions, and where `asset` belongs. A process that
    /// works alone has no nodes.
    #[must_use]
    pub fn cluster(&self, asset: Option<&str>) -> ClusterView {
        let partitions = self.inner.handles.ownership.n_partitions();
        let Some(cluster) = &self.inner.cluster else {
            return ClusterView { nodes: Vec::new(), partitions, unowned: 0, asset: None };
        };
        let asset = asset.map(|asset| PlaceView {
            partition: self.inner.handles.ownership.partition_of(asset).0,
            owner: match self.route(asset) {
                Route::Here => Some(cluster.me.name.clone()),
                Route::Node { name, .. } => Some(name),
                Route::Nowhere => None,
            },
        });
        let nodes = cluster.routes.nodes();
        let n_owned: usize = nodes.iter().map(|(_, n)| n).sum();
        let node = |(row, n): (NodeRow, usize)| NodeView {
            answering: row.id == cluster.me.id,
            name: row.name,
            address: row.address,
            version: row.version,
            partitions: n,
            leaving: row.leaving != 0,
        };
        let nodes = nodes.into_iter().map(node).collect();
        ClusterView { nodes, partitions, unowned: partitions.saturating_sub(n_owned), asset }
    }

    /// Whether this process is a node of a cluster.
    #[must_use]
    pub fn is_node(&self) -> bool {
        self.inner.cluster.is_some()
    }

    /// By which the nodes of a cluster know each other; `None` without a cluster.
    #[must_use]
    pub fn cluster_secret(&self) -> Option<&str> {
        self.inner.cluster.as_ref().map(|cluster| cluster.secret.as_str())
    }

    /// Hands all partitions over to other nodes, if there are any; returns once they are
    /// released, at the latest after 10 s.
    pub async fn leave_cluster(&self) {
        if let Some(cluster) = &self.inner.cluster {
            cluster.leaving.cancel();
            cluster.left.cancelled().await;
        }
    }
}
