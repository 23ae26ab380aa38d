//! Compares what the clients of a cluster sent and were told with what is stored: one function
//! that finds every violation of what a cluster promises, whatever has failed meanwhile.

mod checks;
mod commit_log;
mod fabricated;
mod replay;
mod stored;

use std::fmt;

pub use commit_log::CommitLog;
pub use stored::Stored;

use crate::support::cluster::Cluster;
use crate::support::history::{ClientHistory, Recorder};

/// What a cluster promises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Invariant {
    /// Every acknowledged sample is stored, and once.
    AcknowledgedOnce,
    /// Nothing is stored that was never sent.
    NothingUnsent,
    /// What was acknowledged before something else was sent is stored before it, in the order in
    /// which it was sent.
    InOrder,
    /// The verdict of a session, its transitions and the fault memory are those of the stored
    /// recording, judged again.
    VerdictRepeats,
    /// A subscriber gets each stored event once, in the order of their numbers.
    EventsComplete,
    /// The epoch of a partition never falls, each commit is counted in it, and by one more.
    EpochsRise,
    /// One node commits in an epoch, its owner, and no answer is older than an acknowledgement.
    OneOwner,
    /// A number that was acknowledged as stored is not beyond what is stored.
    PositionStored,
    /// A batch is stored as a whole or not at all.
    BatchWhole,
    /// What a person did to a fault is stored once if it was confirmed, not at all if it was
    /// refused, and in the order in which it was done.
    ActionsOnce,
}

/// A violation, and where it is.
#[derive(Debug)]
pub struct Violation {
    pub invariant: Invariant,
    pub place: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.invariant, self.place)
    }
}

/// Returns every violation.
pub fn violations(history: &ClientHistory, stored: &Stored) -> Vec<Violation> {
    let mut found = checks::Findings::default();
    checks::sessions(history, stored, &mut found);
    checks::judgements(stored, &mut found);
    checks::events(history, stored, &mut found);
    checks::commits(stored, &mut found);
    checks::progress(history, &mut found);
    checks::actions(history, stored, &mut found);
    found.violations
}

/// Violations that a failed test names.
const MAX_NAMED: usize = 20;

/// Ends all sessions, reads what is stored, and fails if it violates anything. Call it when all
/// clients have stopped.
pub async fn check(cluster: &Cluster, recorder: &Recorder) {
    let stored = Stored::read(cluster, recorder).await;
    let history = recorder.lock().clone();
    let found = violations(&history, &stored);
    let named: Vec<_> = found.iter().take(MAX_NAMED).map(ToString::to_string).collect();
    assert!(found.is_empty(), "{} violations:\n{}", found.len(), named.join("\n"));
    println!(
        "{} batches, {} actions, {} events, {} commits, {} sessions: nothing is violated",
        history.batches.len(),
        history.actions.len(),
        history.events.len(),
        stored.commits.counts.len(),
        stored.sessions.len(),
    );
}
