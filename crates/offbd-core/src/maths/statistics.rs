//! Robust estimates of location and scale.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// Returns the median and reorders `values`; `None` if there are none.
pub fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let (middle, odd) = (values.len() / 2, values.len() % 2 == 1);
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if odd {
        return Some(upper);
    }
    let lower = below.iter().copied().max_by(f64::total_cmp).unwrap_or(upper);
    Some(lower.midpoint(upper))
}

/// Returns the `share` quantile of `values` (nearest rank; `share` in [0, 1]) and
/// reorders them; `None` if there are none.
pub fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let rank = ((values.len() as f64 * share).ceil() as usize).clamp(1, last + 1) - 1;
    Some(*values.select_nth_unstable_by(rank, f64::total_cmp).1)
}

/// Returns 1.4826 × the median absolute deviation from the median: the standard deviation
/// if `values` are normal (Rousseeuw & Croux 1993, eq. 1.1).
pub fn robust_deviation(values: &mut [f64]) -> Option<f64> {
    let centre = median(values)?;
    for value in values.iter_mut() {
        *value = (*value - centre).abs();
    }
    median(values).map(|m| 1.4826 * m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_odd_even_and_none() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(median(&mut []), None);
    }

    #[test]
    fn quantile_is_the_nearest_rank() {
        let values = [5.0, 1.0, 4.0, 2.0, 3.0];
        for (share, wanted) in [(0.0, 1.0), (0.2, 1.0), (0.21, 2.0), (0.9, 5.0), (1.0, 5.0)] {
            assert_eq!(quantile(&mut values.clone(), share), Some(wanted), "{share}");
        }
        assert_eq!(quantile(&mut [], 0.5), None);
    }

    #[test]
    fn a_wild_value_does_not_move_the_scale() {
        let mut values = [-1.0, -0.5, 0.0, 0.5, 1.0, 1e9];
        assert!(robust_deviation(&mut values).unwrap() < 2.0);
    }
}
