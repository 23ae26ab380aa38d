//! A shard: a thread that runs the engines of its assets. An asset is loaded by its first
//! command that does more than look, on another thread; its commands wait meanwhile.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::JoinHandle;

use tokio::sync::mpsc;

use super::actor::Asset;
use super::command::{AssetCommand, AssetLook};
use super::loader::LoadQueue;
use super::message::{LoadResult, ShardMessage};
use super::reply::Reply;
use super::turn::{Environment, Turn};
use crate::ServiceError;
use crate::writing::{EngineGeneration, WriteSet};
use offbd_store::{AssetRow, PartitionId, Write};

/// Commands of a shard that wait for assets to be loaded; at the limit, others are refused.
/// Chosen: some seconds of loading.
const MAX_WAITING: usize = 4096;

/// An asset of a shard.
enum Slot {
    /// Boxed, because it is large and is moved out for each command.
    Running(Box<Asset>),
    Loading(Loading),
}

/// An asset that is being loaded.
#[derive(Default)]
struct Loading {
    /// The commands that wait until the asset is loaded.
    waiting: Vec<AssetCommand>,
    /// Why other commands are refused: it will take longer than a client should wait.
    refusal: Option<ServiceError>,
    /// The epoch of its partition.
    epoch: i64,
}

/// The assets of one thread.
pub(crate) struct Shard {
    number: usize,
    queue: mpsc::Receiver<ShardMessage>,
    env: Environment,
    loads: LoadQueue,
    slots: BTreeMap<String, Slot>,
    /// Commands that wait for assets to be loaded.
    n_waiting: usize,
    n_running: metrics::Gauge,
}

impl Shard {
    /// Returns the shard `number`, which executes the messages of `queue`.
    pub(super) fn new(
        number: usize,
        env: Environment,
        loads: LoadQueue,
        queue: mpsc::Receiver<ShardMessage>,
    ) -> Self {
        let n_running = metrics::gauge!("offbd_engines", "shard" => number.to_string());
        let (slots, n_waiting) = (BTreeMap::new(), 0);
        Self { number, queue, env, loads, slots, n_waiting, n_running }
    }

    /// Starts the thread of the shard, which ends when all senders of its queue are dropped.
    pub(crate) fn spawn(mut self) -> Result<JoinHandle<()>, ServiceError> {
        let thread = std::thread::Builder::new().name(format!("shard-{}", self.number));
        let work = move || {
            while let Some(message) = self.queue.blocking_recv() {
                self.handle(message);
            }
            // Otherwise nobody waits for the writer, and its runtime may be ending.
            if self.env.handles.closing.is_cancelled() {
                self.stop();
            }
        };
        thread.spawn(work).map_err(|error| {
            tracing::error!(%error, "cannot start the thread of a shard");
            ServiceError::Unavailable { what: "cannot start the thread of a shard" }
        })
    }

    /// Executes the next message, if there is one.
    #[cfg(test)]
    pub(crate) fn step(&mut self) -> bool {
        let message = self.queue.try_recv().ok();
        message.map(|message| self.handle(message)).is_some()
    }

    /// Stores the engines of all open sessions at the end of the service.
    pub(crate) fn stop(&mut self) {
        for slot in std::mem::take(&mut self.slots).into_values() {
            if let Slot::Running(mut asset) = slot {
                self.n_running.decrement(1);
                self.store_engine(&mut asset);
            }
        }
    }

    /// Stores the engine of an asset that is about to be dropped in order. It is known then without
    /// being loaded, and has nothing to evaluate again when it is.
    fn store_engine(&self, asset: &mut Asset) {
        let interval = self.env.handles.sessions.snapshot_interval;
        match asset.open.as_mut().map(|open| open.last_snapshot(interval)) {
            Some(Ok(snapshot)) => asset.snapshots.extend(snapshot),
            Some(Err(error)) => {
                tracing::error!(asset = asset.row.name, %error, "an engine is not stored");
            }
            None => {}
        }
        self.store_snapshots(asset);
    }

    fn handle(&mut self, message: ShardMessage) {
        if self.env.handles.writer().is_closed() {
            // Nothing can be committed any more; dropping the reply reports an error.
            return;
        }
        match message {
            ShardMessage::Command { asset, command } => self.dispatch(&asset, command),
            ShardMessage::Rebuilding { asset, retry_after_s } => {
                self.rebuilding(&asset, retry_after_s);
            }
            ShardMessage::Loaded { asset, epoch, result } => self.loaded(&asset, epoch, *result),
            ShardMessage::Release { partitions, lost, done } => {
                self.release(&partitions, lost);
                // The receiver is gone if the service shuts down.
                let _ = done.send(());
            }
        }
    }

