//! A plate angle as a function of time: a sum of terms, each in closed form with its
//! first and second derivative.

use std::f64::consts::TAU;

use offbd_core::maths::sine::{self, sin_cos};
use offbd_core::vocabulary::{Invalid, in_range, positive};

/// One term of an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// A constant angle, rad.
    Constant(f64),
    /// `amplitude·sin(2π·frequency·t + phase)`; rad, Hz, rad.
    Sine { amplitude: f64, frequency: f64, phase: f64 },
    /// From 0 to `to` rad as 3s² − 2s³, s from 0 at `start` to 1 after `duration`, s.
    Smoothstep { to: f64, start: f64, duration: f64 },
}

impl Term {
    /// Checks the term: angles within ±2π rad, frequencies in [0, 1000] Hz, phases and
    /// times within ±1e6 rad and s, durations in (0, 1e6] s. Errors name it `element`.
    ///
    /// # Errors
    /// [`Invalid`] naming the element.
    pub fn checked(self, element: &str) -> Result<Self, Invalid> {
        let angle = |name: &str, value| in_range(&format!("{element}/{name}"), value, -TAU..=TAU);
        match self {
            Self::Constant(value) => {
                angle("constant_rad", value)?;
            }
            Self::Sine { amplitude, frequency, phase } => {
                angle("sine/amplitude_rad", amplitude)?;
                in_range(&format!("{element}/sine/frequency_hz"), frequency, 0.0..=1000.0)?;
                in_range(&format!("{element}/sine/phase_rad"), phase, -1e6..=1e6)?;
            }
            Self::Smoothstep { to, start, duration } => {
                angle("smoothstep/to_rad", to)?;
                in_range(&format!("{element}/smoothstep/start_s"), start, -1e6..=1e6)?;
                positive(&format!("{element}/smoothstep/duration_s"), duration, 1e6)?;
            }
        }
        Ok(self)
    }
}

/// An angle as a sum of terms. It is smooth between two breaks, where a smoothstep
/// begins or ends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Law {
    constant: f64,
    varying: Vec<Term>,
}

/// An angle at several times, rad, with its first and second derivatives.
pub struct AngleNodes<const M: usize> {
    pub angle: [f64; M],
    pub rate: [f64; M],
    pub acceleration: [f64; M],
}

impl Law {
    #[must_use]
    pub fn new(terms: &[Term]) -> Self {
        let mut law = Self::default();
        for term in terms {
            match *term {
                Term::Constant(value) => law.constant += value,
                other => law.varying.push(other),
            }
        }
        law
    }

    /// Returns angle, rate and acceleration at `t`, within the smooth piece that contains
    /// `inside`: at a break, the one-sided limit from that piece.
    #[must_use]
    #[inline]
    pub fn at(&self, t: f64, inside: f64) -> [f64; 3] {
        let mut sum = [self.constant, 0.0, 0.0];
        for term in &self.varying {
            let value = varying(term, t, inside);
            for i in 0..3 {
                sum[i] += value[i];
            }
        }
        sum
    }

    /// Returns angle, rate and acceleration at the times `at`, as [`Self::at`].
    #[must_use]
    #[inline(always)]
    pub fn nodes<const M: usize>(&self, at: &[f64; M], inside: f64) -> AngleNodes<M> {
        self.summed(at, inside, |omega, phase| {
            let mut wave = Wave { sin: [0.0; M], cos: [0.0; M] };
            for (i, t) in at.iter().enumerate() {
                (wave.sin[i], wave.cos[i]) = sin_cos(omega * t + phase);
            }
            wave
        })
    }

    /// Returns angle, rate and acceleration at `M` times from `from` on, `every` seconds
    /// apart, as [`Self::at`]: the sines by a recurrence.
    #[must_use]
    #[inline(always)]
    pub fn grid<const M: usize>(&self, from: f64, every: f64, inside: f64) -> AngleNodes<M> {
        let at: [f64; M] = std::array::from_fn(|i| from + i as f64 * every);
        self.summed(&at, inside, |omega, phase| Wave::turning(omega * from + phase, omega * every))
    }

    /// Sums the terms at the times `at`, a sine by the `wave` of its frequency, rad/s, and
    /// phase, rad.
    #[inline(always)]
    fn summed<const M: usize>(
        &self,
        at: &[f64; M],
        inside: f64,
        wave: impl Fn(f64, f64) -> Wave<M>,
    ) -> AngleNodes<M> {
        let mut sum =
            AngleNodes { angle: [self.constant; M], rate: [0.0; M], acceleration: [0.0; M] };
        for term in &self.varying {
            match *term {
                // Without a branch in the loop, which the compiler then vectorises.
                Term::Sine { amplitude, frequency, phase } if in_reach(frequency, phase, at) => {
                    let omega = TAU * frequency;
                    let (wave, rate) = (wave(omega, phase), amplitude * omega);
                    for i in 0..M {
                        sum.angle[i] += amplitude * wave.sin[i];
                        sum.rate[i] += rate * wave.cos[i];
                        sum.acceleration[i] -= rate * omega * wave.sin[i];
                    }
                }
                _ => {
                    for (i, &t) in at.iter().enumerate() {
                        let [angle, rate, acceleration] = varying(term, t, inside);
                        sum.angle[i] += angle;
                        sum.rate[i] += rate;
                        sum.acceleration[i] += acceleration;
                    }
                }
            }
        }
        sum
    }

    /// Returns whether the angle is constant in the smooth piece that contains `inside`.
    #[must_use]
    pub fn is_still(&self, inside: f64) -> bool {
        self.varying.iter().all(|term| match *term {
            Term::Smoothstep { start, duration, .. } => {
                inside <= start || inside >= start + duration
            }
            _ => false,
        })
    }

