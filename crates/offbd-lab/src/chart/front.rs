//! The Pareto front of two costs.

/// One point of a Pareto front, with its index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontPoint {
    /// Index into the points given.
    pub index: usize,
    pub point: (f64, f64),
}

/// Returns the points that no other point dominates (less is better in both coordinates),
/// in ascending order of the first coordinate. Of equal points, the first is returned;
/// points that are not finite are dropped.
#[must_use]
pub fn front(points: &[(f64, f64)]) -> Vec<FrontPoint> {
    let finite = |p: &FrontPoint| p.point.0.is_finite() && p.point.1.is_finite();
    let all = points.iter().enumerate().map(|(index, &point)| FrontPoint { index, point });
    let mut sorted: Vec<FrontPoint> = all.filter(finite).collect();
    sorted.sort_by(|a, b| {
        let by_x = a.point.0.total_cmp(&b.point.0);
        by_x.then(a.point.1.total_cmp(&b.point.1)).then(a.index.cmp(&b.index))
    });
    let mut best = f64::INFINITY;
    sorted.retain(|p| {
        let better = p.point.1 < best;
        best = best.min(p.point.1);
        better
    });
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nothing_on_the_front_is_beaten_and_all_else_is(
            points in proptest::collection::vec((0..20_u8, 0..20_u8), 1..40)
        ) {
            let points: Vec<(f64, f64)> =
                points.into_iter().map(|(x, y)| (f64::from(x), f64::from(y))).collect();
            let on: Vec<usize> = front(&points).iter().map(|p| p.index).collect();
            for (i, a) in points.iter().enumerate() {
                let beaten = points.iter().enumerate().any(|(j, b)| {
                    b.0 <= a.0 && b.1 <= a.1 && (b != a || j < i)
                });
                prop_assert_eq!(on.contains(&i), !beaten);
            }
        }
    }
}
