//! Long computations on threads of a low priority, so that they take no time of a processor
//! that evaluating and storing samples needs.
//!
//! Such a thread only computes. It reads nothing from the store: a thread or a connection that
//! is made meanwhile would keep its low priority, and others would wait for what it holds.

use std::thread::{Builder, Scope, ScopedJoinHandle};

use tokio::sync::oneshot;

use super::ServiceError;

/// How far the priority of a thread is below that of the other threads. Only Linux has
/// priorities of single threads; elsewhere it is that of the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Priority {
    /// For a result that a person waits for: a third of the time of a thread that evaluates
    /// samples, if both want the same processor. Chosen so that a drive cycle takes some
    /// seconds also on a busy machine.
    Low,
    /// For what nobody waits for: a seventieth of that time, the least that there is.
    Lowest,
}

impl Priority {
    /// Increment of the nice value. The weights of 0, 5 and 19 are 1024, 335 and 15
    /// (`sched_prio_to_weight` of Linux).
    #[cfg(target_os = "linux")]
    const fn nice(self) -> i32 {
        match self {
            Self::Low => 5,
            Self::Lowest => 19,
        }
    }

    /// The name of a thread, at most 15 bytes.
    const fn thread_name(self) -> &'static str {
        match self {
            Self::Low => "job",
            Self::Lowest => "learning",
        }
    }

    /// Gives the current thread this priority.
    fn apply(self) {
        #[cfg(target_os = "linux")]
        if let Err(error) = rustix::process::nice(self.nice()) {
            tracing::warn!(%error, "cannot lower the priority of a thread");
        }
    }

    fn builder(self) -> Builder {
        Builder::new().name(self.thread_name().to_owned())
    }

    /// Runs `work` on a new thread that ends within `scope`.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the system refuses a thread.
    pub(super) fn spawn<'scope, T: Send + 'scope>(
        self,
        scope: &'scope Scope<'scope, '_>,
        work: impl FnOnce() -> T + Send + 'scope,
    ) -> Result<ScopedJoinHandle<'scope, T>, ServiceError> {
        let work = move || {
            self.apply();
            work()
        };
        self.builder().spawn_scoped(scope, work).map_err(refused)
    }

    /// Returns the result of `work`, which runs on a new thread, to the end even if the future
    /// is dropped.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the system refuses a thread or `work` panics.
    pub(super) async fn compute<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let (send, result) = oneshot::channel();
        let work = move || {
            self.apply();
            // Nobody waits for it if the service shuts down.
            let _ = send.send(work());
        };
        self.builder().spawn(work).map_err(refused)?;
        result.await.map_err(|_| ServiceError::Unavailable { what: "a computation failed" })
    }
}

fn refused(error: std::io::Error) -> ServiceError {
    tracing::error!(%error, "cannot start the thread of a computation");
    ServiceError::Unavailable { what: "cannot start the thread of a computation" }
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use super::*;

    /// Returns name and nice value of the current thread.
    fn this_thread() -> (String, i32) {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let (head, tail) = stat.rsplit_once(')').unwrap();
        // The nice value is the 19th field, the 17th after the name.
        let nice = tail.split_whitespace().nth(16).unwrap().parse().unwrap();
        (head.split_once('(').unwrap().1.to_owned(), nice)
    }

    #[tokio::test]
    async fn threads_have_the_priority_that_is_said() {
        let (_, here) = this_thread();
        let of = |increment: i32| (here + increment).min(19);
        for (priority, name, increment) in
            [(Priority::Low, "job", 5), (Priority::Lowest, "learning", 19)]
        {
            let expected = (name.to_owned(), of(increment));
            assert_eq!(priority.compute(this_thread).await.unwrap(), expected);
            let scoped = std::thread::scope(|scope| {
                priority.spawn(scope, this_thread).unwrap().join().unwrap()
            });
            assert_eq!(scoped, expected);
        }
        assert_eq!(this_thread().1, here, "only the new threads have it");
    }

    #[tokio::test]
    async fn a_panic_is_an_error() {
        let failed = Priority::Low.compute(|| panic!("a test")).await;
        assert!(matches!(failed, Err(ServiceError::Unavailable { .. })), "{failed:?}");
    }
}
