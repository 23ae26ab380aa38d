//! When the writer waits for further write sets: many devices that send one sample at a time cost
//! one commit together, and none that waits for its acknowledgement waits longer.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{Instant, timeout_at};

use super::write_set::WriteSet;

/// How long a group waits for write sets of other devices. Chosen: at a thousand requests a second it
/// gathers five of them, which then cost one write of the log and one sync.
const LONGEST_WAIT: Duration = Duration::from_millis(5);

/// Time over which the rate of the write sets is averaged, s. Chosen: some periods of devices that
/// send ten times a second.
const MEMORY_S: f64 = 0.25;

/// How often write sets arrive that can wait.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    noted_at: Option<Instant>,
    per_s: f64,
}

impl Pace {
    /// Adds further write sets of `queue` to `group`, up to `most`, as long as all of the group can
    /// wait and others are to be expected.
    #[expect(clippy::disallowed_methods, reason = "when changes are stored, not what they are")]
    pub(super) async fn gather(
        &mut self,
        queue: &mut mpsc::Receiver<WriteSet>,
        group: &mut Vec<WriteSet>,
        most: usize,
    ) {
        let patient = |sets: &[WriteSet]| sets.iter().filter(|set| set.can_wait).count();
        let mut n_patient = patient(group);
        let end = Instant::now() + LONGEST_WAIT;
        while n_patient == group.len() && group.len() < most && self.expects_another() {
            let n_before = group.len();
            let next = queue.recv_many(group, most - n_before);
            if !matches!(timeout_at(end, next).await, Ok(1..)) {
                break;
            }
            n_patient += patient(&group[n_before..]);
        }
        self.note(n_patient, Instant::now());
    }

    /// Notes `n` write sets that can wait.
    fn note(&mut self, n: usize, now: Instant) {
        let Some(before) = self.noted_at.replace(now) else { return };
        let elapsed_s = (now - before).as_secs_f64();
        if elapsed_s > 0.0 {
            let share = 1.0 - (-elapsed_s / MEMORY_S).exp();
            self.per_s += share * (n as f64 / elapsed_s - self.per_s);
        }
    }

    /// Whether one is to be expected within [`LONGEST_WAIT`].
    fn expects_another(&self) -> bool {
        self.per_s * LONGEST_WAIT.as_secs_f64() >= 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::writing::EngineGeneration;

    fn set(can_wait: bool) -> WriteSet {
        let (generation, completion) = (EngineGeneration::default(), Box::new(|_| ()));
        WriteSet { partition: None, writes: Vec::new(), can_wait, generation, completion }
    }

    /// A pace at which write sets have arrived every `period` for a second.
    #[expect(clippy::disallowed_methods, reason = "the origin of the times does not matter")]
    fn pace(period: Duration) -> Pace {
        let (mut pace, start) = (Pace::default(), Instant::now());
        let times = (0..).map(|i| period * i).take_while(|at| *at < Duration::from_secs(1));
        times.for_each(|at| pace.note(1, start + at));
        pace
    }

    /// Returns how many write sets a group has that begins with `first` and may wait for `others`,
    /// after which none will come.
    async fn gathered(mut pace: Pace, first: WriteSet, others: Vec<WriteSet>) -> usize {
        let (sender, mut queue) = mpsc::channel(10);
        for set in others {
            sender.send(set).await.unwrap();
        }
        drop(sender);
        let mut group = vec![first];
        pace.gather(&mut queue, &mut group, 4).await;
        group.len()
    }

    #[tokio::test]
    async fn write_sets_that_can_wait_are_gathered_if_others_are_expected() {
        let dense = || pace(Duration::from_millis(3));
        assert_eq!(gathered(dense(), set(true), vec![set(true), set(true)]).await, 3);
        assert_eq!(gathered(dense(), set(true), (0..9).map(|_| set(true)).collect()).await, 4);
        assert_eq!(gathered(dense(), set(true), vec![set(false)]).await, 2);
    }

    #[tokio::test]
    async fn a_device_that_waits_for_its_acknowledgement_and_a_lone_one_wait_for_no_other() {
        let (dense, sparse) = (pace(Duration::from_millis(3)), pace(Duration::from_millis(50)));
        assert_eq!(gathered(dense, set(false), vec![set(true)]).await, 1);
        assert_eq!(gathered(sparse, set(true), vec![set(true)]).await, 1);
        assert_eq!(gathered(Pace::default(), set(true), vec![set(true)]).await, 1);
    }
}
