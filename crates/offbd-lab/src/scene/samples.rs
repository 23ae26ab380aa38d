//! Samples at regular times, interpolated between the steps of a method.

use nalgebra::Vector3;

use super::configuration::SHORTEST_STEP_S;
use offbd_core::plant::Motion;

/// Receives samples: the time, s, and the motion.
pub type Sink<'a> = dyn FnMut(f64, &Motion) + 'a;

/// Takes samples of a run at regular times, from 0 on.
pub struct Samples<'a> {
    every_s: f64,
    taken: u64,
    whole_motions: bool,
    sink: &'a mut Sink<'a>,
}

/// A sample closer than this to the end of a step, as a share of the sampling interval,
/// takes the state at that end. Chosen: above rounding errors of time.
const SAME_TIME: f64 = 1e-9;

impl<'a> Samples<'a> {
    /// Takes a sample every `every_s` seconds and passes it to `sink`. With an interval
    /// that is NaN or below [`SHORTEST_STEP_S`], sampling would not terminate: then only
    /// the start is sampled.
    pub fn new(every_s: f64, sink: &'a mut Sink<'a>) -> Self {
        let every_s = if every_s >= SHORTEST_STEP_S { every_s } else { f64::MAX };
        let every_s = every_s.min(f64::MAX);
        Self { every_s, taken: 0, whole_motions: true, sink }
    }

    /// Takes samples whose positions along x and y alone are to be used, which costs less.
    pub(super) fn of_positions(every_s: f64, sink: &'a mut Sink<'a>) -> Self {
        Self { whole_motions: false, ..Self::new(every_s, sink) }
    }

    /// Returns whether more than the positions along x and y are to be used.
    pub(super) const fn whole_motions(&self) -> bool {
        self.whole_motions
    }

    fn next(&self) -> f64 {
        self.taken as f64 * self.every_s
    }

    /// Takes the samples due up to the end of the step, `t1`. `motion` maps their time
    /// to the motion; `None` stands for the end of the step.
    pub(super) fn take(&mut self, t1: f64, mut motion: impl FnMut(Option<f64>) -> Motion) {
        while self.next() <= t1 + SAME_TIME * self.every_s {
            let t = self.next();
            let at_end = (t - t1).abs() <= SAME_TIME * self.every_s;
            let motion = motion(if at_end { None } else { Some(t) });
            (self.sink)(t, &motion);
            self.taken += 1;
        }
    }
}

/// The states and rates at both ends of a step, for interpolation in between.
pub(super) struct StepInterpolant<'a, const N: usize> {
    pub t: [f64; 2],
    pub y: [&'a [f64; N]; 2],
    pub rate: [[f64; N]; 2],
}

impl<const N: usize> StepInterpolant<'_, N> {
    /// Returns the state at `t` within the step by Hermite interpolation. If the motion
    /// is `smooth`, the first `positions` components follow the quintic polynomial with
    /// the values, rates and accelerations of both ends; otherwise, as a stiff contact
    /// makes accelerations jump, the cubic with values and rates. The velocities are the
    /// derivative of that polynomial; further components are cubic.
    pub(super) fn at(&self, t: f64, positions: usize, smooth: bool) -> [f64; N] {
        let h = self.t[1] - self.t[0];
        let s = (t - self.t[0]) / h;
        let mut to = [0.0; N];
        for i in 0..N {
            let ends = [self.y[0][i], self.y[1][i]];
            let rates = [self.rate[0][i] * h, self.rate[1][i] * h];
            if i < positions {
                let seconds = if smooth {
                    [self.rate[0][i + positions], self.rate[1][i + positions]].map(|a| a * h * h)
                } else {
                    cubic_seconds(ends, rates)
                };
                let (value, rate) = quintic(s, ends, rates, seconds);
                to[i] = value;
                to[i + positions] = rate / h;
            } else if i >= 2 * positions {
                to[i] = quintic(s, ends, rates, cubic_seconds(ends, rates)).0;
            }
        }
        to
    }
}

