//! The order of acknowledgements of QoS 1: MQTT demands that of arrival (MQTT-4.6.0-2), while
//! commits complete in another one.

use std::collections::VecDeque;

/// Messages of one connection that are not acknowledged yet, in order of arrival. A new
/// connection has a new queue, because its broker numbers the packets from 1 again.
pub(super) struct PubackQueue<T> {
    waiting: VecDeque<(T, bool)>,
    /// The number of the first one that waits.
    first: u64,
}

impl<T> Default for PubackQueue<T> {
    fn default() -> Self {
        Self { waiting: VecDeque::new(), first: 0 }
    }
}

impl<T> PubackQueue<T> {
    /// Adds a message; returns its number.
    pub(super) fn arrive(&mut self, message: T) -> u64 {
        self.waiting.push_back((message, false));
        self.first + self.waiting.len() as u64 - 1
    }

    /// Marks a message as durable or refused for good; returns those that may be acknowledged
    /// now, in order.
    pub(super) fn complete(&mut self, number: u64) -> Vec<T> {
        let index = number.checked_sub(self.first).and_then(|n| usize::try_from(n).ok());
        if let Some((_, done)) = index.and_then(|index| self.waiting.get_mut(index)) {
            *done = true;
        }
        let n_done = self.waiting.iter().take_while(|(_, done)| *done).count();
        self.first += n_done as u64;
        self.waiting.drain(..n_done).map(|(message, _)| message).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_message_is_acknowledged_once_in_order_of_arrival_and_not_before_its_completion(
            completions in Just((0..20_u64).collect::<Vec<_>>()).prop_shuffle(),
            early in 0..20_usize,
        ) {
            let mut queue = PubackQueue::default();
            let (mut acknowledged, mut completed) = (Vec::new(), vec![false; 20]);
            let mut arrived = 0;
            for number in completions {
                while arrived <= number.max(early as u64) {
                    prop_assert_eq!(queue.arrive(arrived), arrived);
                    arrived += 1;
                }
                completed[number as usize] = true;
                acknowledged.extend(queue.complete(number));
                prop_assert!(acknowledged.iter().all(|n| completed[*n as usize]));
            }
            prop_assert_eq!(acknowledged, (0..20).collect::<Vec<_>>());
        }
    }
}
