//! The signs at points, drawn in pixels.

use plotters::element::{Circle, Drawable, PathElement, PointCollection, Polygon, Rectangle};
use plotters::prelude::SVGBackend;
use plotters::style::{BLACK, Color, RGBColor, ShapeStyle};

use super::draw::Area;
use super::look::{Look, Marker};

type Drawn = Result<(), String>;
type At = (i32, i32);

/// The sign of `look`, `r` pixels from its centre to its edge.
pub(super) fn draw(area: &Area<'_>, at: At, look: Look, r: i32) -> Drawn {
    shape(area, at, look.marker, look.colour(), r)
}

/// The sign alone, small, on its own colour: inside a region.
pub(super) fn draw_small(area: &Area<'_>, at: At, look: Look) -> Drawn {
    shape(area, at, look.marker, look.ink(), 5)
}

/// A rectangle filled with the colour of `look`.
pub(super) fn draw_box(area: &Area<'_>, corners: [At; 2], look: Look) -> Drawn {
    put(area, Rectangle::new(corners, look.colour().filled()))
}

/// A black ring around a point.
pub(super) fn draw_ring(area: &Area<'_>, at: At, r: i32) -> Drawn {
    put(area, Circle::new(at, r, BLACK.stroke_width(4)))
}

fn shape(area: &Area<'_>, at: At, marker: Marker, colour: RGBColor, r: i32) -> Drawn {
    let (fill, line) = (colour.filled(), colour.stroke_width(4));
    match marker {
        Marker::Circle => put(area, Circle::new(at, r, fill)),
        Marker::Ring => put(area, Circle::new(at, r, line)),
        Marker::Square => {
            let s = r * 7 / 8;
            put(area, Rectangle::new([moved(at, -s, -s), moved(at, s, s)], fill))
        }
        Marker::Triangle => polygon(area, at, &[(0, -10), (10, 8), (-10, 8)], r, fill),
        Marker::Diamond => polygon(area, at, &[(0, -12), (9, 0), (0, 12), (-9, 0)], r, fill),
        Marker::Cross => strokes(area, at, &[[(-8, -8), (8, 8)], [(-8, 8), (8, -8)]], r, line),
        Marker::Plus => strokes(area, at, &[[(-10, 0), (10, 0)], [(0, -10), (0, 10)]], r, line),
        Marker::Star => polygon(area, at, &STAR, r, fill),
    }
}

/// Four points, tenths of the radius.
const STAR: [At; 8] = [(0, -12), (3, -3), (12, 0), (3, 3), (0, 12), (-3, 3), (-12, 0), (-3, -3)];

fn moved(at: At, dx: i32, dy: i32) -> At {
    (at.0 + dx, at.1 + dy)
}

/// `tenths` of `r` away from `at`.
fn scaled(at: At, tenths: At, r: i32) -> At {
    moved(at, tenths.0 * r / 10, tenths.1 * r / 10)
}

fn polygon(area: &Area<'_>, at: At, corners: &[At], r: i32, style: ShapeStyle) -> Drawn {
    let corners: Vec<At> = corners.iter().map(|&c| scaled(at, c, r)).collect();
    put(area, Polygon::new(corners, style))
}

fn strokes(area: &Area<'_>, at: At, lines: &[[At; 2]], r: i32, style: ShapeStyle) -> Drawn {
    lines.iter().try_for_each(|line| {
        put(area, PathElement::new(line.map(|end| scaled(at, end, r)).to_vec(), style))
    })
}

fn put<'b, E>(area: &Area<'b>, element: E) -> Drawn
where
    for<'c> &'c E: PointCollection<'c, At>,
    E: Drawable<SVGBackend<'b>>,
{
    area.draw(&element).map_err(|e| e.to_string())
}
