//! The writer thread: commits all queued write sets as one group, then completes them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot, watch};
use tokio_util::sync::CancellationToken;
use tracing::Instrument;

use super::events::{Event, Events};
use super::pace::Pace;
use super::transfer::TransferRequest;
use super::write_set::WriteSet;
use crate::ownership::Ownership;
use crate::{Reasons, ServiceError};
use offbd_store::{ChangeSet, PartitionId, StoreError, TransitionRow, Write, Writer};

/// Limit of write sets in one transaction; further ones form the next group.
const MAX_GROUP_SETS: usize = 512;

/// Delay before the writer retries an unavailable database: the first, doubled with each
/// attempt up to the longest.
pub(crate) const FIRST_RETRY: Duration = Duration::from_millis(50);
const RETRY_LONGEST: Duration = Duration::from_secs(2);

/// Longest delay before changes are tried again for which the disk had no room. Chosen: shorter
/// than the idle time after which PostgreSQL ends the connection of a node.
const ROOM_RETRY_LONGEST: Duration = Duration::from_millis(500);

/// How often a group of write sets may find no room before each set is tried alone, and a set
/// alone before it is refused: its change may be what never fits. Chosen: some ten seconds.
const MAX_FULL: u32 = 20;

/// How often a group of write sets may fail while the database accepts other changes.
/// After that each set is tried alone, and a set that fails alone as often is refused. Two
/// losses of the connection in a row may be a coincidence, three with the same changes
/// hardly. A set on which the database hangs is therefore refused after six times the
/// timeout of a commit, 3 min.
const MAX_FAILURES: u32 = 3;

/// Time limit of a commit after shutdown has started. Less than `limits.shutdown_s`, 20 s
/// by default, to leave time for the replies.
const CLOSING_WAIT: Duration = Duration::from_secs(5);

/// Why the database is unavailable; `None` if it is available.
pub(crate) type Outage = Option<String>;

/// The writer thread's state.
pub(crate) struct Committer {
    pub(crate) writer: Writer,
    pub(crate) queue: mpsc::Receiver<WriteSet>,
    pub(crate) pace: Pace,
    pub(crate) transfers: mpsc::Receiver<TransferRequest>,
    pub(crate) ownership: Ownership,
    /// Receives the partitions that other nodes have taken. Has room for all.
    pub(crate) lost: mpsc::Sender<PartitionId>,
    pub(crate) events: Events,
    pub(crate) outage: watch::Sender<Outage>,
    /// The reasons of the present outage.
    pub(crate) reasons: Reasons,
    /// Number of successful commits.
    pub(crate) n_commits: Arc<AtomicU64>,
    /// Cancelled at shutdown: from then on an unavailable database is awaited for
    /// [`CLOSING_WAIT`] only.
    pub(crate) closing: CancellationToken,
    /// Bytes above which the journal is folded into the recordings.
    pub(crate) journal_bytes: usize,
    /// Delay before the first retry if the database is unavailable.
    pub(crate) first_retry: Duration,
}

/// Why write sets are not durable.
enum CommitFailure {
    /// The database rejects them, or has failed on them [`MAX_FAILURES`] times.
    Rejected,
    /// They need a part of the database that is damaged.
    Damaged(ServiceError),
    /// Other nodes have taken these partitions.
    Overtaken(Vec<PartitionId>),
    /// Another process has the place of this node.
    Replaced,
    /// The database is unavailable and the service is shutting down.
    Closing,
}

/// The result of waiting for an unavailable database.
enum Recovery {
    /// The database is available, and the last commit has succeeded after all.
    Committed,
    /// The database is available, and the last commit has failed.
    NotCommitted,
    /// The database is unavailable for this node, which owns nothing any more.
    Replaced,
    /// The database is unavailable and the service is shutting down.
    Closing,
}

impl Committer {
    /// Starts the writer on its own thread, so that a commit, for which all requests wait,
    /// is not delayed by other tasks of the runtime.
    pub(crate) fn spawn(self) -> Result<JoinHandle<Option<Writer>>, ServiceError> {
        let runtime = Handle::current();
        let thread = std::thread::Builder::new().name("writer".to_owned());
        thread.spawn(move || runtime.block_on(self.run())).map_err(|error| {
            tracing::error!(%error, "cannot start the writer thread");
            ServiceError::Unavailable { what: "cannot start the writer thread" }
        })
    }

