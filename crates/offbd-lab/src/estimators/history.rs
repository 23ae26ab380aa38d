/// A ring buffer of the newest `n` values.
#[derive(Clone, Debug)]
pub(super) struct History {
    values: Box<[f64]>,
    /// Index of the next value; once full, that of the oldest one.
    next: usize,
    n_seen: usize,
}

impl History {
    /// Creates a buffer for `n` values, at least one.
    pub(super) fn new(n: usize) -> Self {
        Self { values: vec![0.0; n.max(1)].into(), next: 0, n_seen: 0 }
    }

    pub(super) fn push(&mut self, value: f64) {
        self.values[self.next] = value;
        self.next = if self.next + 1 == self.values.len() { 0 } else { self.next + 1 };
        self.n_seen = self.n_seen.saturating_add(1);
    }

    pub(super) fn is_full(&self) -> bool {
        self.n_seen >= self.values.len()
    }

    /// Returns the `k`-th value before the newest; `k` is less than the length.
    pub(super) fn ago(&self, k: usize) -> f64 {
        let n = self.values.len();
        let at = self.next + n - 1 - k;
        self.values[if at >= n { at - n } else { at }]
    }

    /// Returns the two contiguous parts of the buffer, oldest first; valid once full.
    pub(super) fn runs(&self) -> (&[f64], &[f64]) {
        let (newer, older) = self.values.split_at(self.next);
        (older, newer)
    }
}
