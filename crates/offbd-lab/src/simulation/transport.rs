//! Transport faults between the device and its receiver: rows arrive twice, late, or not
//! at all.
//!
//! Takes rows in the order of the device's log; each arrives at most twice, and none
//! later than the reorder window after a newer one.

use std::ops::RangeInclusive;

use super::noise::{Noise, Purpose};
use offbd_core::vocabulary::{Invalid, Sample, in_range};

/// The shares of rows with each fault; immutable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransportFaults {
    /// Share of rows that are sent twice.
    pub duplicates: f64,
    /// Share of rows that are delayed.
    pub late: f64,
    /// Maximum delay of a row, s.
    pub window_s: f64,
    /// Share of rows that are lost.
    pub lost: f64,
    /// Intervals on the device's clock, s, in which every row is lost.
    pub gaps: Vec<(f64, f64)>,
}

impl TransportFaults {
    /// Range of [`window_s`](Self::window_s), s; chosen.
    pub const WINDOW_S: RangeInclusive<f64> = 0.0..=60.0;

    /// Checks every number.
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/transport`.
    pub fn check(&self) -> Result<(), Invalid> {
        in_range("/transport/duplicates", self.duplicates, 0.0..=1.0)?;
        in_range("/transport/late", self.late, 0.0..=1.0)?;
        in_range("/transport/window_s", self.window_s, Self::WINDOW_S)?;
        in_range("/transport/lost", self.lost, 0.0..=1.0)?;
        Ok(())
    }
}

/// The line from the device, with the rows in transit.
#[derive(Clone, Debug)]
pub struct Transport {
    faults: TransportFaults,
    noise: Noise,
    held_up: Vec<(f64, Sample)>,
}

impl Transport {
    /// Creates a line with these faults.
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/transport`.
    pub fn new(faults: TransportFaults, seed: u64) -> Result<Self, Invalid> {
        faults.check()?;
        let noise = Noise::new(seed, Purpose::Transport);
        Ok(Self { faults, noise, held_up: Vec::new() })
    }

    /// Takes a row from the device, and appends the rows that arrive by its time to
    /// `arrived`.
    pub fn send(&mut self, sample: Sample, arrived: &mut Vec<Sample>) {
        self.arrive_by(sample.t_s, arrived);
        let (lost, late) =
            (self.noise.happens(self.faults.lost), self.noise.happens(self.faults.late));
        let twice = self.noise.happens(self.faults.duplicates);
        let delays = [0.0; 2].map(|_| self.noise.uniform(0.0, self.faults.window_s));
        let in_gap = |&(from, to): &(f64, f64)| (from..to).contains(&sample.t_s);
        if lost || self.faults.gaps.iter().any(in_gap) {
            return;
        }
        if late {
            self.held_up.push((sample.t_s + delays[0], sample));
        } else {
            arrived.push(sample);
        }
        if twice {
            self.held_up.push((sample.t_s + delays[1], sample));
        }
    }

    /// Appends the rows still in transit to `arrived`.
    pub fn finish(&mut self, arrived: &mut Vec<Sample>) {
        self.arrive_by(f64::INFINITY, arrived);
    }

    fn arrive_by(&mut self, t_s: f64, arrived: &mut Vec<Sample>) {
        self.held_up.sort_by(|a, b| a.0.total_cmp(&b.0));
        let n = self.held_up.partition_point(|(at, _)| *at <= t_s);
        arrived.extend(self.held_up.drain(..n).map(|(_, sample)| sample));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrivals(faults: TransportFaults) -> Vec<Sample> {
        let mut line = Transport::new(faults, 5).unwrap();
        let mut arrived = Vec::new();
        for i in 0..1000_u32 {
            let t_s = f64::from(i) * 0.01;
            line.send(Sample { seq: Some(u64::from(i)), t_s, ..Sample::default() }, &mut arrived);
        }
        line.finish(&mut arrived);
        arrived
    }

    #[test]
    fn a_good_line_changes_nothing() {
        let arrived = arrivals(TransportFaults::default());
        assert!(arrived.iter().enumerate().all(|(i, s)| s.seq == Some(i as u64)));
    }

    #[test]
    fn late_and_double_rows_stay_within_the_window_and_none_is_lost() {
        let faults =
            TransportFaults { duplicates: 0.1, late: 0.2, window_s: 0.05, ..Default::default() };
        let arrived = arrivals(faults);
        let mut newest = 0.0_f64;
        for sample in &arrived {
            assert!(sample.t_s >= newest - 0.05 - 1e-9, "{} behind {newest}", sample.t_s);
            newest = newest.max(sample.t_s);
        }
        let mut seqs: Vec<_> = arrived.iter().map(|s| s.seq).collect();
        assert!(!seqs.is_sorted() && seqs.len() > 1050);
        seqs.sort_unstable();
        seqs.dedup();
        assert_eq!(seqs.len(), 1000);
    }

    #[test]
    fn gaps_and_losses_leave_rows_out() {
        let gap = TransportFaults { gaps: vec![(2.0, 3.0)], ..Default::default() };
        assert_eq!(arrivals(gap).len(), 900);
        let lossy = arrivals(TransportFaults { lost: 0.1, ..Default::default() }).len();
        assert!((860..940).contains(&lossy), "{lossy} of 1000");
    }
}