    /// Commits at most `most` write sets of the queue. Returns whether there were any.
    #[cfg(test)]
    pub(crate) async fn step(&mut self, most: usize) -> bool {
        let next = std::iter::from_fn(|| self.queue.try_recv().ok());
        let group: Vec<_> = next.take(most).collect();
        let is_any = !group.is_empty();
        assert!(self.commit(group).await && self.fold().await, "the service is not closing");
        is_any
    }

    /// Runs until all senders are dropped and the queue is empty. Returns `None` if the
    /// service shuts down while the database is unavailable.
    async fn run(mut self) -> Option<Writer> {
        let mut group = Vec::new();
        loop {
            let available = tokio::select! {
                biased;
                Some(request) = self.transfers.recv() => self.transfer(request).await,
                n_sets = self.queue.recv_many(&mut group, MAX_GROUP_SETS) => {
                    if n_sets == 0 {
                        return Some(self.writer);
                    }
                    self.pace.gather(&mut self.queue, &mut group, MAX_GROUP_SETS).await;
                    self.commit(std::mem::take(&mut group)).await && self.fold().await
                }
            };
            if !available {
                self.refuse_all().await;
                return None;
            }
            self.note_lost();
            self.writer.copy_log().await;
        }
    }

    /// Executes a request about the ownership of partitions. Returns whether the writer can
    /// continue.
    async fn transfer(&mut self, request: TransferRequest) -> bool {
        match request {
            TransferRequest::Observe(answer) => {
                let found = self.writer.observe().await;
                self.answer(found, answer).await
            }
            TransferRequest::Take(partitions, answer) => {
                let taken = self.writer.take(&partitions).await;
                for (partition, epoch) in self.writer.owned() {
                    self.ownership.add(partition, epoch);
                }
                self.answer(taken, answer).await
            }
            TransferRequest::Release(partitions, answer) => {
                let released = self.writer.release(&partitions).await;
                self.answer(released, answer).await
            }
            TransferRequest::Leave(answer) => {
                let left = self.writer.leave().await;
                self.answer(left, answer).await
            }
        }
    }

    /// Answers a request. If the connection has failed, waits until the database is available.
    async fn answer<T>(
        &mut self,
        result: Result<T, StoreError>,
        answer: oneshot::Sender<Result<T, ServiceError>>,
    ) -> bool {
        let Err(error) = result else {
            // The receiver is gone if it has timed out.
            let _ = answer.send(result.map_err(ServiceError::from));
            return true;
        };
        let is_available = error.leaves_connection() && self.writer.is_connected()
            || !matches!(self.recover(&error).await, Recovery::Closing);
        let _ = answer.send(Err(error.into()));
        is_available
    }

    /// Publishes which partitions are not owned any more: other nodes take them.
    fn note_lost(&mut self) {
        for partition in self.writer.lost() {
            self.ownership.remove(partition);
            tracing::warn!(%partition, "the partition is not owned any more");
            metrics::counter!("offbd_partitions_lost_total").increment(1);
            // There is room for all partitions.
            let _ = self.lost.try_send(partition);
        }
    }

    /// Closes the queue and refuses all write sets in it.
    async fn refuse_all(&mut self) {
        tracing::warn!("the database is unavailable; unacknowledged changes may not be stored");
        self.queue.close();
        while let Some(set) = self.queue.recv().await {
            refuse(set, closing());
        }
    }

    /// Folds the journal into the recordings if it is too long. Only the next group waits
    /// for it. Returns whether the writer can continue.
    async fn fold(&mut self) -> bool {
        let mut n_full = 0;
        let error = loop {
            let folding = self.writer.fold(self.journal_bytes);
            let Some(folded) = unless_closing(&self.closing, folding).await else { return false };
            metrics::gauge!("offbd_journal_bytes").set(self.writer.journal_bytes() as f64);
            let Err(error) = folded else {
                self.note_room(n_full);
                return true;
            };
            metrics::counter!("offbd_commit_failures_total").increment(1);
            if !error.is_full() {
                self.note_room(n_full);
                break error;
            }
            n_full += 1;
            if matches!(self.await_room(&error, n_full).await, Recovery::Closing) {
                return false;
            }
        };
        if error.is_outage() {
            return !matches!(self.recover(&error).await, Recovery::Closing);
        }
        tracing::error!(%error, "cannot fold the journal");
        true
    }

