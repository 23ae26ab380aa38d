//! The legend: one strip beneath all panels, with one entry per name.

use plotters::style::BLACK;
use plotters::style::text_anchor::{HPos, VPos};

use super::canvas::{Area, CHARACTER, MARGIN, WIDTH, text_style, write_text};
use super::figure::{Figure, Stroke};
use super::look::Look;
use super::marker;
use super::stroke::draw_stroke;

/// Size of the text, pixels.
const SIZE: f64 = 27.0;
/// Height of a row, pixels.
const ROW: i32 = 44;
/// Space above the first row, pixels.
const ABOVE: i32 = 12;
/// Width of a sample, pixels.
const SAMPLE: i32 = 70;
/// Space between a sample and its name, pixels.
const BLANK: i32 = 14;
/// Space after a name, pixels.
const APART: i32 = 36;

/// A name with its sample.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LegendEntry {
    name: String,
    sign: LegendSign,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LegendSign {
    Series(Look, Stroke),
    Category(Look),
    Mark,
}

impl LegendEntry {
    fn width(&self) -> i32 {
        let text = (self.name.chars().count() as f64 * SIZE * CHARACTER) as i32;
        SAMPLE + BLANK + text + APART
    }
}

/// Returns the entries of the figure, each name once, in rows that fit into the width.
pub(super) fn rows(figure: &Figure) -> Vec<Vec<LegendEntry>> {
    let mut rows: Vec<Vec<LegendEntry>> = Vec::new();
    let mut used = 0;
    for entry in entries(figure) {
        let width = entry.width();
        match rows.last_mut() {
            Some(row) if used + width <= WIDTH as i32 - 2 * MARGIN => {
                used += width;
                row.push(entry);
            }
            _ => {
                used = width;
                rows.push(vec![entry]);
            }
        }
    }
    rows
}

pub(super) fn height(rows: &[Vec<LegendEntry>]) -> u32 {
    (ABOVE + rows.len() as i32 * ROW + MARGIN) as u32
}

fn entries(figure: &Figure) -> Vec<LegendEntry> {
    let mut entries: Vec<LegendEntry> = Vec::new();
    let mut add = |name: &str, sign| {
        if !name.is_empty() && entries.iter().all(|e| e.name != name) {
            entries.push(LegendEntry { name: name.to_owned(), sign });
        }
    };
    for panel in &figure.panels {
        for category in panel.regions.iter().flat_map(|r| &r.categories) {
            add(&category.name, LegendSign::Category(category.look));
        }
        for series in &panel.series {
            add(&series.name, LegendSign::Series(series.look, series.stroke));
        }
    }
    for mark in figure.panels.iter().flat_map(|panel| &panel.marks) {
        add(&mark.name, LegendSign::Mark);
    }
    entries
}

/// Draws the rows from `top` downwards.
pub(super) fn draw(rows: &[Vec<LegendEntry>], area: &Area<'_>, top: i32) -> Result<(), String> {
    for (i, row) in rows.iter().enumerate() {
        let y = top + ABOVE + ROW / 2 + ROW * i as i32;
        let mut x = MARGIN + 12;
        for entry in row {
            draw_sign(entry.sign, area, (x, y))?;
            let style = text_style(SIZE, BLACK, HPos::Left, VPos::Center);
            write_text(area, &entry.name, &style, (x + SAMPLE + BLANK, y))?;
            x += entry.width();
        }
    }
    Ok(())
}

fn draw_sign(sign: LegendSign, area: &Area<'_>, (x, y): (i32, i32)) -> Result<(), String> {
    let middle = (x + SAMPLE / 2, y);
    match sign {
        LegendSign::Mark => marker::draw_ring(area, middle, 15),
        LegendSign::Series(look, Stroke::Markers) => marker::draw(area, middle, look, 10),
        LegendSign::Series(look, stroke) => {
            let line = if stroke == Stroke::LineAndMarkers { Stroke::Line } else { stroke };
            draw_stroke(&[(x, y), (x + SAMPLE, y)], look, line, area)?;
            if stroke == Stroke::LineAndMarkers {
                marker::draw(area, middle, look, 10)
            } else {
                Ok(())
            }
        }
        LegendSign::Category(look) => {
            let corners = [(x + 10, y - 15), (x + SAMPLE - 10, y + 15)];
            marker::draw_box(area, corners, look)?;
            marker::draw_small(area, middle, look)
        }
    }
}
