//! Simplifies lines to the visible resolution: drawings have integer pixels, on which close
//! points would turn a smooth line into steps.

/// Distance from the simplified line below which a point is dropped, as a share of the
/// line's extent along each axis. Chosen: half a pixel of a thousand.
const SHARE: f64 = 5e-4;

type PlotPoint = (f64, f64);

/// Simplifies a line by the Ramer–Douglas–Peucker algorithm (Ramer 1972; Douglas & Peucker
/// 1973).
pub(super) fn simplified(points: Vec<PlotPoint>) -> Vec<PlotPoint> {
    let extent = |of: fn(&PlotPoint) -> f64| {
        let values = points.iter().map(of).filter(|v| v.is_finite());
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if high > low { high - low } else { 1.0 }
    };
    let size = (extent(|p| p.0), extent(|p| p.1));
    let mut keep = vec![false; points.len()];
    let mut spans = Vec::new();
    if let Some(last) = points.len().checked_sub(1) {
        (keep[0], keep[last]) = (true, true);
        spans.push((0, last));
    }
    while let Some((from, to)) = spans.pop() {
        if let Some(farthest) = farthest(&points, from, to, size) {
            keep[farthest] = true;
            spans.extend([(from, farthest), (farthest, to)]);
        }
    }
    points.into_iter().zip(keep).filter_map(|(point, keep)| keep.then_some(point)).collect()
}

/// Returns the point between `from` and `to` that is farthest from their line, if its
/// distance is visible.
fn farthest(points: &[PlotPoint], from: usize, to: usize, size: (f64, f64)) -> Option<usize> {
    let scaled = |i: usize| (points[i].0 / size.0, points[i].1 / size.1);
    let (a, b) = (scaled(from), scaled(to));
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx.hypot(dy);
    let away = |i: usize| {
        let (px, py) = (scaled(i).0 - a.0, scaled(i).1 - a.1);
        if length > 0.0 { (dx * py - dy * px).abs() / length } else { px.hypot(py) }
    };
    let far = (from + 1..to).map(|i| (i, away(i))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    (far.1 > SHARE).then_some(far.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_two_points_and_a_peak_is_kept() {
        let line: Vec<PlotPoint> = (0..1000).map(|i| (f64::from(i), 2.0 * f64::from(i))).collect();
        assert_eq!(simplified(line.clone()), [line[0], line[999]]);
        let mut peak = line;
        peak[500].1 = 5000.0;
        assert_eq!(simplified(peak).len(), 5);
        assert_eq!(simplified(Vec::new()), []);
        assert_eq!(simplified(vec![(1.0, 2.0); 3]).len(), 2);
    }

    #[test]
    fn a_curve_is_followed_by_few_points() {
        let sine = |t: f64| (t, (t * 6.0).sin());
        let curve: Vec<PlotPoint> = (0..10_000).map(|i| sine(f64::from(i) * 1e-4)).collect();
        let few = simplified(curve);
        assert!((10..100).contains(&few.len()), "{}", few.len());
    }
}
