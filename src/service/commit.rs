//! The one that writes: commits all that waits as one group, then answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tracing::Instrument;

use super::ServiceError;
use super::events::{Event, Events};
use crate::store::{StoreError, TransitionRow, Write, Writer};

/// Write sets in one transaction; the next ones make the next group.
const MAX_GROUP_SETS: usize = 512;

/// How long the writer waits before it tries a database again that is away: at
/// first, and doubled each time up to the longest.
const RETRY_FIRST: Duration = Duration::from_millis(50);
const RETRY_LONGEST: Duration = Duration::from_secs(2);

/// Why nothing can be written now; none while all is well.
pub(super) type Outage = Option<String>;

/// One life of an asset's engine, from its (re)building to its end. Once
/// broken, nothing more of it is written: it is ahead of the store.
#[derive(Clone, Debug, Default)]
pub(super) struct Life {
    broken: Arc<AtomicBool>,
}

impl Life {
    pub(super) fn break_off(&self) {
        self.broken.store(true, Ordering::SeqCst);
    }

    pub(super) fn is_broken(&self) -> bool {
        self.broken.load(Ordering::SeqCst)
    }
}

/// What is told to those who wait: whether it is durable.
pub(super) type Done = Box<dyn FnOnce(bool) + Send>;

/// Changes that belong together, and who waits for them.
pub(super) struct WriteSet {
    pub(super) writes: Vec<Write>,
    pub(super) life: Life,
    pub(super) done: Done,
}

pub(super) struct Committer {
    writer: Writer,
    queue: mpsc::Receiver<WriteSet>,
    events: Events,
    outage: watch::Sender<Outage>,
    /// Bytes of the journal above which it is folded.
    journal_bytes: usize,
}

impl Committer {
    pub(super) const fn new(
        writer: Writer,
        queue: mpsc::Receiver<WriteSet>,
        events: Events,
        outage: watch::Sender<Outage>,
        journal_bytes: usize,
    ) -> Self {
        Self { writer, queue, events, outage, journal_bytes }
    }

    /// Runs on a thread of its own: among the tasks of the runtime each step of a
    /// commit would wait its turn, and everybody waits for the commit.
    pub(super) fn spawn(self) -> Result<JoinHandle<Writer>, ServiceError> {
        let runtime = Handle::current();
        let thread = std::thread::Builder::new().name("writer".to_owned());
        thread.spawn(move || runtime.block_on(self.run())).map_err(|error| {
            tracing::error!(%error, "no thread for the writer");
            ServiceError::Unavailable { what: "no thread for the writer" }
        })
    }

    /// Runs until every sender is gone and the queue is empty.
    async fn run(mut self) -> Writer {
        let mut group = Vec::new();
        while self.queue.recv_many(&mut group, MAX_GROUP_SETS).await > 0 {
            self.commit(std::mem::take(&mut group)).await;
            self.fold().await;
            self.writer.copy_log().await;
        }
        self.writer
    }

    /// Folds what is too much in the journal; nobody waits for it but the next
    /// group.
    async fn fold(&mut self) {
        let folded = self.writer.fold(self.journal_bytes).await;
        metrics::gauge!("offbd_journal_bytes").set(self.writer.journal_bytes() as f64);
        let Err(error) = folded else { return };
        metrics::counter!("offbd_commit_failures_total").increment(1);
        if error.is_outage() {
            self.come_back(&error).await;
        } else {
            tracing::error!(%error, "the journal cannot be folded");
        }
    }

    async fn commit(&mut self, group: Vec<WriteSet>) {
        let (broken, mut group): (Vec<_>, Vec<_>) =
            group.into_iter().partition(|set| set.life.is_broken());
        broken.into_iter().for_each(refuse);
        if self.write(&mut group).await {
            group.into_iter().for_each(|set| self.announce(set));
            return;
        }
        // One set may have spoilt it for all: each on its own.
        for set in group {
            let mut alone = [set];
            let written = !alone[0].life.is_broken() && self.write(&mut alone).await;
            let [set] = alone;
            if written { self.announce(set) } else { refuse(set) }
        }
    }

    /// Whether all of it is durable now. While the database is away, this
    /// waits: the queue fills up behind it, and what comes then is turned away.
    async fn write(&mut self, group: &mut [WriteSet]) -> bool {
        let mut sets: Vec<_> =
            group.iter_mut().map(|set| &mut set.writes).filter(|w| !w.is_empty()).collect();
        if sets.is_empty() {
            return true;
        }
        metrics::histogram!("offbd_commit_sets").record(sets.len() as f64);
        loop {
            let span = tracing::debug_span!("commit", sets = sets.len());
            let commit = timed(self.writer.commit(&mut sets)).instrument(span);
            let Err(error) = commit.await else {
                metrics::counter!("offbd_commits_total").increment(1);
                return true;
            };
            metrics::counter!("offbd_commit_failures_total").increment(1);
            if !error.is_outage() {
                tracing::error!(%error, sets = sets.len(), "commit failed");
                return false;
            }
            if self.come_back(&error).await {
                return true;
            }
        }
    }

    /// Waits until the database is back; returns whether the commit that
    /// failed with `error` has come through after all.
    async fn come_back(&mut self, error: &StoreError) -> bool {
        self.down(error);
        let mut wait = RETRY_FIRST;
        loop {
            tokio::time::sleep(wait).await;
            wait = (wait * 2).min(RETRY_LONGEST);
            match self.writer.reconnect().await {
                Ok(came_through) => {
                    self.up();
                    return came_through;
                }
                Err(error) => self.down(&error),
            }
        }
    }

    /// Notes why nothing can be written; logs a reason once.
    fn down(&self, error: &StoreError) {
        let reason = error.to_string();
        metrics::gauge!("offbd_store_writable").set(0.0);
        self.outage.send_if_modified(|outage| {
            let new = outage.as_ref() != Some(&reason);
            if new {
                tracing::error!(reason, "the database takes nothing; trying again");
                *outage = Some(reason);
            }
            new
        });
    }

    fn up(&self) {
        metrics::gauge!("offbd_store_writable").set(1.0);
        if self.outage.send_replace(None).is_some() {
            tracing::info!("the database is back");
        }
    }

    fn announce(&self, set: WriteSet) {
        for write in set.writes {
            let event = match write {
                Write::Transition(row) => {
                    count(&row);
                    Some(Event::of_transition(row))
                }
                Write::Act(row) => Event::of_act(row),
                _ => None,
            };
            event.into_iter().for_each(|event| self.events.publish(event));
        }
        (set.done)(true);
    }
}

/// Notes what a commit took.
#[expect(clippy::disallowed_methods, reason = "what a commit took is a metric")]
async fn timed<T>(commit: impl Future<Output = T>) -> T {
    let begun = Instant::now();
    let outcome = commit.await;
    metrics::histogram!("offbd_commit_seconds").record(begun.elapsed().as_secs_f64());
    outcome
}

fn count(row: &TransitionRow) {
    let (code, status) = (row.code.clone(), row.status.clone());
    metrics::counter!("offbd_fault_changes_total", "code" => code, "status" => status).increment(1);
}

fn refuse(set: WriteSet) {
    set.life.break_off();
    (set.done)(false);
}
