//! Gauss–Legendre nodes, and the matrices that integrate and expand functions given at
//! them.

#![expect(
    clippy::needless_range_loop,
    reason = "loops over the nodes by index are those that the compiler vectorises"
)]

use std::f64::consts::PI;
use std::sync::LazyLock;

/// The `M` nodes of Gauss–Legendre quadrature on [−1, 1], exact for polynomials up to
/// degree 2M − 1 (Abramowitz and Stegun 1964, 25.4.29).
pub(super) struct Nodes<const M: usize> {
    pub at: [f64; M],
    pub weight: [f64; M],
    /// `up_to[j][i]` is the integral from −1 to node i of the Lagrange polynomial of node
    /// j.
    up_to: [[f64; M]; M],
    /// `series[n][j]` is the share of the value at node j in the Legendre coefficient n.
    series: [[f64; M]; M],
}

/// Newton iterations for a root of the Legendre polynomial; quadratic from the usual
/// estimate, five suffice for double precision.
const NEWTON: usize = 8;

impl<const M: usize> Nodes<M> {
    fn new() -> Self {
        let (mut at, mut weight) = ([0.0; M], [0.0; M]);
        for i in 0..M {
            let mut x = -(PI * (i as f64 + 0.75) / (M as f64 + 0.5)).cos();
            for _ in 0..NEWTON {
                let [p, before] = legendre(M, x);
                x -= p / derivative(M, x, p, before);
            }
            let [p, before] = legendre(M, x);
            let slope = derivative(M, x, p, before);
            (at[i], weight[i]) = (x, 2.0 / ((1.0 - x * x) * slope * slope));
        }
        let (mut up_to, mut series) = ([[0.0; M]; M], [[0.0; M]; M]);
        for j in 0..M {
            for n in 0..M {
                series[n][j] = (2 * n + 1) as f64 / 2.0 * weight[j] * legendre(n, at[j])[0];
                for i in 0..M {
                    up_to[j][i] += series[n][j] * integral(n, at[i]);
                }
            }
        }
        Self { at, weight, up_to, series }
    }

    /// Returns the integrals of `f` from the start to each node of an interval of length
    /// 2·`half`.
    #[inline(always)]
    pub(super) fn integrals(&self, f: &[f64; M], half: f64) -> [f64; M] {
        let mut to = [0.0; M];
        for j in 0..M {
            let value = f[j] * half;
            for i in 0..M {
                to[i] += self.up_to[j][i] * value;
            }
        }
        to
    }

    /// Returns the integral of `f` over an interval of length 2·`half`.
    #[inline(always)]
    pub(super) fn whole(&self, f: &[f64; M], half: f64) -> f64 {
        let mut sum = 0.0;
        for j in 0..M {
            sum += self.weight[j] * f[j];
        }
        sum * half
    }

    /// Returns the Legendre coefficient `n` of `f`.
    #[inline(always)]
    pub(super) fn coefficient(&self, n: usize, f: &[f64; M]) -> f64 {
        let mut sum = 0.0;
        for j in 0..M {
            sum += self.series[n][j] * f[j];
        }
        sum
    }

    /// Returns the Legendre coefficients of `f`.
    #[inline]
    pub(super) fn coefficients(&self, f: &[f64; M]) -> [f64; M] {
        std::array::from_fn(|n| self.coefficient(n, f))
    }
}

/// The Legendre polynomials of degrees below `M` at one place, and their integrals from −1.
pub(super) struct Legendre<const M: usize> {
    value: [f64; M],
    integral: [f64; M],
}

impl<const M: usize> Legendre<M> {
    #[inline]
    pub(super) fn at(s: f64) -> Self {
        let (mut value, mut integral) = ([1.0; M], [s + 1.0; M]);
        let mut before = 0.0;
        for n in 0..M {
            let k = n as f64;
            let after = ((2.0 * k + 1.0) * s * value[n] - k * before) / (k + 1.0);
            if n > 0 {
                integral[n] = (after - before) / (2.0 * k + 1.0);
            }
            before = value[n];
            if n + 1 < M {
                value[n + 1] = after;
            }
        }
        Self { value, integral }
    }

