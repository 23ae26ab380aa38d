//! Logs why something fails that is tried again and again: each reason once.

use std::collections::VecDeque;
use std::fmt::Display;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Reasons that are remembered as logged; then the oldest is forgotten. Chosen: a server that is
/// stopped and started again gives about five.
const REMEMBERED: usize = 16;

/// The reasons of the present failure that are logged.
#[derive(Debug, Default)]
pub struct Reasons {
    logged: Mutex<VecDeque<String>>,
}

impl Reasons {
    /// Notes that it has failed because of `reason`; returns whether that is to be logged.
    pub fn is_new(&self, reason: &impl Display) -> bool {
        let reason = reason.to_string();
        let mut logged = self.logged();
        let is_new = !logged.contains(&reason);
        if is_new {
            logged.truncate(REMEMBERED - 1);
            logged.push_front(reason);
        }
        is_new
    }

    /// Notes that it has succeeded.
    pub fn clear(&self) {
        self.logged().clear();
    }

    /// Notes an outcome; returns its error if that is to be logged.
    pub fn new_error<E: Display>(&self, outcome: Result<(), E>) -> Option<E> {
        match outcome {
            Ok(()) => {
                self.clear();
                None
            }
            Err(error) => self.is_new(&error).then_some(error),
        }
    }

    fn logged(&self) -> MutexGuard<'_, VecDeque<String>> {
        self.logged.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_is_logged_once_until_it_has_succeeded() {
        let reasons = Reasons::default();
        assert_eq!(reasons.new_error(Err("refused")), Some("refused"));
        assert_eq!(reasons.new_error(Err("slow")), Some("slow"));
        assert_eq!(reasons.new_error(Err("refused")), None);
        assert_eq!(reasons.new_error::<&str>(Ok(())), None);
        assert_eq!(reasons.new_error(Err("refused")), Some("refused"));
    }

    #[test]
    fn what_changes_each_time_takes_no_more_memory() {
        let reasons = Reasons::default();
        assert!((0..100).all(|attempt| reasons.is_new(&attempt)));
        assert_eq!(reasons.logged().len(), REMEMBERED);
        assert!(!reasons.is_new(&99) && reasons.is_new(&0));
    }
}
