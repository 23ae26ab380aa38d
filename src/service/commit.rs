//! The one that writes: commits all that waits as one group, then answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tokio_util::sync::CancellationToken;
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

/// How often a group of sets may fail although the database answers and takes other
/// changes: then each set is tried alone, and one that fails alone as often is
/// refused. One loss of the connection may follow another by chance, three for the
/// same changes hardly. A set on which the database hangs is so given up after six
/// times the longest commit, 3 min.
const MAX_FAILURES: u32 = 3;

/// How long a commit may still take when the service closes: within
/// `limits.shutdown_s`, 20 s by default, with time left for those who wait for it.
const CLOSING_WAIT: Duration = Duration::from_secs(5);

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

/// Tells those who wait that it is durable, or why it is not.
pub(super) type Done = Box<dyn FnOnce(Result<(), ServiceError>) + Send>;

/// Changes that belong together, and who waits for them.
pub(super) struct WriteSet {
    pub(super) writes: Vec<Write>,
    pub(super) life: Life,
    pub(super) done: Done,
}

pub(super) struct Committer {
    pub(super) writer: Writer,
    pub(super) queue: mpsc::Receiver<WriteSet>,
    pub(super) events: Events,
    pub(super) outage: watch::Sender<Outage>,
    /// Commits that came through.
    pub(super) n_commits: Arc<AtomicU64>,
    /// Then a database that is away is no longer waited for.
    pub(super) closing: CancellationToken,
    /// Bytes of the journal above which it is folded.
    pub(super) journal_bytes: usize,
}

/// Why sets are not durable.
enum Failure {
    /// They cannot be, or the database has failed on them [`MAX_FAILURES`] times.
    OfTheSets,
    /// The database is away, and the service closes.
    Closing,
}

/// What a database was like when it could be asked again.
enum Back {
    /// The commit that seemed to fail has come through.
    CameThrough,
    /// It has not.
    Failed,
    /// The service closes, and the database is still away.
    Closing,
}

impl Committer {
    /// Runs on a thread of its own: among the tasks of the runtime each step of a
    /// commit would wait its turn, and everybody waits for the commit.
    pub(super) fn spawn(self) -> Result<JoinHandle<Option<Writer>>, ServiceError> {
        let runtime = Handle::current();
        let thread = std::thread::Builder::new().name("writer".to_owned());
        thread.spawn(move || runtime.block_on(self.run())).map_err(|error| {
            tracing::error!(%error, "no thread for the writer");
            ServiceError::Unavailable { what: "no thread for the writer" }
        })
    }

    /// Runs until every sender is gone and the queue is empty; returns `None` if the
    /// service closes while the database is away, which ends it too.
    async fn run(mut self) -> Option<Writer> {
        let mut group = Vec::new();
        while self.queue.recv_many(&mut group, MAX_GROUP_SETS).await > 0 {
            let went_on = self.commit(std::mem::take(&mut group)).await && self.fold().await;
            if !went_on {
                self.give_up().await;
                return None;
            }
            self.writer.copy_log().await;
        }
        Some(self.writer)
    }

    /// Refuses all that waits, and takes nothing more.
    async fn give_up(&mut self) {
        tracing::warn!("the database is away; what is not acknowledged may not be stored");
        self.queue.close();
        while let Some(set) = self.queue.recv().await {
            refuse(set, closing());
        }
    }

    /// Folds what is too much in the journal; nobody waits for it but the next
    /// group. Returns whether the writer goes on.
    async fn fold(&mut self) -> bool {
        let folding = self.writer.fold(self.journal_bytes);
        let Some(folded) = unless_closing(&self.closing, folding).await else { return false };
        metrics::gauge!("offbd_journal_bytes").set(self.writer.journal_bytes() as f64);
        let Err(error) = folded else { return true };
        metrics::counter!("offbd_commit_failures_total").increment(1);
        if error.is_outage() {
            return !matches!(self.come_back(&error).await, Back::Closing);
        }
        tracing::error!(%error, "the journal cannot be folded");
        true
    }

