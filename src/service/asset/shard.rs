//! A shard: a thread that runs the engines of its assets.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;

use tokio::sync::mpsc;

use super::actor::Asset;
use super::command::{AssetCommand, Reply};
use super::load::load;
use super::turn::{Environment, Turn};
use crate::service::writing::EngineGeneration;
use crate::service::{Limits, ServiceError};
use crate::store::{AssetRow, Write};

/// A command for the asset of this name.
pub(in crate::service) struct ShardMessage {
    asset: String,
    command: AssetCommand,
}

/// The queues of all shards. The hash of its name assigns each asset to one shard. Cheap to
/// clone.
#[derive(Clone)]
pub(in crate::service) struct Shards(Arc<[mpsc::Sender<ShardMessage>]>);

impl Shards {
    /// Starts a thread for each shard; returns the queues and the threads.
    pub(in crate::service) fn start(
        limits: &Limits,
        env: Environment,
    ) -> Result<(Self, Vec<JoinHandle<()>>), ServiceError> {
        let start = |number| {
            let (sender, queue) = mpsc::channel(limits.shard_queue);
            Shard::spawn(number, env.clone(), queue).map(|thread| (sender, thread))
        };
        let started: Vec<_> = (0..limits.shards).map(start).collect::<Result<_, _>>()?;
        let (senders, threads): (Vec<_>, Vec<_>) = started.into_iter().unzip();
        Ok((Self(senders.into()), threads))
    }

    pub(in crate::service) fn iter(&self) -> impl Iterator<Item = &mpsc::Sender<ShardMessage>> {
        self.0.iter()
    }

    fn of(&self, asset: &str) -> &mpsc::Sender<ShardMessage> {
        let mut hasher = DefaultHasher::new();
        asset.hash(&mut hasher);
        let number = hasher.finish() % self.0.len().max(1) as u64;
        &self.0[usize::try_from(number).unwrap_or_default()]
    }

    /// Queues `command` for `asset`.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if the queue is full.
    pub(in crate::service) fn try_send(
        &self,
        asset: &str,
        command: AssetCommand,
    ) -> Result<(), ServiceError> {
        let message = ShardMessage { asset: asset.to_owned(), command };
        self.of(asset).try_send(message).map_err(ServiceError::from_full)
    }

    /// Queues `command` for `asset`; waits while the queue is full.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the service is shutting down.
    pub(in crate::service) async fn send(
        &self,
        asset: &str,
        command: AssetCommand,
    ) -> Result<(), ServiceError> {
        let message = ShardMessage { asset: asset.to_owned(), command };
        let closing = |_| ServiceError::Unavailable { what: "the service is shutting down" };
        self.of(asset).send(message).await.map_err(closing)
    }

    /// Queues the command that `make` returns and waits for its reply.
    ///
    /// # Errors
    /// [`ServiceError::Busy`] if the queue is full; those of the command.
    pub(in crate::service) async fn call<T>(
        &self,
        asset: &str,
        make: impl FnOnce(Reply<T>) -> AssetCommand,
    ) -> Result<T, ServiceError> {
        let (reply, answer) = Reply::new();
        self.try_send(asset, make(reply))?;
        answer.wait().await
    }
}

/// The assets of one thread.
struct Shard {
    env: Environment,
    /// Boxed, because they are large and are moved out for each command.
    running: BTreeMap<String, Box<Asset>>,
}

impl Shard {
    fn spawn(
        number: usize,
        env: Environment,
        mut queue: mpsc::Receiver<ShardMessage>,
    ) -> Result<JoinHandle<()>, ServiceError> {
        let work = move || {
            let mut shard = Self { env, running: BTreeMap::new() };
            let engines = metrics::gauge!("offbd_engines", "shard" => number.to_string());
            while let Some(ShardMessage { asset, command }) = queue.blocking_recv() {
                if shard.env.handles.writer().is_closed() {
                    // Nothing can be committed any more; dropping the reply reports an error.
                    continue;
                }
                shard.apply(&asset, command);
                engines.set(f64::from(u32::try_from(shard.running.len()).unwrap_or(u32::MAX)));
            }
        };
        let thread = std::thread::Builder::new().name(format!("shard-{number}"));
        thread.spawn(work).map_err(|error| {
            tracing::error!(%error, "cannot start the thread of a shard");
            ServiceError::Unavailable { what: "cannot start the thread of a shard" }
        })
    }

