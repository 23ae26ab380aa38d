//! Parsers of numbers within ranges, for clap, which adds the name of the option.

use std::ops::RangeInclusive;

use offbd_core::vocabulary::{Axis, PerAxis};
use offbd_lab::simulation::{LEAST_STEP, is_step};

/// Parses a number in `range`; NaN is invalid.
pub(super) fn within(
    range: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |word| {
        let value: Option<f64> = word.trim().parse().ok();
        let wrong = || format!("not a number from {} to {}", range.start(), range.end());
        value.filter(|v| range.contains(v)).ok_or_else(wrong)
    }
}

/// Parses `X,Y`, each in `range`, or one number for both axes.
pub(super) fn pair(
    range: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<PerAxis<f64>, String> + Clone + Send + Sync + 'static {
    let number = within(range);
    move |word| {
        let (x, y) = word.split_once(',').unwrap_or((word, word));
        Ok(PerAxis { x: number(x)?, y: number(y)? })
    }
}

/// Parses a resolution: zero, or a number from [`LEAST_STEP`] to `most`.
pub(super) fn step(
    most: f64,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |word| {
        let value: Option<f64> = word.parse().ok();
        let wrong = || format!("neither 0 nor a number from {LEAST_STEP:e} to {most}");
        value.filter(|v| is_step(*v, most)).ok_or_else(wrong)
    }
}

/// Parses an interval in seconds as in `12-14`.
pub(super) fn span(word: &str) -> Result<(f64, f64), String> {
    let wrong = || "not a span of seconds as in 12-14".to_owned();
    let (from, to) = word.split_once('-').ok_or_else(wrong)?;
    let (from, to): (f64, f64) =
        (from.parse().map_err(|_| wrong())?, to.parse().map_err(|_| wrong())?);
    if from < to { Ok((from, to)) } else { Err(wrong()) }
}

/// Converts degrees to radians, for each axis.
pub(super) fn radians(degrees: PerAxis<f64>) -> PerAxis<f64> {
    PerAxis::from_fn(|axis: Axis| degrees[axis].to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_is_for_both_axes() {
        let level = pair(-5.0..=5.0);
        assert_eq!(level("-1.5"), Ok(PerAxis { x: -1.5, y: -1.5 }));
        assert_eq!(level("-1.5,0.5"), Ok(PerAxis { x: -1.5, y: 0.5 }));
        for wrong in ["6", "1,6", "1,", ",1", "1,2,3", "NaN", "inf", "", "level"] {
            assert!(level(wrong).unwrap_err().contains("-5 to 5"), "{wrong}");
        }
    }
}
