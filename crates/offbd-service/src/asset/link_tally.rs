//! What is counted of the samples that arrive in a stretch of time. Tallies of stretches add up
//! to that of them all.

use offbd_wire::link::{LinkStretchView, UnjudgedRowsView};
use offbd_wire::words::UnjudgedWord;

const N_REASONS: usize = UnjudgedWord::ALL.len();

/// Counts of the rows that arrived in a stretch of time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LinkTally {
    n_samples: u32,
    n_duplicates: u32,
    n_unordered: u32,
    /// Rows that are not judged, in the order of the words.
    unjudged: [u32; N_REASONS],
    spacing: Spread,
    gaps: Extent,
    delay: Extent,
}

impl LinkTally {
    /// Counts a recorded sample.
    pub(super) fn sample(&mut self) {
        self.n_samples = self.n_samples.saturating_add(1);
    }

    /// Counts the time from the latest sample to a new one, s; it is a gap if longer than `gap_s`.
    pub(super) fn step(&mut self, step_s: f64, gap_s: f64) {
        if step_s <= 0.0 {
            self.n_unordered = self.n_unordered.saturating_add(1);
        } else if step_s > gap_s {
            self.gaps.add(step_s);
        } else {
            self.spacing.add(step_s);
        }
    }

    /// Counts times between samples that are not gaps.
    pub(super) fn spacings(&mut self, spacing: &Spread) {
        self.spacing = self.spacing.plus(spacing);
    }

    pub(super) fn batch(&mut self, delay_s: f64) {
        self.delay.add(delay_s);
    }

    pub(super) fn duplicates(&mut self, n: usize) {
        self.n_duplicates = self.n_duplicates.saturating_add(u32::try_from(n).unwrap_or(u32::MAX));
    }

    pub(super) fn unjudged(&mut self, reason: UnjudgedWord, n: u64) {
        let count = &mut self.unjudged[reason as usize];
        *count = count.saturating_add(u32::try_from(n).unwrap_or(u32::MAX));
    }

    /// Returns the tally of both stretches.
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            n_samples: self.n_samples.saturating_add(other.n_samples),
            n_duplicates: self.n_duplicates.saturating_add(other.n_duplicates),
            n_unordered: self.n_unordered.saturating_add(other.n_unordered),
            unjudged: std::array::from_fn(|i| self.unjudged[i].saturating_add(other.unjudged[i])),
            spacing: self.spacing.plus(&other.spacing),
            gaps: self.gaps.plus(&other.gaps),
            delay: self.delay.plus(&other.delay),
        }
    }

    /// Returns the view of the stretch that begins at `from`.
    pub(super) fn view(&self, from: String) -> LinkStretchView {
        let reasons = UnjudgedWord::ALL.iter().zip(self.unjudged).filter(|(_, rows)| *rows > 0);
        let unjudged = reasons
            .map(|(reason, rows)| UnjudgedRowsView { reason: *reason, rows: u64::from(rows) });
        let spacing_s = self.spacing.mean();
        LinkStretchView {
            from,
            samples: self.n_samples.into(),
            duplicates: self.n_duplicates.into(),
            unordered: self.n_unordered.into(),
            rate_hz: spacing_s.map(|spacing_s| 1.0 / spacing_s),
            spacing_s,
            jitter_s: self.spacing.deviation(),
            gaps: self.gaps.n.into(),
            longest_gap_s: self.gaps.longest(),
            gaps_s: self.gaps.sum_s,
            batches: self.delay.n.into(),
            delay_s: self.delay.longest().map(|_| self.delay.sum_s / f64::from(self.delay.n)),
            longest_delay_s: self.delay.longest(),
            unjudged: unjudged.collect(),
        }
    }
}

/// Mean and spread of numbers, by the method of Welford; sums of squares would cancel for a
/// spacing that hardly varies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Spread {
    n: u32,
    mean: f64,
    /// Sum of the squared deviations from the mean.
    squares: f64,
}

impl Spread {
    pub(super) fn add(&mut self, value: f64) {
        self.n = self.n.saturating_add(1);
        let off = value - self.mean;
        self.mean += off / f64::from(self.n);
        self.squares += off * (value - self.mean);
    }

    fn plus(&self, other: &Self) -> Self {
        let n = self.n.saturating_add(other.n);
        if n == 0 {
            return *self;
        }
        let (share, off) = (f64::from(other.n) / f64::from(n), other.mean - self.mean);
        let squares = self.squares + other.squares + off * off * f64::from(self.n) * share;
        Self { n, mean: self.mean + off * share, squares }
    }

    fn mean(&self) -> Option<f64> {
        (self.n > 0).then_some(self.mean)
    }

    /// The standard deviation of the numbers of which these are a sample.
    fn deviation(&self) -> Option<f64> {
        (self.n > 1).then(|| (self.squares / f64::from(self.n - 1)).sqrt())
    }
}

/// Number, sum and largest of durations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Extent {
    n: u32,
    sum_s: f64,
    longest_s: f64,
}

impl Extent {
    fn add(&mut self, duration_s: f64) {
        self.n = self.n.saturating_add(1);
        self.sum_s += duration_s;
        self.longest_s = self.longest_s.max(duration_s);
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            n: self.n.saturating_add(other.n),
            sum_s: self.sum_s + other.sum_s,
            longest_s: self.longest_s.max(other.longest_s),
        }
    }

    fn longest(&self) -> Option<f64> {
        (self.n > 0).then_some(self.longest_s)
    }
}