    fn apply(&mut self, name: &str, command: AssetCommand) {
        use AssetCommand as C;
        match command {
            C::Create { document, reply } => self.create(name, document, reply),
            C::Replace { rig, reply } => self.change(name, reply, |a, turn| a.replace(*rig, turn)),
            C::Delete { reply } => self.change(name, reply, |a, turn| a.delete(turn)),
            C::Ingest { batch, importing, request, reply } => {
                let _span = tracing::debug_span!(parent: &request, "judge").entered();
                self.change(name, reply, |a, turn| a.ingest(batch, importing, turn));
            }
            C::OpenSession { name: session, importing, reply } => {
                self.change(name, reply, |a, turn| a.open_session(session, importing, turn));
            }
            C::EndSession { session, reply } => {
                self.change(name, reply, |a, turn| a.end_session(&session, turn));
            }
            C::DiscardImport { session, reply } => {
                self.change(name, reply, |a, turn| a.discard_import(session, turn));
            }
            C::DeleteSession { session, reply } => {
                self.change(name, reply, |a, turn| a.delete_session(session, turn));
            }
            C::Clear { code, actor, reply } => {
                self.change(name, reply, |a, turn| a.clear(code, actor, turn));
            }
            C::Acknowledge { code, actor, reply } => {
                self.change(name, reply, |a, turn| a.acknowledge(code, actor, turn));
            }
            C::Activate { id, calibration, reply } => {
                self.change(name, reply, |a, turn| a.activate(*calibration, &id, turn));
            }
            C::FinishCalibration { row, reply } => {
                self.change(name, reply, |a, turn| a.finish_calibration(*row, turn));
            }
            C::OfferedCalibration { reply } => {
                self.change(name, reply, |a, _| Ok(a.offered_calibration()));
            }
            C::AcceptLearning { id, calibration, reply } => {
                self.change(name, reply, |a, turn| a.accept_learning(*calibration, &id, turn));
            }
            C::DiscardLearning { reply } => {
                self.change(name, reply, |a, turn| a.discard_learning(turn));
            }
            C::Load { reply } => self.query(name, reply, |_| ()),
            C::State { reply } => self.query(name, reply, Asset::state),
            C::Watch { session, seen, reply } => {
                self.query(name, reply, |a| a.watch(session, seen));
            }
            C::Monitors { reply } => self.query(name, reply, Asset::monitors),
            C::Learning { reply } => self.query(name, reply, Asset::learning),
        }
    }

    /// Executes a command that changes the asset `name`, which is loaded if necessary. The
    /// reply is sent once the changes are durable. If the engine panics, or is ahead of the
    /// store when `change` fails, it is dropped and rebuilt by the next command.
    fn change<T: Send + 'static>(
        &mut self,
        name: &str,
        reply: Reply<T>,
        change: impl FnOnce(&mut Asset, &mut Turn<'_>) -> Result<T, ServiceError>,
    ) {
        let mut asset = match self.take(name) {
            Ok(asset) => asset,
            Err(error) => return reply.send(Err(error)),
        };
        let generation = asset.generation.clone();
        let mut turn = Turn::begin(&self.env);
        let outcome = catch_unwind(AssertUnwindSafe(|| change(&mut asset, &mut turn)));
        match outcome {
            Ok(Ok(answer)) => {
                turn.commit(generation, answer, reply);
                if asset.deleted {
                    self.env.presences.remove(name);
                } else {
                    self.running.insert(name.to_owned(), asset);
                }
            }
            Ok(Err(error)) => {
                if !turn.engine_changed && turn.writes.is_empty() {
                    self.running.insert(name.to_owned(), asset);
                } else {
                    generation.invalidate();
                }
                reply.send(Err(error));
            }
            Err(_) => {
                tracing::error!(asset = name, "an engine panicked; it is rebuilt from the store");
                generation.invalidate();
            }
        }
    }

    /// Executes a query of the asset `name`, which is loaded if necessary. The reply may
    /// show changes that are not durable yet.
    fn query<T>(&mut self, name: &str, reply: Reply<T>, query: impl FnOnce(&Asset) -> T) {
        let answer = self.take(name).map(|asset| {
            let answer = query(&asset);
            self.running.insert(name.to_owned(), asset);
            answer
        });
        reply.send(answer);
    }

