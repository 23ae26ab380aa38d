//! Lines and markers through points, in panels and in the legend.

use plotters::prelude::PathElement;
use plotters::style::Color;

use super::canvas::{Area, DrawResult, message};
use super::dash::dashes;
use super::figure::Stroke;
use super::look::Look;
use super::marker;

/// Draws line and markers through `points` (pixels), in panels and in the legend.
pub(super) fn draw_stroke(
    points: &[(i32, i32)],
    look: Look,
    stroke: Stroke,
    area: &Area<'_>,
) -> DrawResult {
    match stroke {
        Stroke::Front => return draw_front(points, look, area),
        Stroke::Line | Stroke::LineAndMarkers => draw_line(points, look, area)?,
        Stroke::Markers => {}
    }
    if stroke == Stroke::Line {
        return Ok(());
    }
    points.iter().try_for_each(|&at| marker::draw(area, at, look, 9))
}

fn draw_line(points: &[(i32, i32)], look: Look, area: &Area<'_>) -> DrawResult {
    let style = look.colour().stroke_width(4);
    let strokes = match look.dash {
        None => vec![points.to_vec()],
        Some((on, off)) => dashes(points, on, off),
    };
    let drawn = strokes.into_iter().filter(|stroke| stroke.len() > 1);
    drawn
        .map(|stroke| PathElement::new(stroke, style))
        .try_for_each(|e| area.draw(&e).map_err(message))
}

fn draw_front(points: &[(i32, i32)], look: Look, area: &Area<'_>) -> DrawResult {
    if points.len() < 2 {
        return Ok(());
    }
    let style = look.colour().mix(0.3).stroke_width(16);
    area.draw(&PathElement::new(points.to_vec(), style)).map_err(message)
}
