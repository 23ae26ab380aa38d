//! A shard: the thread that owns the running engines of its assets.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;

use tokio::sync::{OwnedSemaphorePermit, mpsc, oneshot};

use super::commit::{Life, WriteSet};
use super::handles::Handles;
use super::presence::Presences;
use super::running::{Running, Work};
use super::{Limits, ServiceError, jobs, rebuild, settled};
use crate::store::Write;

/// Something to do on a shard.
pub(super) type Job = Box<dyn FnOnce(&mut Shard) + Send>;

/// The ways to the shards; each asset has one.
#[derive(Clone)]
pub(super) struct Shards(Arc<[mpsc::Sender<Job>]>);

impl Shards {
    pub(super) fn iter(&self) -> impl Iterator<Item = &mpsc::Sender<Job>> {
        self.0.iter()
    }

    pub(super) fn of(&self, asset: &str) -> &mpsc::Sender<Job> {
        let mut hasher = DefaultHasher::new();
        asset.hash(&mut hasher);
        let number = hasher.finish() % self.0.len().max(1) as u64;
        &self.0[usize::try_from(number).unwrap_or_default()]
    }

    /// Does `act` on the shard of `asset`, when it is its turn, and gives its answer
    /// once what follows from it is durable.
    pub(super) async fn call_in_turn<T: Send + 'static>(
        &self,
        asset: &str,
        act: impl FnOnce(&Context, &mut Running, &mut Work) -> Result<T, ServiceError> + Send + 'static,
    ) -> Result<T, ServiceError> {
        let (job, answer) = acting(asset, act);
        let closing = |_| ServiceError::Unavailable { what: "the service is closing" };
        self.of(asset).send(job).await.map_err(closing)?;
        settled(answer.await)
    }

    /// The same now, or not at all.
    ///
    /// # Errors
    /// [`ServiceError`] at once if the shard's queue is full.
    pub(super) async fn call<T: Send + 'static>(
        &self,
        asset: &str,
        act: impl FnOnce(&Context, &mut Running, &mut Work) -> Result<T, ServiceError> + Send + 'static,
    ) -> Result<T, ServiceError> {
        let (job, answer) = acting(asset, act);
        self.of(asset).try_send(job).map_err(ServiceError::from_full)?;
        settled(answer.await)
    }

    /// Starts a thread for each shard; returns the ways to them and the threads.
    pub(super) fn start(
        limits: &Limits,
        context: Context,
    ) -> Result<(Self, Vec<JoinHandle<()>>), ServiceError> {
        let start = |number| {
            let (way, queue) = mpsc::channel(limits.shard_queue);
            Shard::spawn(number, context.clone(), queue).map(|thread| (way, thread))
        };
        let started: Vec<_> = (0..limits.shards).map(start).collect::<Result<_, _>>()?;
        let (ways, threads): (Vec<_>, Vec<_>) = started.into_iter().unzip();
        Ok((Self(ways.into()), threads))
    }
}

/// The job that does `act` with `asset`, and where its answer comes.
fn acting<T: Send + 'static>(
    asset: &str,
    act: impl FnOnce(&Context, &mut Running, &mut Work) -> Result<T, ServiceError> + Send + 'static,
) -> (Job, oneshot::Receiver<Result<T, ServiceError>>) {
    let (reply, answer) = oneshot::channel();
    let name = asset.to_owned();
    (Box::new(move |shard| shard.act(&name, act, reply.into())), answer)
}

/// Who waits for an outcome, and what is given back with it whether or not
/// anybody reads it.
pub(super) struct Reply<T> {
    waiting: oneshot::Sender<Result<T, ServiceError>>,
    permit: Option<OwnedSemaphorePermit>,
}

impl<T> Reply<T> {
    /// With a permit that is given back before the outcome is told, or when the
    /// reply is dropped.
    pub(super) const fn with_permit(
        waiting: oneshot::Sender<Result<T, ServiceError>>,
        permit: OwnedSemaphorePermit,
    ) -> Self {
        Self { waiting, permit: Some(permit) }
    }

    fn send(self, outcome: Result<T, ServiceError>) {
        drop(self.permit);
        // The one who asked may be gone; what is durable stays so.
        let _ = self.waiting.send(outcome);
    }
}

