//! Equal scales on both axes, for positions on the plate.

use super::canvas::{MARGIN, WIDTH};
use super::scale::Scale;

/// Width of margins and labels beside the axes of a single untitled panel in its row,
/// pixels; as `draw.rs` lays it out.
const BESIDE: i32 = 2 * MARGIN - 12 + 12 + 22 + 128;
/// Height of margins and labels above and below these axes, pixels; likewise.
const ABOVE_AND_BELOW: u32 = 8 + 8 + 92;

/// Limits of a panel's height, pixels; chosen to be readable.
const HEIGHTS: (u32, u32) = (600, 1400);

/// Returns scales around the ranges `x` and `y` with equal lengths per unit, for a single
/// panel in its row, and the height of that panel.
#[must_use]
pub fn equal_scales(x: (f64, f64), y: (f64, f64)) -> (Scale, Scale, u32) {
    let width = f64::from(WIDTH as i32 - BESIDE);
    let wanted = width * (y.1 - y.0) / (x.1 - x.0);
    let height = (wanted as u32).saturating_add(ABOVE_AND_BELOW).clamp(HEIGHTS.0, HEIGHTS.1);
    let room = f64::from(height - ABOVE_AND_BELOW);
    let per_pixel = ((x.1 - x.0) / width).max((y.1 - y.0) / room);
    (around(x, per_pixel * width), around(y, per_pixel * room), height)
}

fn around((low, high): (f64, f64), length: f64) -> Scale {
    let middle = f64::midpoint(low, high);
    Scale::Linear(middle - length / 2.0, middle + length / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{Axis, Figure, Look, Panel, Series, Stroke, svg};

    /// Draws a line from `a` to `b`; returns its length in pixels.
    fn drawn(a: (f64, f64), b: (f64, f64), ranges: [(f64, f64); 2]) -> f64 {
        let (x, y, panel_height) = equal_scales(ranges[0], ranges[1]);
        let mut panel = Panel::new("", Axis::new("x", x), Axis::new("y", y));
        panel.series.push(Series::new("line", Look::of(0), Stroke::Line, vec![a, b]));
        let (title, subtitle) = ("t".to_owned(), "s".to_owned());
        let figure = Figure { title, subtitle, columns: 1, panel_height, panels: vec![panel] };
        let drawing = svg(&figure).unwrap();
        let line = drawing.lines().find(|l| l.contains("#0072B2")).unwrap();
        let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
        let ends: Vec<f64> =
            points.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
        (ends[2] - ends[0]).hypot(ends[3] - ends[1])
    }

    #[test]
    fn a_length_is_as_long_along_both_axes() {
        for ranges in [[(-0.2, 0.2), (-0.13, 0.13)], [(-1.0, 1.0), (-9.0, 1.0)]] {
            let along = drawn((0.0, 0.0), (0.1, 0.0), ranges);
            let across = drawn((0.0, 0.0), (0.0, 0.1), ranges);
            assert!((along - across).abs() <= 2.0 && along > 5.0, "{along} and {across}");
        }
    }
}
