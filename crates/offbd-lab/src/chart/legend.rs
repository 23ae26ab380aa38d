//! The legend: one strip beneath all panels, an entry for each name.

use plotters::style::BLACK;
use plotters::style::text_anchor::{HPos, VPos};

use super::draw::{Area, CHARACTER, MARGIN, WIDTH, draw_stroke, text_style, write_text};
use super::figure::{Figure, Stroke};
use super::look::Look;
use super::marker;

const SIZE: f64 = 27.0;
const ROW: i32 = 44;
/// Blank above the first row.
const ABOVE: i32 = 12;
/// Width of a sample, and of the blanks beside it and after the name.
const SAMPLE: i32 = 70;
const BLANK: i32 = 14;
const APART: i32 = 36;

/// A name and what stands for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    name: String,
    sign: Sign,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sign {
    Series(Look, Stroke),
    Category(Look),
    Mark,
}

impl Entry {
    fn width(&self) -> i32 {
        let text = (self.name.chars().count() as f64 * SIZE * CHARACTER) as i32;
        SAMPLE + BLANK + text + APART
    }
}

/// The figure's entries, each name once, in rows that fit into the width.
pub(super) fn rows(figure: &Figure) -> Vec<Vec<Entry>> {
    let mut rows: Vec<Vec<Entry>> = Vec::new();
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

pub(super) fn height(rows: &[Vec<Entry>]) -> u32 {
    (ABOVE + rows.len() as i32 * ROW + MARGIN) as u32
}

fn entries(figure: &Figure) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    let mut add = |name: &str, sign| {
        if !name.is_empty() && entries.iter().all(|e| e.name != name) {
            entries.push(Entry { name: name.to_owned(), sign });
        }
    };
    for panel in &figure.panels {
        for category in panel.regions.iter().flat_map(|r| &r.categories) {
            add(&category.name, Sign::Category(category.look));
        }
        for series in &panel.series {
            add(&series.name, Sign::Series(series.look, series.stroke));
        }
    }
    for mark in figure.panels.iter().flat_map(|panel| &panel.marks) {
        add(&mark.name, Sign::Mark);
    }
    entries
}

/// Draws the rows from `top` downwards.
pub(super) fn draw(rows: &[Vec<Entry>], area: &Area<'_>, top: i32) -> Result<(), String> {
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

fn draw_sign(sign: Sign, area: &Area<'_>, (x, y): (i32, i32)) -> Result<(), String> {
    let middle = (x + SAMPLE / 2, y);
    match sign {
        Sign::Mark => marker::draw_ring(area, middle, 15),
        Sign::Series(look, Stroke::Markers) => marker::draw(area, middle, look, 10),
        Sign::Series(look, stroke) => {
            let line = if stroke == Stroke::LineAndMarkers { Stroke::Line } else { stroke };
            draw_stroke(&[(x, y), (x + SAMPLE, y)], look, line, area)?;
            if stroke == Stroke::LineAndMarkers {
                marker::draw(area, middle, look, 10)
            } else {
                Ok(())
            }
        }
        Sign::Category(look) => {
            let corners = [(x + 10, y - 15), (x + SAMPLE - 10, y + 15)];
            marker::draw_box(area, corners, look)?;
            marker::draw_small(area, middle, look)
        }
    }
}
