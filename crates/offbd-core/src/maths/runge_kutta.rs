//! Explicit Runge–Kutta methods as data: one stepper and constant tableaux.
//!
//! Source of the tableaux: Hairer, Nørsett, Wanner, *Solving Ordinary Differential
//! Equations I*, 2nd ed.: Euler and the midpoint rule II.1 (p. 132 f.), the classical
//! method table 1.2 (p. 138), Dormand–Prince table 5.2 (p. 178).

use super::system::{System, moved};

/// A tableau of S stages: `k[i] = f(t + c[i]·h, y + h·Σ a[i][j]·k[j])`,
/// `y₁ = y + h·Σ b[i]·k[i]`.
#[derive(Clone, Copy, Debug)]
pub struct RungeKutta<const S: usize> {
    /// Order of y₁.
    pub order: u32,
    pub a: [[f64; S]; S],
    pub b: [f64; S],
    pub c: [f64; S],
}

/// The result of a step with an estimate of its local error.
#[derive(Clone, Copy, Debug)]
pub struct Estimated<const N: usize> {
    pub y: [f64; N],
    /// y₁ minus the embedded lower-order solution.
    pub error: [f64; N],
}

/// Explicit Euler, order 1.
pub const EULER: RungeKutta<1> = RungeKutta { order: 1, a: [[0.0]], b: [1.0], c: [0.0] };

/// The midpoint rule (Runge 1895), order 2.
pub const MIDPOINT: RungeKutta<2> =
    RungeKutta { order: 2, a: [[0.0; 2], [0.5, 0.0]], b: [0.0, 1.0], c: [0.0, 0.5] };

/// The classical Runge–Kutta method, order 4.
pub const RK4: RungeKutta<4> = RungeKutta {
    order: 4,
    a: [[0.0; 4], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    b: [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
    c: [0.0, 0.5, 0.5, 1.0],
};

/// Dormand–Prince 5(4); the last stage is f at the step's end.
pub const DOPRI5: RungeKutta<7> = RungeKutta {
    order: 5,
    a: [
        [0.0; 7],
        [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0, 0.0],
        [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0, 0.0],
        [
            9017.0 / 3168.0,
            -355.0 / 33.0,
            46732.0 / 5247.0,
            49.0 / 176.0,
            -5103.0 / 18656.0,
            0.0,
            0.0,
        ],
        [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    ],
    b: [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    c: [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0],
};

/// b minus the weights of the embedded fourth-order solution of [`DOPRI5`].
const DOPRI5_ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339_200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

impl<const S: usize> RungeKutta<S> {
    /// One step of `h` from (t, y).
    #[inline]
    pub fn step<const N: usize>(
        &self,
        system: &impl System<N>,
        t: f64,
        y: &[f64; N],
        h: f64,
    ) -> [f64; N] {
        let first = system.rate(t, y);
        self.sum(y, &self.stages(system, t, y, h, first), h)
    }

    #[inline]
    fn stages<const N: usize>(
        &self,
        system: &impl System<N>,
        t: f64,
        y: &[f64; N],
        h: f64,
        first: [f64; N],
    ) -> [[f64; N]; S] {
        let mut k = [[0.0; N]; S];
        k[0] = first;
        for i in 1..S {
            let mut at = *y;
            for (k, a) in k[..i].iter().zip(self.a[i]).filter(|(_, a)| *a != 0.0) {
                at = moved(&at, k, h * a);
            }
            k[i] = system.rate(t + self.c[i] * h, &at);
        }
        k
    }

    #[inline]
    fn sum<const N: usize>(&self, y: &[f64; N], k: &[[f64; N]; S], h: f64) -> [f64; N] {
        let mut to = *y;
        for (k, b) in k.iter().zip(self.b).filter(|(_, b)| *b != 0.0) {
            to = moved(&to, k, h * b);
        }
        to
    }
}

/// One step of Dormand–Prince 5(4) with its error estimate. `first` is f(t, y) on entry
/// and f at the end of the step on return: the first stage of the next step.
#[inline]
pub fn dopri5<const N: usize>(
    system: &impl System<N>,
    t: f64,
    y: &[f64; N],
    h: f64,
    first: &mut [f64; N],
) -> Estimated<N> {
    let k = DOPRI5.stages(system, t, y, h, *first);
    let mut error = [0.0; N];
    for (k, weight) in k.iter().zip(DOPRI5_ERROR) {
        error = moved(&error, k, h * weight);
    }
    *first = k[6];
    Estimated { y: DOPRI5.sum(y, &k, h), error }
}

/// One step of semi-implicit (symplectic) Euler, order 1: the rates first, then the
/// positions with the new rates.
#[inline]
pub fn semi_implicit_euler<const N: usize, F: System<N>>(
    system: &F,
    t: f64,
    y: &[f64; N],
    h: f64,
) -> [f64; N] {
    let mut to = moved(y, &system.rate(t, y), h);
    for i in 0..F::POSITIONS {
        to[i] = y[i] + h * to[i + F::POSITIONS];
    }
    to
}
