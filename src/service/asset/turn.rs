//! The execution of one command and the changes that result from it.

use tokio::sync::mpsc::{self, OwnedPermit};

use super::command::Reply;
use super::presence::Presences;
use crate::service::ServiceError;
use crate::service::job::Job;
use crate::service::writing::{EngineGeneration, Handles, WriteSet};
use crate::store::{Micros, Write};

/// The environment shared by the assets of all shards. Cheap to clone.
#[derive(Clone)]
pub(in crate::service) struct Environment {
    pub(in crate::service) handles: Handles,
    pub(in crate::service) presences: Presences,
    /// The queue of background jobs.
    pub(in crate::service) jobs: mpsc::Sender<Job>,
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
    /// Jobs to queue once the writes are durable, each with its permit of the queue.
    pub(super) jobs: Vec<(OwnedPermit<Job>, Job)>,
    /// The room for the changes in the writer's queue.
    room: OwnedPermit<WriteSet>,
}

impl<'a> Turn<'a> {
    /// Begins a turn; blocks while the writer's queue is full.
    ///
    /// # Errors
    /// Those of [`Handles::reserve`].
    pub(super) fn begin(env: &'a Environment) -> Result<Self, ServiceError> {
        let room = env.handles.reserve()?;
        let at = env.handles.clock.now();
        Ok(Self { env, at, writes: Vec::new(), engine_changed: false, jobs: Vec::new(), room })
    }

    /// Submits the changes to the writer. Once they are durable, the jobs are queued and
    /// `answer` is sent to `reply`.
    pub(super) fn commit<T: Send + 'static>(
        self,
        asset: &str,
        generation: EngineGeneration,
        answer: T,
        reply: Reply<T>,
    ) {
        let Self { env, writes, jobs, room, .. } = self;
        let completion = Box::new(move |outcome: Result<(), ServiceError>| {
            if outcome.is_ok() {
                jobs.into_iter().for_each(|(permit, job)| drop(permit.send(job)));
            }
            reply.send(outcome.map(|()| answer));
        });
        let partition = Some(env.handles.ownership.partition_of(asset));
        room.send(WriteSet { partition, writes, generation, completion });
    }
}