    /// Returns the first break after `t`, s; infinity if there is none.
    #[must_use]
    pub fn next_break(&self, t: f64) -> f64 {
        let edges = self.varying.iter().flat_map(|term| match *term {
            Term::Smoothstep { start, duration, .. } => [start, start + duration],
            _ => [f64::INFINITY; 2],
        });
        edges.filter(|&edge| edge > t).fold(f64::INFINITY, f64::min)
    }

    /// Returns the shortest time scale of the angle, s: a period or the duration of a
    /// smoothstep; infinity if the angle is constant.
    #[must_use]
    pub fn shortest_time_s(&self) -> f64 {
        let times = self.varying.iter().map(|term| match *term {
            Term::Sine { frequency, .. } => 1.0 / frequency,
            Term::Smoothstep { duration, .. } => duration,
            Term::Constant(_) => f64::INFINITY,
        });
        times.fold(f64::INFINITY, f64::min)
    }
}

/// Sine and cosine at several times.
struct Wave<const M: usize> {
    sin: [f64; M],
    cos: [f64; M],
}

impl<const M: usize> Wave<M> {
    /// Returns the wave at the angles `start + i·step`, rad. Each angle is reached by at most
    /// log₂ M + 1 rotations of the first, each with an error of some 1e-16.
    #[inline(always)]
    fn turning(start: f64, step: f64) -> Self {
        let mut wave = Self { sin: [0.0; M], cos: [0.0; M] };
        (wave.sin[0], wave.cos[0]) = sin_cos(start);
        let (mut sin, mut cos) = sin_cos(step);
        let mut known = 1;
        while known < M {
            for i in 0..known.min(M - known) {
                wave.sin[known + i] = wave.sin[i] * cos + wave.cos[i] * sin;
                wave.cos[known + i] = wave.cos[i] * cos - wave.sin[i] * sin;
            }
            (sin, cos) = (2.0 * sin * cos, (cos - sin) * (cos + sin));
            known *= 2;
        }
        wave
    }
}

/// Returns whether the argument of a sine is within the reach of [`sin_cos`] at all times
/// `at`, in ascending order.
#[inline]
fn in_reach<const M: usize>(frequency: f64, phase: f64, at: &[f64; M]) -> bool {
    [at[0], at[M - 1]].into_iter().all(|t| (TAU * frequency * t + phase).abs() <= sine::LIMIT_RAD)
}

#[inline]
fn varying(term: &Term, t: f64, inside: f64) -> [f64; 3] {
    match *term {
        Term::Constant(value) => [value, 0.0, 0.0],
        Term::Sine { amplitude, frequency, phase } => {
            let omega = TAU * frequency;
            let at = omega * t + phase;
            let (sin, cos) = if at.abs() <= sine::LIMIT_RAD { sin_cos(at) } else { at.sin_cos() };
            [amplitude * sin, amplitude * omega * cos, -amplitude * omega * omega * sin]
        }
        Term::Smoothstep { start, .. } if inside <= start => [0.0; 3],
        Term::Smoothstep { to, start, duration } if inside >= start + duration => [to, 0.0, 0.0],
        Term::Smoothstep { to, start, duration } => {
            let (s, rate) = ((t - start) / duration, 1.0 / duration);
            [
                to * s * s * (3.0 - 2.0 * s),
                to * 6.0 * s * (1.0 - s) * rate,
                to * (6.0 - 12.0 * s) * rate * rate,
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn law() -> Law {
        Law::new(&[
            Term::Constant(0.01),
            Term::Sine { amplitude: 0.05, frequency: 0.7, phase: 0.3 },
            Term::Smoothstep { to: 1.2, start: 0.1, duration: 0.15 },
        ])
    }

    #[test]
    fn a_break_has_two_sides() {
        let law = Law::new(&[Term::Smoothstep { to: 1.0, start: 0.0, duration: 0.5 }]);
        assert_eq!(law.at(0.5, 0.4), [1.0, 0.0, -24.0]);
        assert_eq!(law.at(0.5, 0.6), [1.0, 0.0, 0.0]);
        assert_eq!([law.next_break(-1.0), law.next_break(0.0)], [0.0, 0.5]);
        assert_eq!(law.next_break(0.5), f64::INFINITY);
        assert!(law.is_still(0.6) && !law.is_still(0.4));
    }

    proptest! {
        /// The recurrence agrees with each time by itself: an argument of at most 1000 rad
        /// has a rounding error of 1.1e-13 rad, each of five rotations one of 2e-16.
        #[test]
        fn a_grid_is_the_law_at_its_times(from in -20.0..20.0_f64, every in 0.0..0.1_f64) {
            let law = law();
            let grid = law.grid::<16>(from, every, 0.2);
            for i in 0..16 {
                let at = law.at(from + i as f64 * every, 0.2);
                let found = [grid.angle[i], grid.rate[i], grid.acceleration[i]];
                for (found, expected) in found.into_iter().zip(at) {
                    let allowed = 1e-14 * (1.0 + expected.abs());
                    prop_assert!((found - expected).abs() <= allowed, "{i}: {found} {expected}");
                }
            }
        }

        /// Rate and acceleration agree with difference quotients.
        #[test]
        fn rates_are_derivatives(t in 0.0..0.4_f64) {
            let (law, d) = (law(), 1e-5);
            let inside = t.clamp(0.1 + 2.0 * d, 0.25 - 2.0 * d);
            let [before, now, after] = [inside - d, inside, inside + d].map(|t| law.at(t, inside));
            for i in 0..2 {
                let difference = (after[i] - before[i]) / (2.0 * d);
                prop_assert!((difference - now[i + 1]).abs() < 1e-4 * (1.0 + now[i + 1].abs()));
            }
        }
    }
}
