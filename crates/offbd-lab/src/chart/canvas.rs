//! What the parts of a drawing share: its size, its types and text.

use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoTextStyle, RGBColor, TextStyle};

/// Width of a drawing, pixels. Chosen: readable at half that width.
pub(super) const WIDTH: u32 = 1800;

/// Margin of the drawing, pixels.
pub(super) const MARGIN: i32 = 36;

/// Estimated mean width of a character relative to the size of the text, rounded up.
pub(super) const CHARACTER: f64 = 0.56;

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A point of a drawing, pixels from its upper left corner.
pub(super) type Pixel = (i32, i32);
/// Success, or why plotters could not draw.
pub(super) type DrawResult = Result<(), String>;

pub(super) fn message(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Returns a style of this size. Plotters divides font sizes by 1.24 in SVG; this
/// compensates it.
pub(super) fn text_style(size: f64, colour: RGBColor, h: HPos, v: VPos) -> TextStyle<'static> {
    let mut style = ("sans-serif", size * 1.24).into_text_style(&(WIDTH, WIDTH));
    style.color = colour.to_backend_color();
    style.pos(Pos::new(h, v))
}

pub(super) fn write_text(
    area: &Area<'_>,
    text: &str,
    style: &TextStyle<'_>,
    at: (i32, i32),
) -> DrawResult {
    area.draw_text(text, style, at).map_err(message)
}
