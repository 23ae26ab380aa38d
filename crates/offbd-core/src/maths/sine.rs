//! Sine and cosine without branches, tables or calls, so that the compiler can vectorise
//! them.
//!
//! The angle is reduced to [−π/4, π/4] by subtracting k·π/2 in two parts (Cody and
//! Waite). Two polynomials give sine and cosine there, and the last two bits of k select
//! which is which and the signs. The constants are those of fdlibm (Sun Microsystems,
//! 1993): `e_rem_pio2.c`, `k_sin.c` and `k_cos.c`. The polynomials are evaluated in pairs
//! (Estrin), which shortens the chain of dependent operations.
//!
//! Vector sines of other crates, such as those of `wide`, are not used: they choose their
//! instructions at compile time, not at run time, and fuse multiplications with additions
//! where those instructions allow it, so that two builds can differ in the last bit.

use core::f64::consts::FRAC_2_PI;

/// Largest angle, in either direction, for which [`sin_cos`] keeps its accuracy, rad.
pub const LIMIT_RAD: f64 = 1000.0;

/// The first 33 bits of π/2: its product with a k below 2²⁰ is exact.
const HALF_PI_HIGH: f64 = f64::from_bits(0x3FF9_21FB_5440_0000);
/// π/2 − [`HALF_PI_HIGH`].
const HALF_PI_LOW: f64 = f64::from_bits(0x3DD0_B461_1A62_6331);

/// 1.5·2⁵²: adding it rounds to the nearest integer and leaves that integer in the lowest
/// bits; subtracting it again gives the integer as a number.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// sin x ≈ x + x³·(S₀ + S₁x² + … + S₅x¹⁰), within 2⁻⁵⁸ of x.
const S: [f64; 6] = [
    f64::from_bits(0xBFC5_5555_5555_5549),
    f64::from_bits(0x3F81_1111_1110_F8A6),
    f64::from_bits(0xBF2A_01A0_19C1_61D5),
    f64::from_bits(0x3EC7_1DE3_57B1_FE7D),
    f64::from_bits(0xBE5A_E5E6_8A2B_9CEB),
    f64::from_bits(0x3DE5_D93A_5ACF_D57C),
];

/// cos x ≈ 1 − x²/2 + x⁴·(C₀ + C₁x² + … + C₅x¹⁰), within 2⁻⁵⁸.
const C: [f64; 6] = [
    f64::from_bits(0x3FA5_5555_5555_554C),
    f64::from_bits(0xBF56_C16C_16C1_5177),
    f64::from_bits(0x3EFA_01A0_19CB_1590),
    f64::from_bits(0xBE92_7E4F_809C_52AD),
    f64::from_bits(0x3E21_EE9E_BDB4_B1C4),
    f64::from_bits(0xBDA8_FAE9_BE88_38D4),
];

/// Returns (sin, cos) of `angle_rad`, within one unit in the last place (1.2e-16) of the
/// standard library for angles up to ±1000 rad; NaN if the angle is infinite or NaN.
#[inline(always)]
pub fn sin_cos(angle_rad: f64) -> (f64, f64) {
    let (x, turns) = reduced(angle_rad);
    turned(x, turns)
}

/// The first half of [`sin_cos`]: returns x in [−π/4, π/4], and the number of quarter
/// turns subtracted in the lowest bits of the second number.
#[inline(always)]
pub fn reduced(angle_rad: f64) -> (f64, f64) {
    let turns = angle_rad * FRAC_2_PI + ROUNDER;
    let k = turns - ROUNDER;
    ((angle_rad - k * HALF_PI_HIGH) - k * HALF_PI_LOW, turns)
}

/// The second half of [`sin_cos`], applied to the result of [`reduced`].
#[inline(always)]
pub fn turned(x: f64, turns: f64) -> (f64, f64) {
    let (sin, cos) = near_zero(x);
    let (sin, cos, quadrant) = (sin.to_bits(), cos.to_bits(), turns.to_bits());
    let exchange = (sin ^ cos) & (quadrant & 1).wrapping_neg();
    let sin_sign = (quadrant & 2) << 62;
    let cos_sign = (quadrant.wrapping_add(1) & 2) << 62;
    (f64::from_bits(sin ^ exchange ^ sin_sign), f64::from_bits(cos ^ exchange ^ cos_sign))
}

/// Returns (sin, cos) of an `x` in [−π/4, π/4].
#[inline(always)]
fn near_zero(x: f64) -> (f64, f64) {
    let z = x * x;
    let zz = z * z;
    let sin = (S[0] + z * S[1]) + zz * ((S[2] + z * S[3]) + zz * (S[4] + z * S[5]));
    let cos = (C[0] + z * C[1]) + zz * ((C[2] + z * C[3]) + zz * (C[4] + z * C[5]));
    (x + (x * z) * sin, 1.0 - (0.5 * z - zz * cos))
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, TAU};

    /// The largest errors of sine and cosine over `n` angles in ±`limit`.
    fn worst(limit: f64, n: u32) -> (f64, f64) {
        let angles = (0..=n).map(|i| limit * (2.0 * f64::from(i) / f64::from(n) - 1.0));
        angles.fold((0.0, 0.0), |(in_sin, in_cos), angle| {
            let ((sin, cos), (true_sin, true_cos)) = (sin_cos(angle), angle.sin_cos());
            (f64::max(in_sin, (sin - true_sin).abs()), f64::max(in_cos, (cos - true_cos).abs()))
        })
    }

    /// A unit in the last place of a number just below 1 is 1.11e-16.
    #[test]
    fn validate_against_the_standard_library() {
        for limit in [0.3, FRAC_PI_2, TAU, 1000.0] {
            let (in_sin, in_cos) = worst(limit, 1_000_003);
            assert!(in_sin <= 1.2e-16 && in_cos <= 1.2e-16, "±{limit}: {in_sin:e}, {in_cos:e}");
        }
    }

    #[test]
    fn small_angles_keep_all_their_digits() {
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert_eq!(sin_cos(-1e-9), (-1e-9, 1.0));
        assert_eq!(sin_cos(5e-324).0, 5e-324);
    }

    #[test]
    fn quarter_turns_have_the_right_signs() {
        for k in -8_i32..=8 {
            let (sin, cos) = sin_cos(f64::from(k) * FRAC_PI_2);
            let expected = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)];
            let (true_sin, true_cos): (f64, f64) = expected[k.rem_euclid(4) as usize];
            assert!((sin - true_sin).abs() < 1e-14 && (cos - true_cos).abs() < 1e-14, "{k}");
        }
    }

    #[test]
    fn what_is_not_an_angle_has_no_sine() {
        for angle in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (sin, cos) = sin_cos(angle);
            assert!(sin.is_nan() && cos.is_nan(), "{angle}");
        }
    }
}