    /// Commits `group`, or those of its write sets that the database accepts. Returns
    /// whether the writer can continue.
    async fn commit(&mut self, group: Vec<WriteSet>) -> bool {
        let (invalid, mut group): (Vec<_>, Vec<_>) =
            group.into_iter().partition(|set| set.generation.is_invalid());
        invalid.into_iter().for_each(refuse_invalid);
        loop {
            match self.write(&mut group).await {
                Err(CommitFailure::Overtaken(partitions)) => {
                    self.note_lost();
                    group = refuse_lost(group, &partitions);
                }
                written => return self.settle(group, written).await,
            }
        }
    }

    /// Completes or refuses the write sets of a group. Returns whether the writer can
    /// continue.
    async fn settle(&mut self, group: Vec<WriteSet>, written: Result<(), CommitFailure>) -> bool {
        match written {
            Ok(()) => group.into_iter().for_each(|set| self.complete(set)),
            Err(CommitFailure::Closing) => {
                group.into_iter().for_each(|set| refuse(set, closing()));
                return false;
            }
            // A single set may be the cause.
            Err(CommitFailure::Rejected | CommitFailure::Damaged(_)) if group.len() > 1 => {
                return self.commit_each(group).await;
            }
            Err(CommitFailure::Overtaken(partitions)) => {
                refuse_lost(group, &partitions).into_iter().for_each(refuse_moved);
            }
            Err(CommitFailure::Replaced) => group.into_iter().for_each(refuse_moved),
            Err(CommitFailure::Rejected) => group.into_iter().for_each(refuse_rejected),
            Err(CommitFailure::Damaged(error)) => {
                group.into_iter().for_each(|set| refuse(set, error.clone()));
            }
        }
        true
    }

    /// Commits each of `sets` alone. Returns whether the writer can continue.
    async fn commit_each(&mut self, sets: Vec<WriteSet>) -> bool {
        let mut available = true;
        for mut set in sets {
            if set.generation.is_invalid() {
                refuse_invalid(set);
                continue;
            }
            let written = if available {
                self.write(std::slice::from_mut(&mut set)).await
            } else {
                Err(CommitFailure::Closing)
            };
            match written {
                Ok(()) => self.complete(set),
                Err(CommitFailure::Rejected) => refuse_rejected(set),
                Err(CommitFailure::Overtaken(_) | CommitFailure::Replaced) => refuse_moved(set),
                Err(CommitFailure::Damaged(error)) => refuse(set, error),
                Err(CommitFailure::Closing) => {
                    refuse(set, closing());
                    available = false;
                }
            }
        }
        available
    }