    /// Registers the asset `name` unless it exists or one of this name is still being
    /// deleted.
    fn create(&mut self, name: &str, document: String, reply: Reply<()>) {
        let absent = match self.take(name) {
            Ok(asset) => {
                self.running.insert(name.to_owned(), asset);
                Err(ServiceError::AssetExists { name: name.to_owned() })
            }
            Err(ServiceError::UnknownAsset { .. }) => self.check_not_being_deleted(name),
            Err(error) => Err(error),
        };
        if let Err(error) = absent {
            return reply.send(Err(error));
        }
        let mut turn = Turn::begin(&self.env);
        turn.writes.push(Write::CreateAsset(AssetRow {
            name: name.to_owned(),
            document,
            revision: 1,
            created_at: turn.at,
            updated_at: turn.at,
        }));
        turn.commit(EngineGeneration::default(), (), reply);
    }

    fn check_not_being_deleted(&self, name: &str) -> Result<(), ServiceError> {
        let handles = &self.env.handles;
        if handles.wait(handles.store.is_being_deleted(name))? {
            return Err(ServiceError::Busy { what: "an asset of this name is being deleted" });
        }
        Ok(())
    }

    /// Moves the asset out of the shard; loads it from the store if it is not running or
    /// its engine is invalid.
    fn take(&mut self, name: &str) -> Result<Box<Asset>, ServiceError> {
        match self.running.remove(name) {
            Some(asset) if !asset.generation.is_invalid() => Ok(asset),
            _ => {
                self.env.handles.fence()?;
                let load = || load(&self.env, name).map(Box::new);
                catch_unwind(AssertUnwindSafe(load)).unwrap_or_else(|_| {
                    tracing::error!(asset = name, "rebuilding the engine panicked");
                    let what = "the engine of the asset cannot be rebuilt";
                    Err(ServiceError::Unavailable { what })
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::asset::presence::Presences;
    use crate::service::asset::session::OpenSession;
    use crate::service::asset::session_rate::SessionRate;
    use crate::service::writing::Handles;
    use crate::store::{Location, Store};
    use offbd_core::engine::{Rig, Setup};
    use offbd_core::vocabulary::Sample;
    use tokio::sync::watch;
    use tokio_util::sync::CancellationToken;

    fn asset() -> Box<Asset> {
        let row = AssetRow {
            name: "a".to_owned(),
            document: String::new(),
            revision: 1,
            created_at: 0,
            updated_at: 0,
        };
        Box::new(Asset {
            row,
            rig: Rig::chapter("a"),
            memory: Default::default(),
            provenance: Default::default(),
            open: None,
            session_rate: SessionRate::default(),
            learning: Default::default(),
            generation: EngineGeneration::default(),
            deleted: false,
        })
    }

    /// Whether the engine is kept if an error follows `change`.
    async fn is_kept(
        change: impl FnOnce(&mut Asset, &mut Turn<'_>) -> Result<(), ServiceError>,
    ) -> bool {
        let data = tempfile::tempdir().unwrap();
        let location = Location::File(data.path().join("test.sqlite"));
        let (store, _writer) = Store::open(&location).await.unwrap();
        let ((jobs, _), (writer, _)) = (mpsc::channel(1), mpsc::channel(1));
        let (_, outage) = watch::channel(None);
        let handles = Handles::new(store, writer, outage, CancellationToken::new());
        let env = Environment { handles, presences: Presences::default(), jobs };
        let mut shard = Shard { env, running: BTreeMap::from([("a".to_owned(), asset())]) };
        let (reply, answer) = Reply::new();
        shard.change("a", reply, |asset, turn| {
            change(asset, turn)?;
            Err::<(), _>(ServiceError::Unavailable { what: "a test" })
        });
        answer.wait().await.unwrap_err();
        shard.running.contains_key("a")
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_engine_that_is_ahead_of_the_store_is_dropped() {
        assert!(is_kept(|_, _| Ok(())).await, "nothing has changed");
        let ingest = |asset: &mut Asset, turn: &mut Turn<'_>| {
            let setup = Setup::new(asset.rig.clone(), None)?;
            let (id, memory) = ("1".to_owned(), asset.memory.clone());
            asset.open = Some(OpenSession::new(id, "s".to_owned(), setup, memory, false));
            let sample = Sample { t_s: 1.0, x_m: Some(0.0), ..Sample::default() };
            asset.record_named(&[(0, sample)], turn, &mut Default::default())?;
            // The error occurs before any write is collected.
            turn.writes.clear();
            Ok(())
        };
        assert!(!is_kept(ingest).await, "the engine has evaluated a sample that is not recorded");
    }
}
