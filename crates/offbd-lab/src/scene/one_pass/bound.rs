//! A bound of the error of a ball that stays on the plate, carried along its motion.
//!
//! Relative to the plate, the centrifugal and the Euler force let a distance e between two
//! paths grow as ë = (|Ω|² + |α_z|/(1 + κ))·e at most; the Coriolis force turns it only.

/// The error so far, as bounds of its parts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ErrorBound {
    /// Of position, m, and velocity, m/s.
    position: f64,
    velocity: f64,
    /// The largest bound so far that does not add up: lags and values within a window, m.
    passing: f64,
    worst: f64,
    /// Integral of the square of the rate of growth, 1/s.
    squares: f64,
    duration: f64,
}

/// What one window adds to the error.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WindowError {
    /// m
    pub position: f64,
    /// m/s
    pub velocity: f64,
    /// Of positions within the window that does not last, m.
    pub passing: f64,
}

/// Returns by how much errors of position and velocity grow in `duration` s with the
/// square of the rate of growth `square`, 1/s²: cosh(x), and sinh(x)/x.
pub(super) fn growth(square: f64, duration: f64) -> [f64; 2] {
    let x = square * duration * duration;
    if x < 1e-3 {
        return [1.0 + x / 2.0 * (1.0 + x / 12.0), 1.0 + x / 6.0 * (1.0 + x / 20.0)];
    }
    let x = x.sqrt();
    let e = x.exp();
    [(e + 1.0 / e) / 2.0, (e - 1.0 / e) / (2.0 * x)]
}

impl ErrorBound {
    /// Carries the error through a window of `duration` s that adds `added`.
    pub(super) fn carry(&mut self, square: f64, duration: f64, added: &WindowError) {
        let [same, over] = growth(square, duration);
        let (p, v) = (self.position, self.velocity);
        self.position = p * same + v * over * duration + added.position;
        self.velocity = v * same + p * square * over * duration + added.velocity;
        self.passing = self.passing.max(added.passing);
        self.worst = self.worst.max(self.position + self.passing);
        self.squares += square * duration;
        self.duration += duration;
    }

    /// Returns the mean square of the rate of growth so far, 1/s².
    pub(super) fn mean_square(&self) -> f64 {
        self.squares / self.duration.max(f64::MIN_POSITIVE)
    }

    /// Returns the bound after `duration` s more without further errors, m, if errors grow
    /// then as they did on average.
    pub(super) fn after(&self, duration: f64) -> f64 {
        let [same, over] = growth(self.mean_square(), duration);
        self.worst.max(self.position * same + self.velocity * over * duration + self.passing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In closed form: two balls apart on a plate that turns at a constant rate.
    #[test]
    fn validate_growth_against_the_exponential() {
        let mut bound = ErrorBound::default();
        bound.carry(0.0, 1.0, &WindowError { position: 1e-3, velocity: 2e-3, passing: 0.0 });
        for _ in 0..10 {
            bound.carry(4.0, 0.1, &WindowError::default());
        }
        let known = 1e-3 * 2_f64.cosh() + 2e-3 * 2_f64.sinh() / 2.0;
        assert!((bound.after(0.0) - known).abs() < 1e-9 * known.abs() + 1e-12);
    }

    #[test]
    fn growth_is_continuous_where_its_formula_changes() {
        let [below, above] = [0.999_999e-3, 1.000_001e-3].map(|x: f64| growth(x, 1.0));
        assert!((below[0] - above[0]).abs() < 1e-8 && (below[1] - above[1]).abs() < 1e-8);
    }
}
