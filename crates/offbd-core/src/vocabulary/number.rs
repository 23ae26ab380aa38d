//! Range checks that reject NaN.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::fmt;
use core::ops::RangeInclusive;

/// An invalid value and the element that holds it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{element}: {reason}")]
pub struct Invalid {
    /// JSON pointer (RFC 6901) to the element, for example `/ball/radius_m`.
    pub element: String,
    /// What is wrong with the value, with the admissible range.
    pub reason: String,
}

impl Invalid {
    /// Returns an error for `element` with the given `reason`.
    pub fn new(element: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { element: element.into(), reason: reason.into() }
    }
}

/// Displays a number for people: `1.5`, but `1e308` instead of 309 digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brief(pub f64);

impl fmt::Display for Brief {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// 2⁵³: up to here every integer is exact and has at most 16 digits.
        const EXACT: f64 = 9_007_199_254_740_992.0;
        let Self(value) = *self;
        let short = value == 0.0 || (EXACT.recip()..=EXACT).contains(&value.abs());
        if short || !value.is_finite() { write!(f, "{value}") } else { write!(f, "{value:e}") }
    }
}

/// Returns `value` if it lies in `range`; NaN never does.
///
/// # Errors
/// [`Invalid`] naming `element` and the range.
pub fn in_range(element: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, Invalid> {
    if range.contains(&value) {
        return Ok(value);
    }
    Err(Invalid::new(
        element,
        format!("{} is outside {} to {}", Brief(value), range.start(), range.end()),
    ))
}

/// Returns `value` if it is above zero and at most `most`.
///
/// # Errors
/// [`Invalid`] naming `element` and the range.
pub fn positive(element: &str, value: f64, most: f64) -> Result<f64, Invalid> {
    if value > 0.0 && value <= most {
        return Ok(value);
    }
    let metres = value / 1e3;
    let unit = if element.ends_with("_m") && value > most && metres <= most {
        format!(": the unit is m, so {value} mm are {metres}")
    } else {
        String::new()
    };
    Err(Invalid::new(element, format!("{} is not above 0 and at most {most}{unit}", Brief(value))))
}
