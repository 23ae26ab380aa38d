//! Step-size control from error estimates.

/// Chooses steps so that a scaled error estimate stays at or below 1.
#[derive(Clone, Copy, Debug)]
pub struct StepControl {
    /// The error of one step is proportional to h to this power.
    power: f64,
    shortest: f64,
    longest: f64,
    /// The step to try next, s.
    pub h: f64,
}

/// Largest factor by which a step grows or shrinks at once; chosen.
const LARGEST_CHANGE: f64 = 5.0;

/// Safety factor of the next step, so that most steps are accepted: Hairer, Nørsett,
/// Wanner I, II.4 (4.13).
const SAFETY: f64 = 0.9;

impl StepControl {
    /// Creates a control that starts with the step `h` and stays within `shortest` and
    /// `longest`, all s; the error of a step is proportional to h to the `power`.
    #[must_use]
    pub fn new(power: f64, h: f64, shortest: f64, longest: f64) -> Self {
        Self { power, shortest, longest, h: h.clamp(shortest, longest) }
    }

    /// Returns whether to accept a step of `tried` seconds with the scaled `error`, and
    /// sets the next step. A step of the shortest length is always accepted; a longer one
    /// with an error of NaN never is.
    pub fn accepts(&mut self, tried: f64, error: f64) -> bool {
        let change =
            if error.is_finite() { SAFETY * error.max(1e-10).powf(-1.0 / self.power) } else { 0.0 };
        let change = change.clamp(1.0 / LARGEST_CHANGE, LARGEST_CHANGE);
        let accepted = error <= 1.0 || tried <= self.shortest;
        // A step that the end of its piece has shortened is not a reason to shorten the next.
        let next =
            if accepted && tried < self.h { self.h.max(tried * change) } else { tried * change };
        self.h = next.clamp(self.shortest, self.longest);
        accepted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_follows_the_error() {
        let mut control = StepControl::new(2.0, 0.1, 1e-6, 1.0);
        assert!(!control.accepts(0.1, 4.0));
        assert!((control.h - 0.1 * 0.9 / 2.0).abs() < 1e-15);
        assert!(control.accepts(control.h, 0.25));
        assert!((control.h - 0.09 * 0.9).abs() < 1e-15);
    }

    #[test]
    fn no_number_is_refused_until_the_shortest_step() {
        let mut control = StepControl::new(4.0, 1e-5, 1e-6, 1.0);
        assert!(!control.accepts(1e-5, f64::NAN));
        assert!(control.accepts(1e-6, f64::NAN));
    }
}