    /// Commits `group`, or what of it can be; returns whether the writer goes on.
    async fn commit(&mut self, group: Vec<WriteSet>) -> bool {
        let (broken, mut group): (Vec<_>, Vec<_>) =
            group.into_iter().partition(|set| set.life.is_broken());
        broken.into_iter().for_each(refuse_broken);
        match self.write(&mut group).await {
            Ok(()) => group.into_iter().for_each(|set| self.announce(set)),
            Err(Failure::Closing) => {
                group.into_iter().for_each(|set| refuse(set, closing()));
                return false;
            }
            // One set may have spoilt it for all.
            Err(Failure::OfTheSets) if group.len() > 1 => return self.commit_each(group).await,
            Err(Failure::OfTheSets) => group.into_iter().for_each(refuse_alone),
        }
        true
    }

    /// Commits each of `sets` on its own; returns whether the writer goes on.
    async fn commit_each(&mut self, sets: Vec<WriteSet>) -> bool {
        let mut goes_on = true;
        for mut set in sets {
            if set.life.is_broken() {
                refuse_broken(set);
                continue;
            }
            let written = if goes_on {
                self.write(std::slice::from_mut(&mut set)).await
            } else {
                Err(Failure::Closing)
            };
            match written {
                Ok(()) => self.announce(set),
                Err(Failure::OfTheSets) => refuse_alone(set),
                Err(Failure::Closing) => {
                    refuse(set, closing());
                    goes_on = false;
                }
            }
        }
        goes_on
    }

    /// Makes all of `group` durable. While the database is away, this waits: the queue
    /// fills up behind it, and what comes then is turned away.
    async fn write(&mut self, group: &mut [WriteSet]) -> Result<(), Failure> {
        let mut sets: Vec<_> =
            group.iter_mut().map(|set| &mut set.writes).filter(|w| !w.is_empty()).collect();
        if sets.is_empty() {
            return Ok(());
        }
        metrics::histogram!("offbd_commit_sets").record(sets.len() as f64);
        for n_failed in 1.. {
            let Err(error) = self.attempt(&mut sets).await? else { break };
            metrics::counter!("offbd_commit_failures_total").increment(1);
            if error.is_outage() {
                match self.come_back(&error).await {
                    Back::CameThrough => break,
                    Back::Closing => return Err(Failure::Closing),
                    Back::Failed if n_failed < MAX_FAILURES => continue,
                    Back::Failed => {}
                }
            }
            tracing::error!(%error, sets = sets.len(), n_failed, "commit failed");
            return Err(Failure::OfTheSets);
        }
        metrics::counter!("offbd_commits_total").increment(1);
        self.n_commits.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    /// Commits `sets` once; when the service closes, within [`CLOSING_WAIT`].
    async fn attempt(
        &mut self,
        sets: &mut [&mut Vec<Write>],
    ) -> Result<Result<(), StoreError>, Failure> {
        let span = tracing::debug_span!("commit", sets = sets.len());
        let commit = timed(self.writer.commit(sets)).instrument(span);
        unless_closing(&self.closing, commit).await.ok_or(Failure::Closing)
    }

    /// Waits until the database is back after `error`, or the service closes.
    async fn come_back(&mut self, error: &StoreError) -> Back {
        self.down(error);
        let closing = self.closing.clone();
        match unless_closing(&closing, self.reconnect()).await {
            Some(true) => Back::CameThrough,
            Some(false) => Back::Failed,
            None => Back::Closing,
        }
    }

    /// Waits until the database is back; returns whether the commit that failed last
    /// has come through after all.
    async fn reconnect(&mut self) -> bool {
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
        (set.done)(Ok(()));
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

/// The outcome of `work`; `None` if the service has been closing for [`CLOSING_WAIT`]
/// before it is there.
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
    ServiceError::Unavailable { what: "the service is closing" }
}

/// Refuses a set that the database does not take, also alone.
fn refuse_alone(set: WriteSet) {
    let what = set.writes.first().map_or_else(String::new, Write::subject);
    tracing::error!(what, n_writes = set.writes.len(), "refused: the store does not take it");
    refuse(set, ServiceError::NotStored { what });
}

/// Refuses a set of an engine that has gone ahead of one that was refused.
fn refuse_broken(set: WriteSet) {
    refuse(set, ServiceError::Unavailable { what: "what came before it is not stored" });
}

fn refuse(set: WriteSet, why: ServiceError) {
    set.life.break_off();
    (set.done)(Err(why));
}