    /// Executes `command`, or lets it wait until the asset `name` is loaded.
    fn dispatch(&mut self, name: &str, command: AssetCommand) {
        let Some(epoch) = self.env.handles.ownership.epoch_of(name) else {
            return self.apply(name, Err(ServiceError::Moving), command);
        };
        let command = match command {
            AssetCommand::Look(look) if !self.is_running(name) => return look(Ok(None)),
            command => command,
        };
        match self.slots.remove(name) {
            Some(Slot::Loading(loading)) => return self.wait(name, loading, command),
            Some(Slot::Running(asset)) => {
                self.n_running.decrement(1);
                if !asset.generation.is_invalid() {
                    return self.apply(name, Ok(asset), command);
                }
            }
            None => {}
        }
        let refusal = self.loads.load(name, epoch);
        self.wait(name, Loading { refusal, epoch, ..Loading::default() }, command);
    }

    /// Returns whether the asset `name` is loaded, with an engine that the next command uses.
    fn is_running(&self, name: &str) -> bool {
        let slot = self.slots.get(name);
        matches!(slot, Some(Slot::Running(asset)) if !asset.generation.is_invalid())
    }

    /// Drops the engines of `partitions`, and refuses the commands that wait for them.
    fn release(&mut self, partitions: &[PartitionId], lost: bool) {
        let ownership = self.env.handles.ownership.clone();
        let is_of = |name: &String| partitions.contains(&ownership.partition_of(name));
        let names: Vec<_> = self.slots.keys().filter(|name| is_of(name)).cloned().collect();
        for name in names {
            self.env.presences.remove(&name);
            match self.slots.remove(&name) {
                Some(Slot::Running(mut asset)) => {
                    self.n_running.decrement(1);
                    match lost {
                        true => asset.generation.invalidate(),
                        false => self.store_engine(&mut asset),
                    }
                }
                Some(Slot::Loading(loading)) => {
                    self.n_waiting -= loading.waiting.len();
                    for command in loading.waiting {
                        self.apply(&name, Err(ServiceError::Moving), command);
                    }
                }
                None => {}
            }
        }
    }

    /// Lets `command` wait for the asset `name`, unless that is refused.
    fn wait(&mut self, name: &str, mut loading: Loading, command: AssetCommand) {
        let full = ServiceError::Busy { what: "too many requests wait for assets to be loaded" };
        let is_full = self.n_waiting >= MAX_WAITING;
        match loading.refusal.clone().or(is_full.then_some(full)) {
            Some(refusal) if !matches!(command, AssetCommand::Load { .. }) => {
                self.apply(name, Err(refusal), command);
            }
            _ => {
                self.n_waiting += 1;
                loading.waiting.push(command);
            }
        }
        self.slots.insert(name.to_owned(), Slot::Loading(loading));
    }

    /// Refuses the commands that wait for the asset `name`, because loading it takes long.
    fn rebuilding(&mut self, name: &str, retry_after_s: u64) {
        let Some(Slot::Loading(mut loading)) = self.slots.remove(name) else { return };
        loading.refusal = Some(ServiceError::Rebuilding { retry_after_s });
        let waiting = std::mem::take(&mut loading.waiting);
        self.n_waiting -= waiting.len();
        self.slots.insert(name.to_owned(), Slot::Loading(loading));
        waiting.into_iter().for_each(|command| self.dispatch(name, command));
    }

    /// Executes the commands that wait for the asset `name`, or refuses them.
    fn loaded(&mut self, name: &str, epoch: i64, result: LoadResult) {
        let loading = match self.slots.remove(name) {
            Some(Slot::Loading(loading)) if loading.epoch == epoch => loading,
            // What was read under an earlier epoch may be out of date.
            Some(other) => {
                self.slots.insert(name.to_owned(), other);
                return;
            }
            None => return,
        };
        self.n_waiting -= loading.waiting.len();
        let refusal = match result {
            Ok(mut asset) => {
                self.store_snapshots(&mut asset);
                self.keep(name, asset);
                None
            }
            Err(error) => Some(error),
        };
        let mut may_be_created = false;
        for command in loading.waiting {
            match &refusal {
                Some(error) if !may_be_created => {
                    may_be_created = matches!(command, AssetCommand::Create { .. });
                    self.apply(name, Err(error.clone()), command);
                }
                _ => self.dispatch(name, command),
            }
        }
    }

