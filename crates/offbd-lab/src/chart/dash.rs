//! Dashed lines in pixels: plotters does not support SVG's dashes, and its own
//! replacement leaves strokes of zero length.

use super::canvas::Pixel;

/// Divides `line` into strokes, `on` pixels long and `off` apart, which follow its
/// corners.
pub(super) fn dashes(line: &[Pixel], on: i32, off: i32) -> Vec<Vec<Pixel>> {
    let mut strokes = Vec::new();
    let mut stroke: Vec<Pixel> = line.first().copied().into_iter().collect();
    let (mut drawing, mut left) = (true, f64::from(on));
    for ends in line.windows(2) {
        let (mut from, to) = (real(ends[0]), real(ends[1]));
        let mut length = (to.0 - from.0).hypot(to.1 - from.1);
        while length > left {
            let share = left / length;
            from = (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1));
            length -= left;
            stroke.push(whole(from));
            if drawing {
                strokes.push(std::mem::take(&mut stroke));
            }
            drawing = !drawing;
            left = f64::from(if drawing { on } else { off });
            stroke = vec![whole(from)];
        }
        left -= length;
        stroke.push(whole(to));
    }
    if drawing {
        strokes.push(stroke);
    }
    strokes.retain(|stroke| stroke.iter().any(|at| *at != stroke[0]));
    strokes
}

fn real(at: Pixel) -> (f64, f64) {
    (f64::from(at.0), f64::from(at.1))
}

fn whole(at: (f64, f64)) -> Pixel {
    (at.0.round() as i32, at.1.round() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strokes_go_round_corners_and_none_is_without_length() {
        let line = [(0, 0), (10, 0), (10, 10), (10, 12)];
        let wanted = [
            vec![(0, 0), (6, 0)],
            vec![(8, 0), (10, 0), (10, 4)],
            vec![(10, 6), (10, 10), (10, 12)],
        ];
        assert_eq!(dashes(&line, 6, 2), wanted);
        assert_eq!(dashes(&[(0, 0), (8, 0)], 6, 2), [[(0, 0), (6, 0)]]);
        assert!(dashes(&[(3, 3)], 6, 2).is_empty() && dashes(&[], 6, 2).is_empty());
    }
}