impl<T> From<oneshot::Sender<Result<T, ServiceError>>> for Reply<T> {
    fn from(waiting: oneshot::Sender<Result<T, ServiceError>>) -> Self {
        Self { waiting, permit: None }
    }
}

/// What a shard works with, apart from the engines.
#[derive(Clone)]
pub(super) struct Context {
    pub(super) handles: Handles,
    pub(super) presences: Presences,
    /// For work in the background.
    pub(super) jobs: mpsc::Sender<jobs::Job>,
}

impl Context {
    /// Hands over what follows; once it is durable, `reply` gets `answer` and the jobs
    /// are begun.
    fn settle<T: Send + 'static>(&self, work: Work, life: Life, answer: T, reply: Reply<T>) {
        let Work { writes, jobs, .. } = work;
        let done = Box::new(move |outcome: Result<(), ServiceError>| {
            if outcome.is_ok() {
                jobs.into_iter().for_each(|(place, job)| drop(place.send(job)));
            }
            reply.send(outcome.map(|()| answer));
        });
        self.handles.hand_over(WriteSet { writes, life, done });
    }
}

pub(super) struct Shard {
    context: Context,
    /// Boxed: they are large, and are taken out for each thing that is done.
    running: BTreeMap<String, Box<Running>>,
}

impl Shard {
    fn spawn(
        number: usize,
        context: Context,
        mut queue: mpsc::Receiver<Job>,
    ) -> Result<JoinHandle<()>, ServiceError> {
        let work = move || {
            let mut shard = Self { context, running: BTreeMap::new() };
            let engines = metrics::gauge!("offbd_engines", "shard" => number.to_string());
            while let Some(job) = queue.blocking_recv() {
                if shard.context.handles.writer().is_closed() {
                    // Nothing can become durable; dropping the job tells who waits for it.
                    continue;
                }
                job(&mut shard);
                engines.set(f64::from(u32::try_from(shard.running.len()).unwrap_or(u32::MAX)));
            }
        };
        let thread = std::thread::Builder::new().name(format!("shard-{number}"));
        thread.spawn(work).map_err(|error| {
            tracing::error!(%error, "no thread for a shard");
            ServiceError::Unavailable { what: "no thread for a shard" }
        })
    }