    /// Stores the snapshots of the engine that were taken beside its samples, if there is room for
    /// them in the writer's queue; a later rebuild takes them again.
    fn store_snapshots(&self, asset: &mut Asset) {
        let writes: Vec<_> =
            std::mem::take(&mut asset.snapshots).into_iter().map(Write::PutSnapshot).collect();
        if !writes.is_empty()
            && let Ok(room) = self.env.handles.reserve()
        {
            let (generation, completion) = (asset.generation.clone(), Box::new(|_| ()));
            let partition = Some(self.env.handles.ownership.partition_of(&asset.row.name));
            room.send(WriteSet { partition, writes, can_wait: false, generation, completion });
        }
    }

    fn keep(&mut self, name: &str, asset: Box<Asset>) {
        self.n_running.increment(1);
        self.slots.insert(name.to_owned(), Slot::Running(asset));
    }

    /// Executes `command` for the asset `name`, or refuses it with the error.
    fn apply(&mut self, name: &str, asset: LoadResult, command: AssetCommand) {
        use AssetCommand as C;
        match command {
            C::Create { document, reply } => self.create(name, asset, document, reply),
            C::Replace { rig, expected, reply } => {
                self.change(name, asset, reply, |a, turn| a.replace(*rig, &expected, turn));
            }
            C::Delete { expected, reply } => {
                self.change(name, asset, reply, |a, turn| a.delete(&expected, turn));
            }
            C::Ingest { batch, importing, request, reply } => {
                let _span = tracing::debug_span!(parent: &request, "judge").entered();
                self.change(name, asset, reply, |a, turn| a.ingest(batch, importing, turn));
            }
            C::OpenSession { name: session, importing, reply } => {
                let open =
                    |a: &mut Asset, turn: &mut Turn<'_>| a.open_session(session, importing, turn);
                self.change(name, asset, reply, open);
            }
            C::EndSession { session, reply } => {
                self.change(name, asset, reply, |a, turn| a.end_session(&session, turn));
            }
            C::DiscardImport { session, reply } => {
                self.change(name, asset, reply, |a, turn| a.discard_import(session, turn));
            }
            C::DeleteSession { session, reply } => {
                self.change(name, asset, reply, |a, turn| a.delete_session(session, turn));
            }
            C::Clear { code, actor, reply } => {
                self.change(name, asset, reply, |a, turn| a.clear(code, actor, turn));
            }
            C::Acknowledge { code, actor, reply } => {
                self.change(name, asset, reply, |a, turn| a.acknowledge(code, actor, turn));
            }
            C::Activate { id, calibration, by, reply } => {
                self.change(name, asset, reply, |a, turn| a.activate(*calibration, &id, by, turn));
            }
            C::FinishCalibration { row, reply } => {
                self.change(name, asset, reply, |a, turn| a.finish_calibration(*row, turn));
            }
            C::OfferedCalibration { reply } => {
                self.change(name, asset, reply, |a, _| Ok(a.offered_calibration()));
            }
            C::AcceptLearning { id, calibration, by, reply } => {
                let accept = |a: &mut Asset, turn: &mut Turn<'_>| {
                    a.accept_learning(*calibration, &id, by, turn)
                };
                self.change(name, asset, reply, accept);
            }
            C::DiscardLearning { reply } => {
                self.change(name, asset, reply, |a, turn| a.discard_learning(turn));
            }
            C::Rebuild { reply } => self.change(name, asset, reply, |a, turn| a.rebuild(turn)),
            C::Load { reply } => {
                self.show(name, asset, Box::new(|asset| reply.send(asset.map(|_| ()))));
            }
            C::Look(look) => self.show(name, asset, look),
        }
    }

    /// Executes a command that changes the asset `name`. The reply is sent once the changes
    /// are durable. If the engine panics, or is ahead of the store when `change` fails, it
    /// is dropped and rebuilt by the next command.
    fn change<T: Send + 'static>(
        &mut self,
        name: &str,
        asset: LoadResult,
        reply: Reply<T>,
        change: impl FnOnce(&mut Asset, &mut Turn<'_>) -> Result<T, ServiceError>,
    ) {
        let mut asset = match asset {
            Ok(asset) => asset,
            Err(error) => return reply.send(Err(error)),
        };
        let mut turn = match Turn::begin(&self.env, &mut asset.generation) {
            Ok(turn) => turn,
            Err(error) => {
                self.keep(name, asset);
                return reply.send(Err(error));
            }
        };
        let generation = turn.generation.clone();
        let outcome = catch_unwind(AssertUnwindSafe(|| change(&mut asset, &mut turn)));
        match outcome {
            Ok(Ok(answer)) => {
                turn.commit(name, answer, reply);
                if asset.deleted {
                    self.env.presences.remove(name);
                } else if !asset.dropped {
                    self.keep(name, asset);
                }
            }
            Ok(Err(error)) => {
                if !turn.engine_changed && turn.writes.is_empty() {
                    self.keep(name, asset);
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

    /// Shows the asset `name` to `look`.
    fn show(&mut self, name: &str, asset: LoadResult, look: AssetLook) {
        match asset {
            Ok(asset) => {
                look(Ok(Some(&asset)));
                self.keep(name, asset);
            }
            Err(error) => look(Err(error)),
        }
    }

    /// Registers the asset `name` unless it exists or one of this name is still being
    /// deleted.
    fn create(&mut self, name: &str, asset: LoadResult, document: String, reply: Reply<()>) {
        let absent = match asset {
            Ok(asset) => {
                self.keep(name, asset);
                Err(ServiceError::AssetExists { name: name.to_owned() })
            }
            Err(ServiceError::UnknownAsset { .. }) => self.check_not_being_deleted(name),
            Err(error) => Err(error),
        };
        if let Err(error) = absent {
            return reply.send(Err(error));
        }
        let mut turn = match Turn::begin(&self.env, &mut EngineGeneration::default()) {
            Ok(turn) => turn,
            Err(error) => return reply.send(Err(error)),
        };
        turn.writes.push(Write::CreateAsset(AssetRow {
            name: name.to_owned(),
            document,
            revision: 1,
            created_at: turn.at,
            updated_at: turn.at,
        }));
        turn.commit(name, (), reply);
    }

    fn check_not_being_deleted(&self, name: &str) -> Result<(), ServiceError> {
        let handles = &self.env.handles;
        if handles.wait(handles.store.is_being_deleted(name))? {
            return Err(ServiceError::Busy { what: "an asset of this name is being deleted" });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Shards;
    use crate::asset::link_health::LinkHealth;
    use crate::asset::presence::Presences;
    use crate::asset::session::OpenSession;
    use crate::asset::session_rate::SessionRate;
    use crate::job::JobQueues;
    use crate::ownership::Ownership;
    use crate::writing::Handles;
    use crate::{Clock, Limits};
    use offbd_core::engine::{Rig, Setup};
    use offbd_core::vocabulary::Sample;
    use offbd_store::{Location, Partitions, SessionRow, Store};
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
            link: LinkHealth::default(),
            malformed: Vec::new(),
            batch_at: None,
            ended: Vec::new(),
            has_sessions: false,
            learning: Default::default(),
            generation: EngineGeneration::default(),
            deleted: false,
            dropped: false,
            snapshots: Vec::new(),
        })
    }

    /// Whether the engine is kept if an error follows `change`.
    async fn is_kept(
        change: impl FnOnce(&mut Asset, &mut Turn<'_>) -> Result<(), ServiceError>,
    ) -> bool {
        let data = tempfile::tempdir().unwrap();
        let location = Location::File(data.path().join("test.sqlite"));
        let (store, _writer) = Store::open(&location).await.unwrap();
        let (jobs, (writer, _sets)) = (JobQueues::default().automatic, mpsc::channel(1));
        let (_, outage) = watch::channel(None);
        let (mut limits, closing) = (Limits::default(), CancellationToken::new());
        limits.workers.shards = 1;
        let ownership =
            Ownership::new(Partitions::ONE, vec![(PartitionId(0), 1)], std::sync::Arc::default());
        let handles =
            Handles::new(store, Clock::System, &limits, ownership, writer, outage, closing);
        let env = Environment { handles, presences: Presences::default(), jobs };
        let (_queues, mut shards, _loader) = Shards::new(&limits, &env);
        let mut shard = shards.remove(0);
        let (reply, answer) = Reply::new();
        shard.change("a", Ok(asset()), reply, |asset, turn| {
            change(asset, turn)?;
            Err::<(), _>(ServiceError::Unavailable { what: "a test" })
        });
        answer.wait().await.unwrap_err();
        shard.slots.contains_key("a")
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_engine_that_is_ahead_of_the_store_is_dropped() {
        assert!(is_kept(|_, _| Ok(())).await, "nothing has changed");
        let ingest = |asset: &mut Asset, turn: &mut Turn<'_>| {
            let setup = Setup::new(asset.rig.clone(), None)?;
            let row = SessionRow { id: "1".to_owned(), ..SessionRow::default() };
            let open = OpenSession::new(&row, setup, asset.memory.clone(), false);
            asset.open = Some(Box::new(open));
            let sample = Sample { t_s: 1.0, x_m: Some(0.0), ..Sample::default() };
            asset.record_in_open(&[(0, sample)], turn, &mut Default::default())?;
            // The error occurs before any write is collected.
            turn.writes.clear();
            Ok(())
        };
        assert!(!is_kept(ingest).await, "the engine has evaluated a sample that is not recorded");
    }
}
