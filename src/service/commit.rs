//! The one that writes: commits all that waits as one group, then answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::sync::mpsc;

use super::events::{Event, Events};
use crate::store::{Write, Writer};

/// Write sets in one transaction; the next ones make the next group.
const MAX_GROUP_SETS: usize = 512;

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
}

impl Committer {
    pub(super) const fn new(
        writer: Writer,
        queue: mpsc::Receiver<WriteSet>,
        events: Events,
    ) -> Self {
        Self { writer, queue, events }
    }

    /// Runs until every sender is gone and the queue is empty.
    pub(super) async fn run(mut self) -> Writer {
        let mut group = Vec::new();
        while self.queue.recv_many(&mut group, MAX_GROUP_SETS).await > 0 {
            self.commit(std::mem::take(&mut group)).await;
        }
        self.writer
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

    /// Whether all of it is durable now.
    async fn write(&mut self, group: &mut [WriteSet]) -> bool {
        let mut sets: Vec<_> =
            group.iter_mut().map(|set| &mut set.writes).filter(|w| !w.is_empty()).collect();
        if sets.is_empty() {
            return true;
        }
        metrics::histogram!("offbd_commit_sets").record(sets.len() as f64);
        match self.writer.commit(&mut sets).await {
            Ok(()) => {
                metrics::counter!("offbd_commits_total").increment(1);
                true
            }
            Err(error) => {
                metrics::counter!("offbd_commit_failures_total").increment(1);
                tracing::error!(%error, sets = sets.len(), "commit failed");
                false
            }
        }
    }

    fn announce(&self, set: WriteSet) {
        for write in set.writes {
            let event = match write {
                Write::Transition(row) => Some(Event::of_transition(row)),
                Write::Act(row) => Event::of_act(row),
                _ => None,
            };
            event.into_iter().for_each(|event| self.events.publish(event));
        }
        (set.done)(true);
    }
}

fn refuse(set: WriteSet) {
    set.life.break_off();
    (set.done)(false);
}
