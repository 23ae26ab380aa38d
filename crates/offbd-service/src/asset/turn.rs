//! The execution of one command and the changes that result from it.

use tokio::sync::mpsc::OwnedPermit;

use super::presence::Presences;
use super::reply::Reply;
use crate::ServiceError;
use crate::job::{JobQueue, JobRoom, NewJob};
use crate::writing::{EngineGeneration, Handles, WriteSet};
use offbd_store::{Micros, Write};

/// The environment shared by the assets of all shards. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Environment {
    pub(crate) handles: Handles,
    pub(crate) presences: Presences,
    /// The queue of automatic calibrations.
    pub(crate) jobs: JobQueue,
}

/// The execution of one command.
pub(super) struct Turn<'a> {
    pub(super) env: &'a Environment,
    /// When it started.
    pub(super) at: Micros,
    /// Changes to be committed together.
    pub(super) writes: Vec<Write>,
    /// Whether the engine's state has changed: if the command fails afterwards, the
    /// engine is ahead of the store.
    pub(super) engine_changed: bool,
    /// Whether the changes may be committed some milliseconds later, together with others.
    pub(super) can_wait: bool,
    /// Jobs to queue once the writes are durable, each with its room in the queue.
    pub(super) jobs: Vec<(JobRoom, NewJob)>,
    /// The engine that the changes belong to.
    pub(super) generation: EngineGeneration,
    /// Whether changes of earlier turns may not be settled yet.
    is_behind: bool,
    /// The room for the changes in the writer's queue.
    room: OwnedPermit<WriteSet>,
}

impl<'a> Turn<'a> {
    /// Begins a turn of the engine `generation`; blocks while the writer's queue is full.
    ///
    /// # Errors
    /// Those of [`Handles::reserve`].
    pub(super) fn begin(
        env: &'a Environment,
        generation: &mut EngineGeneration,
    ) -> Result<Self, ServiceError> {
        let room = env.handles.reserve()?;
        Ok(Self {
            env,
            at: env.handles.clock.now(),
            writes: Vec::new(),
            engine_changed: false,
            can_wait: false,
            jobs: Vec::new(),
            is_behind: generation.has_unsettled(),
            generation: generation.clone(),
            room,
        })
    }

    /// Blocks until the changes of earlier turns of the asset are committed or refused, so that
    /// the next read sees them; returns at once if all are and the database is available.
    ///
    /// # Errors
    /// Those of [`Handles::barrier`].
    pub(super) fn barrier(&self) -> Result<(), ServiceError> {
        let handles = &self.env.handles;
        if self.is_behind || handles.is_away() { handles.barrier() } else { Ok(()) }
    }

    /// Submits the changes to the writer. Once they are durable, the jobs are queued and
    /// `answer` is sent to `reply`.
    pub(super) fn commit<T: Send + 'static>(self, asset: &str, answer: T, reply: Reply<T>) {
        let Self { env, writes, can_wait, jobs, generation, room, .. } = self;
        let completion = Box::new(move |outcome: Result<(), ServiceError>| {
            if outcome.is_ok() {
                jobs.into_iter().for_each(|(room, job)| room.put(job));
            }
            reply.send(outcome.map(|()| answer));
        });
        let partition = Some(env.handles.ownership.partition_of(asset));
        room.send(WriteSet { partition, writes, can_wait, generation, completion });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Clock, Limits, Service};
    use offbd_store::{Location, Store};

    #[tokio::test]
    async fn a_turn_waits_only_for_earlier_changes_of_its_asset() {
        let data = tempfile::tempdir().unwrap();
        let location = Location::File(data.path().join("offbd.sqlite"));
        let (store, writer) = Store::open(&location).await.unwrap();
        let (service, mut parts) =
            Service::assemble(store, writer, Limits::default(), None, None, Clock::System);
        let handles = service.inner.handles.clone();
        let jobs = service.inner.jobs.automatic.clone();
        let env = Environment { handles, presences: Presences::default(), jobs };
        let (mut this, mut other) = (EngineGeneration::default(), EngineGeneration::default());
        let commit = |generation: &mut EngineGeneration| {
            let mut turn = Turn::begin(&env, generation).unwrap();
            turn.writes.push(Write::RemoveSnapshots { session: "none".to_owned() });
            turn.commit("a", (), Reply::new().0);
        };

        commit(&mut other);
        let turn = Turn::begin(&env, &mut this).unwrap();
        assert!(!turn.is_behind);
        turn.barrier().unwrap();
        drop(turn);
        commit(&mut this);
        assert!(Turn::begin(&env, &mut this).unwrap().is_behind);
        assert_eq!(
            parts.committer.queue.len(),
            2,
            "a turn without earlier changes sends no barrier"
        );

        assert!(parts.committer.step(usize::MAX).await);
        assert!(!Turn::begin(&env, &mut this).unwrap().is_behind);
    }
}
