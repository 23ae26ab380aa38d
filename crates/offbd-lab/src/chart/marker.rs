//! Draws markers, in pixels.

use plotters::element::{Circle, Drawable, PathElement, PointCollection, Polygon, Rectangle};
use plotters::prelude::SVGBackend;
use plotters::style::{BLACK, Color, RGBColor, ShapeStyle};

use super::canvas::{Area, DrawResult, Pixel};
use super::look::{Look, Marker};

/// Draws the marker of `look` with a radius of `r` pixels.
pub(super) fn draw(area: &Area<'_>, at: Pixel, look: Look, r: i32) -> DrawResult {
    shape(area, at, look.marker, look.colour(), r)
}

/// Draws a small marker in black or white on the colour of `look`, inside a region.
pub(super) fn draw_small(area: &Area<'_>, at: Pixel, look: Look) -> DrawResult {
    shape(area, at, look.marker, look.ink(), 5)
}

/// Draws a rectangle filled with the colour of `look`.
pub(super) fn draw_box(area: &Area<'_>, corners: [Pixel; 2], look: Look) -> DrawResult {
    put(area, Rectangle::new(corners, look.colour().filled()))
}

/// Draws a black ring around a point.
pub(super) fn draw_ring(area: &Area<'_>, at: Pixel, r: i32) -> DrawResult {
    put(area, Circle::new(at, r, BLACK.stroke_width(4)))
}

fn shape(area: &Area<'_>, at: Pixel, marker: Marker, colour: RGBColor, r: i32) -> DrawResult {
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

/// Corners of a star with four points, in tenths of the radius.
const STAR: [Pixel; 8] = [(0, -12), (3, -3), (12, 0), (3, 3), (0, 12), (-3, 3), (-12, 0), (-3, -3)];

fn moved(at: Pixel, dx: i32, dy: i32) -> Pixel {
    (at.0 + dx, at.1 + dy)
}

/// Returns the point at an offset of `tenths` of `r` from `at`.
fn scaled(at: Pixel, tenths: Pixel, r: i32) -> Pixel {
    moved(at, tenths.0 * r / 10, tenths.1 * r / 10)
}

fn polygon(area: &Area<'_>, at: Pixel, corners: &[Pixel], r: i32, style: ShapeStyle) -> DrawResult {
    let corners: Vec<Pixel> = corners.iter().map(|&c| scaled(at, c, r)).collect();
    put(area, Polygon::new(corners, style))
}

fn strokes(
    area: &Area<'_>,
    at: Pixel,
    lines: &[[Pixel; 2]],
    r: i32,
    style: ShapeStyle,
) -> DrawResult {
    lines.iter().try_for_each(|line| {
        put(area, PathElement::new(line.map(|end| scaled(at, end, r)).to_vec(), style))
    })
}

fn put<'b, E>(area: &Area<'b>, element: E) -> DrawResult
where
    for<'c> &'c E: PointCollection<'c, Pixel>,
    E: Drawable<SVGBackend<'b>>,
{
    area.draw(&element).map_err(|e| e.to_string())
}
