//! Rosenbrock methods as tables of coefficients: linearly implicit Runge–Kutta methods
//! with one Jacobian and one LU decomposition per step, and no iteration.
//!
//! In the form without matrix–vector products (Hairer, Wanner, *Solving Ordinary
//! Differential Equations II*, 2nd ed., IV.7, p. 111), with W = I/(hγ) − J:
//!
//! ```text
//! W·u[i] = f(t + α[i]h, y + Σ a[i][j]·u[j]) + Σ c[i][j]/h·u[j] + h·γ[i]·∂f/∂t
//! y₁ = y + Σ m[i]·u[i]        error = Σ e[i]·u[i]
//! ```

use super::Stiff;
use super::linear::LuFactors;
use offbd_core::maths::{Estimated, moved};

/// Coefficients of an S-stage method with an embedded solution.
#[derive(Clone, Copy, Debug)]
pub struct Rosenbrock<const S: usize> {
    /// Order of y₁; that of the embedded solution is one less.
    pub order: u32,
    pub gamma: f64,
    pub alpha: [f64; S],
    /// Coefficients of ∂f/∂t.
    pub gamma_sum: [f64; S],
    pub a: [[f64; S]; S],
    pub c: [[f64; S]; S],
    pub m: [f64; S],
    pub e: [f64; S],
}

/// RODAS3, four stages, order 3(2), L-stable and stiffly accurate: Sandu et
/// al., *Benchmarking stiff ODE solvers for atmospheric chemistry problems II*,
/// Atmospheric Environment 31 (1997), p. 3459.
pub const RODAS3: Rosenbrock<4> = Rosenbrock {
    order: 3,
    gamma: 0.5,
    alpha: [0.0, 0.0, 1.0, 1.0],
    gamma_sum: [0.5, 1.5, 0.0, 0.0],
    a: [[0.0; 4], [0.0; 4], [2.0, 0.0, 0.0, 0.0], [2.0, 0.0, 1.0, 0.0]],
    c: [[0.0; 4], [4.0, 0.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0], [1.0, -1.0, -8.0 / 3.0, 0.0]],
    m: [2.0, 0.0, 1.0, 1.0],
    e: [0.0, 0.0, 0.0, 1.0],
};

/// RODAS, six stages, order 4(3), L-stable and stiffly accurate: Hairer,
/// Wanner, *Solving Ordinary Differential Equations II*, 2nd ed., IV.10, with
/// the coefficients of their program RODAS (method 1).
pub const RODAS4: Rosenbrock<6> = Rosenbrock {
    order: 4,
    gamma: 0.25,
    alpha: [0.0, 0.386, 0.21, 0.63, 1.0, 1.0],
    gamma_sum: [0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0],
    a: [
        [0.0; 6],
        [1.544, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.946_678_528_081_582_6, 0.255_701_169_898_328_4, 0.0, 0.0, 0.0, 0.0],
        [3.314_825_187_068_521, 2.896_124_015_972_201, 0.998_641_913_997_781_7, 0.0, 0.0, 0.0],
        [
            1.221_224_509_226_641,
            6.019_134_481_288_629,
            12.537_083_329_320_87,
            -0.687_886_036_105_895,
            0.0,
            0.0,
        ],
        [
            1.221_224_509_226_641,
            6.019_134_481_288_629,
            12.537_083_329_320_87,
            -0.687_886_036_105_895,
            1.0,
            0.0,
        ],
    ],
    c: [
        [0.0; 6],
        [-5.6688, 0.0, 0.0, 0.0, 0.0, 0.0],
        [-2.430_093_356_833_875, -0.206_359_915_709_191_5, 0.0, 0.0, 0.0, 0.0],
        [-0.107_352_905_815_137_5, -9.594_562_251_023_355, -20.470_286_148_096_16, 0.0, 0.0, 0.0],
        [
            7.496_443_313_967_647,
            -10.246_804_314_641_22,
            -33.999_903_528_199_05,
            11.708_908_932_061_6,
            0.0,
            0.0,
        ],
        [
            8.083_246_795_921_522,
            -7.981_132_988_064_893,
            -31.521_594_328_743_71,
            16.319_305_431_231_36,
            -6.058_818_238_834_054,
            0.0,
        ],
    ],
    m: [
        1.221_224_509_226_641,
        6.019_134_481_288_629,
        12.537_083_329_320_87,
        -0.687_886_036_105_895,
        1.0,
        1.0,
    ],
    e: [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
};

/// Span of the forward difference for ∂f/∂t as a share of the step. Chosen so that
/// rounding and truncation errors both stay below 1e-4 of the term.
const TIME_DIFFERENCE: f64 = 1e-4;

impl<const S: usize> Rosenbrock<S> {
    /// Returns the result of one step of `h` from (t, y); `None` if W is singular.
    #[inline]
    pub fn step<const N: usize, F: Stiff<N>>(
        &self,
        system: &F,
        t: f64,
        y: &[f64; N],
        h: f64,
    ) -> Option<Estimated<N>> {
        let factors = LuFactors::new::<F>(&system.jacobian(t, y), h * self.gamma)?;
        let mut f = system.rate(t, y);
        let by_time = by_time(system, t, y, h, &f);
        let mut u = [[0.0; N]; S];
        for i in 0..S {
            if i > 0 && (self.alpha[i] != self.alpha[i - 1] || self.a[i] != self.a[i - 1]) {
                let at = sum(y, &u[..i], &self.a[i], 1.0);
                f = system.rate(t + self.alpha[i] * h, &at);
            }
            let right = sum(&f, &u[..i], &self.c[i], 1.0 / h);
            u[i] = factors.solve(&moved(&right, &by_time, self.gamma_sum[i] * h));
        }
        let error = sum(&[0.0; N], &u, &self.e, 1.0);
        Some(Estimated { y: sum(y, &u, &self.m, 1.0), error })
    }
}

/// Returns ∂f/∂t by a forward difference; `now` is f(t, y).
#[inline]
fn by_time<const N: usize>(
    system: &impl Stiff<N>,
    t: f64,
    y: &[f64; N],
    h: f64,
    now: &[f64; N],
) -> [f64; N] {
    let span = TIME_DIFFERENCE * h;
    let later = system.rate(t + span, y);
    std::array::from_fn(|i| (later[i] - now[i]) / span)
}

/// Returns `start + scale·Σ weights[j]·u[j]`.
#[inline]
fn sum<const N: usize>(start: &[f64; N], u: &[[f64; N]], weights: &[f64], scale: f64) -> [f64; N] {
    let mut to = *start;
    for (u, weight) in u.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        to = moved(&to, u, scale * weight);
    }
    to
}