    /// Makes all of `group` durable. Waits while the database is unavailable; meanwhile the
    /// queue fills up and further requests are refused.
    async fn write<'a>(&mut self, group: &'a mut [WriteSet]) -> Result<(), CommitFailure> {
        let changes =
            |set: &'a mut WriteSet| ChangeSet { partition: set.partition, writes: &mut set.writes };
        let mut sets: Vec<_> =
            group.iter_mut().map(changes).filter(|set| !set.writes.is_empty()).collect();
        if sets.is_empty() {
            return Ok(());
        }
        metrics::histogram!("offbd_commit_sets").record(sets.len() as f64);
        let (mut n_failed, mut n_full) = (0, 0);
        loop {
            let Err(error) = self.attempt(&mut sets).await? else { break };
            if let StoreError::Overtaken { partitions } = error {
                self.note_room(n_full);
                return Err(CommitFailure::Overtaken(partitions));
            }
            metrics::counter!("offbd_commit_failures_total").increment(1);
            if error.is_full() {
                n_full += 1;
                match self.await_room(&error, n_full).await {
                    Recovery::Committed => break,
                    Recovery::NotCommitted if n_full < MAX_FULL => continue,
                    Recovery::NotCommitted => {}
                    Recovery::Replaced => return Err(CommitFailure::Replaced),
                    Recovery::Closing => return Err(CommitFailure::Closing),
                }
            }
            n_failed += 1;
            if error.is_outage() && !error.is_full() {
                match self.recover(&error).await {
                    Recovery::Committed => break,
                    Recovery::Replaced => return Err(CommitFailure::Replaced),
                    Recovery::Closing => return Err(CommitFailure::Closing),
                    Recovery::NotCommitted if n_failed < MAX_FAILURES => continue,
                    Recovery::NotCommitted => {}
                }
            }
            tracing::error!(%error, sets = sets.len(), n_failed, "commit failed");
            if !error.is_damage() {
                // Without room the store stays unavailable until something is committed.
                if !error.is_full() {
                    self.note_room(n_full);
                }
                return Err(CommitFailure::Rejected);
            }
            if !self.is_committed_after_damage().await? {
                return Err(CommitFailure::Damaged(error.into()));
            }
            break;
        }
        if self.outage.borrow().is_some() {
            self.set_available();
        }
        metrics::counter!("offbd_commits_total").increment(1);
        self.n_commits.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    /// Tries to commit `sets` once; during shutdown within [`CLOSING_WAIT`].
    async fn attempt(
        &mut self,
        sets: &mut [ChangeSet<'_>],
    ) -> Result<Result<(), StoreError>, CommitFailure> {
        let span = tracing::debug_span!("commit", sets = sets.len());
        let commit = timed(self.writer.commit(sets)).instrument(span);
        unless_closing(&self.closing, commit).await.ok_or(CommitFailure::Closing)
    }

    /// Connects again after a commit that met a damaged part of the database. Returns whether
    /// it has succeeded after all. Waiting would not help: if each commit needs that part,
    /// all are refused, and the reason is published.
    async fn is_committed_after_damage(&mut self) -> Result<bool, CommitFailure> {
        let closing = self.closing.clone();
        match unless_closing(&closing, self.writer.reconnect()).await {
            Some(Ok(committed)) => {
                self.set_available();
                Ok(committed)
            }
            Some(Err(error)) => {
                self.set_unavailable(&error);
                Ok(false)
            }
            None => Err(CommitFailure::Closing),
        }
    }

    /// Waits after `error` until the database is available, this node has been replaced, or the
    /// service shuts down.
    async fn recover(&mut self, error: &StoreError) -> Recovery {
        let recovered = self.wait_for_database(error).await;
        if matches!(recovered, Recovery::Committed | Recovery::NotCommitted) {
            self.set_available();
        }
        recovered
    }

    /// Waits after the failure `n_full` of changes for which the disk has no room. Only when they
    /// succeed is it known that there is room: what else is written may be smaller.
    async fn await_room(&mut self, error: &StoreError, n_full: u32) -> Recovery {
        self.set_unavailable(error);
        if self.closing.is_cancelled() {
            return Recovery::Closing;
        }
        let wait = self.first_retry.saturating_mul(1 << n_full.min(10)).min(ROOM_RETRY_LONGEST);
        let (closing, mut waited) = (self.closing.clone(), Box::pin(tokio::time::sleep(wait)));
        loop {
            // Another node sees by these requests that this one is alive.
            let request = tokio::select! {
                biased;
                () = closing.cancelled() => break,
                () = &mut waited => break,
                Some(request) = self.transfers.recv() => request,
            };
            if !self.transfer(request).await {
                return Recovery::Closing;
            }
            self.note_lost();
        }
        if self.writer.is_connected() {
            return Recovery::NotCommitted;
        }
        self.wait_for_database(error).await
    }

    /// Publishes that the database is available, if changes had no room meanwhile.
    fn note_room(&mut self, n_full: u32) {
        if n_full > 0 {
            self.set_available();
        }
    }

    async fn wait_for_database(&mut self, error: &StoreError) -> Recovery {
        self.writer.disconnect();
        self.set_unavailable(error);
        let closing = self.closing.clone();
        let reconnected = unless_closing(&closing, self.reconnect()).await;
        reconnected.unwrap_or(Recovery::Closing)
    }

    /// Waits until there is a connection, or this node has been replaced: what waits is then
    /// refused, and devices go to another one.
    async fn reconnect(&mut self) -> Recovery {
        let mut wait = self.first_retry;
        loop {
            tokio::time::sleep(wait).await;
            wait = (wait * 2).min(RETRY_LONGEST);
            let error = match self.writer.reconnect().await {
                Ok(true) => return Recovery::Committed,
                Ok(false) => return Recovery::NotCommitted,
                Err(error) => error,
            };
            self.set_unavailable(&error);
            self.note_lost();
            if error.is_replaced() && self.writer.is_node() {
                return Recovery::Replaced;
            }
        }
    }

    /// Publishes why the database is unavailable; logs each reason once.
    fn set_unavailable(&mut self, error: &StoreError) {
        let reason = error.to_string();
        if self.reasons.is_new(&reason) {
            tracing::error!(reason, "the database is unavailable; retrying");
        }
        metrics::gauge!("offbd_store_writable").set(0.0);
        self.outage.send_if_modified(|outage| {
            let new = outage.as_ref() != Some(&reason);
            if new {
                *outage = Some(reason);
            }
            new
        });
    }

    fn set_available(&mut self) {
        self.reasons.clear();
        metrics::gauge!("offbd_store_writable").set(1.0);
        if self.outage.send_replace(None).is_some() {
            tracing::info!("the database is available again");
        }
    }

    /// Publishes the events of a committed write set and completes it.
    fn complete(&self, set: WriteSet) {
        let WriteSet { writes, generation, completion, .. } = set;
        for write in writes {
            let event = match write {
                Write::Transition(row) => {
                    count(&row);
                    Some(Event::of_transition(row))
                }
                Write::Action(row) => Event::of_act(row),
                Write::Communication(row) => Event::of_communication(row),
                _ => None,
            };
            event.into_iter().for_each(|event| self.events.publish(event));
        }
        // First, so that a request that follows on the answer finds nothing unsettled.
        drop(generation);
        completion(Ok(()));
    }
}

/// Records the duration of a commit.
#[expect(clippy::disallowed_methods, reason = "the duration of a commit is a metric")]
async fn timed<T>(commit: impl Future<Output = T>) -> T {
    let started = Instant::now();
    let outcome = commit.await;
    metrics::histogram!("offbd_commit_seconds").record(started.elapsed().as_secs_f64());
    outcome
}

fn count(row: &TransitionRow) {
    let (code, status) = (row.code.clone(), row.status.clone());
    metrics::counter!("offbd_fault_changes_total", "code" => code, "status" => status).increment(1);
}

/// Waits for `work`; returns `None` if it takes longer than [`CLOSING_WAIT`] after the
/// start of the shutdown.
async fn unless_closing<T>(
    closing: &CancellationToken,
    work: impl Future<Output = T>,
) -> Option<T> {
    tokio::select! {
        biased;
        outcome = work => Some(outcome),
        () = async {
            closing.cancelled().await;
            tokio::time::sleep(CLOSING_WAIT).await;
        } => None,
    }
}

const fn closing() -> ServiceError {
    ServiceError::Unavailable { what: "the service is shutting down" }
}

/// Refuses a write set that the database rejects even alone.
fn refuse_rejected(set: WriteSet) {
    let what = set.writes.first().map_or_else(String::new, Write::subject);
    tracing::error!(what, n_writes = set.writes.len(), "the store does not accept the changes");
    refuse(set, ServiceError::NotStored { what });
}

/// Refuses a write set of an invalid engine: an earlier set of it was refused.
fn refuse_invalid(set: WriteSet) {
    refuse(set, ServiceError::Unavailable { what: "earlier changes of the asset failed" });
}

/// Refuses the write sets of `partitions`, which other nodes have taken; returns the others.
fn refuse_lost(group: Vec<WriteSet>, partitions: &[PartitionId]) -> Vec<WriteSet> {
    let is_lost = |set: &WriteSet| set.partition.is_some_and(|p| partitions.contains(&p));
    let (lost, others): (Vec<_>, Vec<_>) = group.into_iter().partition(is_lost);
    lost.into_iter().for_each(refuse_moved);
    others
}

fn refuse_moved(set: WriteSet) {
    metrics::counter!("offbd_commits_overtaken_total").increment(1);
    refuse(set, ServiceError::Moving);
}

fn refuse(set: WriteSet, error: ServiceError) {
    set.generation.invalidate();
    (set.completion)(Err(error));
}