/// Returns the positions at `t` by the cubic with the positions and velocities of both ends
/// of a step.
pub(super) fn positions<const N: usize>(
    t: f64,
    ends: [f64; 2],
    y: [&[f64; N]; 2],
    positions: usize,
) -> Vector3<f64> {
    let h = ends[1] - ends[0];
    let s = (t - ends[0]) / h;
    let mut at = Vector3::zeros();
    for i in 0..positions.min(3) {
        let (from, to) = (y[0][i], y[1][i]);
        let rates = [y[0][i + positions] * h, y[1][i + positions] * h];
        let rise = to - from;
        let bend = rates[0] + rates[1] - 2.0 * rise;
        at[i] = from + s * (rates[0] + s * (rise - rates[0] - bend + s * bend));
    }
    at
}

/// Returns the second derivatives at both ends of the cubic with the values `y` and rates
/// `v`, over a unit step.
fn cubic_seconds(y: [f64; 2], v: [f64; 2]) -> [f64; 2] {
    let rise = y[1] - y[0];
    [6.0 * rise - 4.0 * v[0] - 2.0 * v[1], -6.0 * rise + 2.0 * v[0] + 4.0 * v[1]]
}

/// Returns value and rate at s in [0, 1] of the quintic with the values `y`, rates `v` and
/// accelerations `a` at both ends.
fn quintic(s: f64, y: [f64; 2], v: [f64; 2], a: [f64; 2]) -> (f64, f64) {
    let rise = y[1] - y[0] - v[0] - a[0] / 2.0;
    let turn = v[1] - v[0] - a[0];
    let bend = a[1] - a[0];
    let (c3, c4, c5) = (
        10.0 * rise - 4.0 * turn + bend / 2.0,
        -15.0 * rise + 7.0 * turn - bend,
        6.0 * rise - 3.0 * turn + bend / 2.0,
    );
    let value = y[0] + s * (v[0] + s * (a[0] / 2.0 + s * (c3 + s * (c4 + s * c5))));
    let rate = v[0] + s * (a[0] + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)));
    (value, rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn validate_the_quintic_on_a_polynomial() {
        let p = |t: f64| 1.0 + t - 2.0 * t.powi(3) + 0.5 * t.powi(5);
        let v = |t: f64| 1.0 - 6.0 * t * t + 2.5 * t.powi(4);
        let a = |t: f64| -12.0 * t + 10.0 * t.powi(3);
        let (y0, y1) = ([p(0.2), v(0.2)], [p(0.6), v(0.6)]);
        let interpolant = StepInterpolant {
            t: [0.2, 0.6],
            y: [&y0, &y1],
            rate: [[v(0.2), a(0.2)], [v(0.6), a(0.6)]],
        };
        let y = interpolant.at(0.33, 1, true);
        assert!((y[0] - p(0.33)).abs() < 1e-14 && (y[1] - v(0.33)).abs() < 1e-13);
    }

    #[test]
    fn positions_are_those_of_whole_motions() {
        let (y0, y1) = ([1.0, 2.0, -0.5, 0.3, 4.0, 1.0], [1.4, 1.0, 0.5, 2.3, -4.0, 0.0]);
        let rate = [[0.3, 4.0, 1.0, 9.0, 9.0, 9.0], [2.3, -4.0, 0.0, 9.0, 9.0, 9.0]];
        let whole = StepInterpolant { t: [0.2, 0.6], y: [&y0, &y1], rate }.at(0.33, 3, false);
        let found = positions(0.33, [0.2, 0.6], [&y0, &y1], 3);
        for i in 0..3 {
            assert!((found[i] - whole[i]).abs() < 1e-15, "{i}: {} {}", found[i], whole[i]);
        }
    }

    #[test]
    fn samples_come_once_and_at_the_end_too() {
        let mut times = Vec::new();
        let mut sink = |t: f64, _: &Motion| times.push(t);
        let mut samples = Samples::new(0.1, &mut sink);
        for end in [0.0, 0.05, 0.25, 0.3 - 1e-12] {
            samples.take(end, |_| Motion::default());
        }
        assert_eq!(times.len(), 4);
        assert!((times[3] - 0.3).abs() < 1e-12);
    }
}