    /// Does `act` with the running asset `name`, loaded if need be; the answer
    /// is given once what follows is durable. An engine that panics or that
    /// has gone ahead of an error is thrown away.
    pub(super) fn act<T: Send + 'static>(
        &mut self,
        name: &str,
        act: impl FnOnce(&Context, &mut Running, &mut Work) -> Result<T, ServiceError>,
        reply: Reply<T>,
    ) {
        let mut running = match self.take(name) {
            Ok(running) => running,
            Err(error) => return reply.send(Err(error)),
        };
        let life = running.life.clone();
        let mut work = Work::at(self.context.handles.clock.now());
        let outcome =
            catch_unwind(AssertUnwindSafe(|| act(&self.context, &mut running, &mut work)));
        match outcome {
            Ok(Ok(answer)) => {
                self.context.settle(work, life, answer, reply);
                if running.deleted {
                    self.context.presences.forget(name);
                } else {
                    self.running.insert(name.to_owned(), running);
                }
            }
            Ok(Err(error)) => {
                if !work.engine_moved && work.writes.is_empty() {
                    self.running.insert(name.to_owned(), running);
                } else {
                    life.break_off();
                }
                reply.send(Err(error));
            }
            Err(_) => {
                tracing::error!(asset = name, "an engine failed; it is rebuilt from the store");
                life.break_off();
            }
        }
    }

    /// Looks at the running asset `name`; what is seen may not be durable yet.
    pub(super) fn look<T>(
        &mut self,
        name: &str,
        look: impl FnOnce(&Running) -> T,
        reply: oneshot::Sender<Result<T, ServiceError>>,
    ) {
        let seen = self.take(name).map(|running| {
            let seen = look(&running);
            self.running.insert(name.to_owned(), running);
            seen
        });
        drop(reply.send(seen));
    }

    /// Writes what `make` says if there is no asset `name`.
    pub(super) fn create(
        &mut self,
        name: &str,
        make: impl FnOnce(&Context) -> Result<Write, ServiceError>,
        reply: oneshot::Sender<Result<(), ServiceError>>,
    ) {
        let absent = match self.take(name) {
            Ok(running) => {
                self.running.insert(name.to_owned(), running);
                Err(ServiceError::AssetExists { name: name.to_owned() })
            }
            Err(ServiceError::UnknownAsset { .. }) => self.make(name, make),
            Err(error) => Err(error),
        };
        match absent {
            Ok(write) => {
                let work =
                    Work { writes: vec![write], ..Work::at(self.context.handles.clock.now()) };
                self.context.settle(work, Life::default(), (), reply.into());
            }
            Err(error) => drop(reply.send(Err(error))),
        }
    }

    /// What `make` says, unless another asset `name` is still being deleted.
    fn make(
        &self,
        name: &str,
        make: impl FnOnce(&Context) -> Result<Write, ServiceError>,
    ) -> Result<Write, ServiceError> {
        if self.context.handles.wait(self.context.handles.store.is_being_deleted(name))? {
            return Err(ServiceError::Busy { what: "the asset of this name is being deleted" });
        }
        make(&self.context)
    }

    /// The running asset, out of the shard's hands, rebuilt from the store if
    /// it is not running or has gone ahead of it.
    fn take(&mut self, name: &str) -> Result<Box<Running>, ServiceError> {
        match self.running.remove(name) {
            Some(running) if !running.life.is_broken() => Ok(running),
            _ => {
                self.context.handles.fence()?;
                let load = || rebuild::load(&self.context, name).map(Box::new);
                catch_unwind(AssertUnwindSafe(load)).unwrap_or_else(|_| {
                    tracing::error!(asset = name, "rebuilding the engine failed");
                    Err(ServiceError::Unavailable { what: "the asset's engine cannot be rebuilt" })
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{AssetRow, Place, Store};
    use offbd_core::engine::Rig;
    use offbd_core::vocabulary::Sample;
    use tokio_util::sync::CancellationToken;

    fn running() -> Box<Running> {
        let row = AssetRow {
            name: "a".to_owned(),
            document: String::new(),
            revision: 1,
            created_at: 0,
            updated_at: 0,
        };
        Box::new(Running {
            row,
            rig: Rig::chapter("a"),
            memory: Default::default(),
            provenance: Default::default(),
            open: None,
            learning: Default::default(),
            life: Life::default(),
            deleted: false,
        })
    }

    /// Whether the engine stays when `act` ends in an error.
    async fn stays(act: impl FnOnce(&mut Running, &mut Work) -> Result<(), ServiceError>) -> bool {
        let data = tempfile::tempdir().unwrap();
        let place = Place::File(data.path().join("test.sqlite"));
        let (store, _writer) = Store::open(&place).await.unwrap();
        let ((jobs, _), (writer, _)) = (mpsc::channel(1), mpsc::channel(1));
        let handles = Handles::new(store, writer, CancellationToken::new());
        let context = Context { handles, presences: Presences::default(), jobs };
        let mut shard = Shard { context, running: BTreeMap::from([("a".to_owned(), running())]) };
        let (reply, answer) = oneshot::channel();
        let act = |_: &Context, running: &mut Running, work: &mut Work| {
            act(running, work)?;
            Err::<(), _>(ServiceError::Unavailable { what: "a test" })
        };
        shard.act("a", act, reply.into());
        answer.await.unwrap().unwrap_err();
        shard.running.contains_key("a")
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_engine_that_is_ahead_of_the_store_does_not_stay() {
        assert!(stays(|_, _| Ok(())).await, "nothing was done");
        let ingest = |running: &mut Running, work: &mut Work| {
            running.open_nameless(work)?;
            let sample = Sample { t_s: 1.0, x_m: Some(0.0), ..Sample::default() };
            running.ingest(&[(0, sample)], false, work, &mut Default::default())?;
            // What follows from it was not said yet when the error came.
            work.writes.clear();
            Ok(())
        };
        assert!(!stays(ingest).await, "a sample was judged that is recorded nowhere");
    }
}