    /// Returns the value of the polynomial with these coefficients.
    #[inline]
    pub(super) fn value(&self, coefficients: &[f64; M]) -> f64 {
        (0..M).map(|n| self.value[n] * coefficients[n]).sum()
    }

    /// Returns the integral from −1 of the polynomial with these coefficients.
    #[inline]
    pub(super) fn integral(&self, coefficients: &[f64; M]) -> f64 {
        (0..M).map(|n| self.integral[n] * coefficients[n]).sum()
    }
}

/// Returns the Legendre polynomials of degrees n and n − 1 at `x` (0 for n = 0).
fn legendre(n: usize, x: f64) -> [f64; 2] {
    (0..n).fold([1.0, 0.0], |[p, before], k| {
        let k = k as f64;
        [((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0), p]
    })
}

/// Returns the derivative of the Legendre polynomial of degree n, of value `p`, at `x`.
fn derivative(n: usize, x: f64, p: f64, before: f64) -> f64 {
    n as f64 * (x * p - before) / (x * x - 1.0)
}

/// Returns the integral of the Legendre polynomial of degree n from −1 to `x`.
fn integral(n: usize, x: f64) -> f64 {
    if n == 0 {
        return x + 1.0;
    }
    let [after, _] = legendre(n + 1, x);
    let [_, before] = legendre(n, x);
    (after - before) / (2 * n + 1) as f64
}

pub(super) static FOUR: LazyLock<Nodes<4>> = LazyLock::new(Nodes::new);
pub(super) static EIGHT: LazyLock<Nodes<8>> = LazyLock::new(Nodes::new);
pub(super) static TWELVE: LazyLock<Nodes<12>> = LazyLock::new(Nodes::new);
pub(super) static SIXTEEN: LazyLock<Nodes<16>> = LazyLock::new(Nodes::new);
pub(super) static TWENTY_FOUR: LazyLock<Nodes<24>> = LazyLock::new(Nodes::new);

#[cfg(test)]
mod tests {
    use super::*;

    /// The published nodes and weights for four nodes.
    #[test]
    fn validate_against_abramowitz_and_stegun() {
        let known = [
            (0.339_981_043_584_856, 0.652_145_154_862_546),
            (0.861_136_311_594_053, 0.347_854_845_137_454),
        ];
        for (i, (x, w)) in known.into_iter().enumerate() {
            assert!((FOUR.at[2 + i] - x).abs() < 1e-14 && (FOUR.weight[2 + i] - w).abs() < 1e-14);
            assert!((FOUR.at[1 - i] + x).abs() < 1e-14 && (FOUR.weight[1 - i] - w).abs() < 1e-14);
        }
    }

    /// Integrals of an exponential, up to each node, over the whole and in between.
    #[test]
    fn validate_integrals_of_an_exponential() {
        fn check<const M: usize>(nodes: &Nodes<M>, within: f64) {
            let (half, start) = (0.7, (-1.0_f64).exp());
            let f = nodes.at.map(f64::exp);
            let up_to = nodes.integrals(&f, half);
            for i in 0..M {
                assert!((up_to[i] - half * (f[i] - start)).abs() < within, "{M} nodes, {i}");
            }
            assert!((nodes.whole(&f, half) - half * (1_f64.exp() - start)).abs() < within);
            let (legendre, series) = (Legendre::at(0.3), nodes.coefficients(&f));
            let [value, integral] = [legendre.value(&series), legendre.integral(&series)];
            assert!((value - 0.3_f64.exp()).abs() < 10.0 * within);
            assert!((integral - (0.3_f64.exp() - start)).abs() < 10.0 * within);
        }
        check(&FOUR, 1e-2);
        check(&EIGHT, 1e-6);
        check(&TWELVE, 1e-11);
        check(&SIXTEEN, 1e-13);
        check(&TWENTY_FOUR, 1e-13);
    }
}
