//! The median time between samples in bounded memory: a histogram with classes that each
//! span a quarter more than the one below.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use alloc::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Shortest and longest time that are distinguished, as powers of ten of a second: faster
/// than any sensor, and a clock in microseconds with a sample per second.
const FROM_DECADE: i32 = -6;
const TO_DECADE: i32 = 7;
/// Classes per decade.
const PER_DECADE: i32 = 10;
const LAST_CLASS: u8 = ((TO_DECADE - FROM_DECADE) * PER_DECADE - 1) as u8;

/// The times in one class.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Class {
    n: u32,
    sum_s: f64,
}

/// Histogram of the times between samples.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Periods {
    /// The classes that are not empty.
    classes: BTreeMap<u8, Class>,
    n: u32,
    /// Samples older than the newest one.
    n_late: u32,
}

impl Periods {
    /// Takes the time since the newest sample.
    pub(super) fn take(&mut self, dt_s: f64) {
        self.n_late = self.n_late.saturating_add((dt_s < 0.0).into());
        if dt_s > 0.0 && dt_s.is_finite() {
            let place = (dt_s.log10() - f64::from(FROM_DECADE)) * f64::from(PER_DECADE);
            let class = self.classes.entry((place as u8).min(LAST_CLASS)).or_default();
            class.n = class.n.saturating_add(1);
            class.sum_s += dt_s;
            self.n = self.n.saturating_add(1);
        }
    }

    /// Returns the mean of the class that holds the median, less the share of late samples, which
    /// lie between the others; `None` for fewer than `least` times.
    pub(super) fn median_s(&self, least: u32) -> Option<f64> {
        if self.n < least {
            return None;
        }
        let mut below = 0_u32;
        let class = self.classes.values().find(|class| {
            below = below.saturating_add(class.n);
            below > self.n / 2
        })?;
        let in_order = f64::from(self.n) / f64::from(self.n.saturating_add(self.n_late));
        Some(class.sum_s / f64::from(class.n) * in_order)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_its_class() {
        let mut periods = Periods::default();
        for i in 0..100 {
            periods.take(if i % 10 == 0 { 4000.0 } else { 0.01 });
        }
        periods.take(-5.0);
        periods.take(f64::INFINITY);
        assert!((periods.median_s(20).unwrap() - 0.01 * 100.0 / 101.0).abs() < 1e-12);
        assert_eq!(periods.median_s(101), None);
    }

    #[test]
    fn samples_out_of_order_do_not_change_it() {
        let mut periods = Periods::default();
        for _ in 0..50 {
            periods.take(0.02);
            periods.take(-0.01);
        }
        assert!((periods.median_s(20).unwrap() - 0.01).abs() < 1e-12);
    }

    #[test]
    fn what_is_beyond_the_classes_goes_into_the_outer_ones() {
        let mut periods = Periods::default();
        (0..30).for_each(|_| periods.take(1e12));
        assert_eq!(periods.median_s(20), Some(1e12));
        (0..60).for_each(|_| periods.take(1e-12));
        assert!((periods.median_s(20).unwrap() - 1e-12).abs() < 1e-20);
    }
}
