//! Faults of the database that a simulation plans: a transaction that fails, or that the
//! process does not survive.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::StoreError;

/// A point of a transaction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommitPoint {
    Begin,
    /// Everything is written, and nothing is durable.
    BeforeCommit,
    /// Everything is durable, and the writer does not know it.
    AfterCommit,
}

/// What happens at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommitFault {
    /// The connection is lost; so it is at the next times, in total as often as given.
    Error(u32),
    /// The process is killed.
    Kill,
}

/// The next fault, if there is one. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct FaultPlan {
    plan: Arc<Mutex<Plan>>,
}

#[derive(Debug, Default)]
struct Plan {
    next: Option<(CommitPoint, CommitFault)>,
    is_killed: bool,
}

impl FaultPlan {
    fn lock(&self) -> MutexGuard<'_, Plan> {
        self.plan.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Plans the next fault.
    pub fn set(&self, next: Option<(CommitPoint, CommitFault)>) {
        self.lock().next = next;
    }

    /// Whether the process has been killed.
    pub fn is_killed(&self) -> bool {
        self.lock().is_killed
    }

    /// Fails if a fault is planned at this point. A kill unwinds.
    pub(super) fn reach(&self, point: CommitPoint) -> Result<(), StoreError> {
        let mut plan = self.lock();
        let Some((_, fault)) = plan.next.filter(|(at, _)| *at == point) else { return Ok(()) };
        match fault {
            CommitFault::Error(n) => {
                plan.next = (n > 1).then(|| (point, CommitFault::Error(n - 1)));
                Err(sqlx::Error::Io(std::io::ErrorKind::ConnectionReset.into()).into())
            }
            CommitFault::Kill => {
                (plan.next, plan.is_killed) = (None, true);
                drop(plan);
                std::panic::resume_unwind(Box::new("killed by the simulation"))
            }
        }
    }
}
