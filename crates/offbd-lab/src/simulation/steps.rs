//! Quantisation: rounding to steps, of readings and of servos with whole degrees.
//!
//! A step is zero (none) or large enough that a value divided by it is finite.

use offbd_core::vocabulary::{Brief, Invalid};

/// Smallest step, m or rad. Chosen: a ten-thousandth of the resolution of the log.
pub const LEAST_STEP: f64 = 1e-9;

/// Returns whether `step` is zero or from [`LEAST_STEP`] to `most`.
#[must_use]
pub fn is_step(step: f64, most: f64) -> bool {
    step == 0.0 || (LEAST_STEP..=most).contains(&step)
}

/// Returns `step` if it is valid; NaN never is.
///
/// # Errors
/// [`Invalid`] naming `element` and the range.
pub(super) fn step_in(element: &str, step: f64, most: f64) -> Result<f64, Invalid> {
    if is_step(step, most) {
        return Ok(step);
    }
    let step = Brief(step);
    Err(Invalid::new(element, format!("{step} is neither 0 nor {LEAST_STEP:e} to {most}")))
}

/// Rounds `value` to the nearest multiple of `step`; a step of 0 leaves it unchanged.
pub(super) fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn steps_that_no_number_survives_are_refused_by_name() {
        for tiny in [5e-324, f64::MIN_POSITIVE, 1e-10, -1e-3, 2.0, f64::NAN, f64::INFINITY] {
            let error = step_in("/sensor/quantum_m", tiny, 1.0).unwrap_err();
            assert_eq!(error.element, "/sensor/quantum_m");
            assert!(error.reason.contains("neither 0 nor 1e-9 to 1"), "{}", error.reason);
        }
        assert!(step_in("/a", 0.0, 1.0).is_ok() && step_in("/a", LEAST_STEP, 1.0).is_ok());
    }

    proptest! {
        #[test]
        fn what_is_rounded_is_finite_and_at_most_half_a_step_off(
            value in -10.0..10.0_f64,
            exponent in -9.0..0.0_f64,
        ) {
            let step = 10.0_f64.powf(exponent).max(LEAST_STEP);
            let off = (rounded(value, step) - value).abs();
            // Half a step, and the rounding error of the product.
            prop_assert!(off <= step / 2.0 + value.abs() * f64::EPSILON, "{off} of {step}");
        }
    }
}
