//! Draws a figure as SVG: title and subtitle, a grid of panels, and one legend beneath
//! them, where it covers no data.

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::prelude::{Cartesian2d, IntoDrawingArea, SVGBackend};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{BLACK, Color, IntoTextStyle, RGBColor, WHITE};

use super::canvas::{Area, CHARACTER, DrawResult, MARGIN, WIDTH, message, text_style, write_text};
use super::error::ChartError;
use super::figure::{Figure, Mark, Panel, Series, Stroke};
use super::legend::{self, LegendEntry};
use super::marker;
use super::scale::Scale;
use super::stroke::draw_stroke;

/// Size of the title, pixels. All sizes are chosen so that the smallest is 13 pixels at
/// half the width.
const TITLE: f64 = 42.0;
/// Size of the subtitle, pixels.
const SUBTITLE: f64 = 29.0;
/// Size of labels of axes and titles of panels, pixels.
const LABEL: f64 = 28.0;
/// Size of tick labels, pixels.
const TICK: f64 = 26.0;

const GREY: RGBColor = RGBColor(70, 70, 70);
const GRID: RGBColor = RGBColor(214, 214, 214);
const FAINT: RGBColor = RGBColor(238, 238, 238);

type Axes<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scale, Scale>>;
/// Draws the figure as SVG 1.1.
///
/// # Errors
/// [`ChartError::Draw`] if a panel is too small for its axes.
pub fn svg(figure: &Figure) -> Result<String, ChartError> {
    let mut text = String::new();
    let legend = legend::rows(figure);
    let head = head_height(figure);
    let columns = figure.columns.max(1);
    let rows = figure.panels.len().div_ceil(columns);
    let panels = figure.panel_height * rows as u32;
    let height = head + panels + legend::height(&legend);
    let area = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
    draw(figure, &area, &legend, (head, panels, rows))
        .and_then(|()| area.present().map_err(message))
        .map_err(|reason| ChartError::Draw { figure: figure.title.clone(), reason })?;
    drop(area);
    Ok(text)
}

fn draw(
    figure: &Figure,
    area: &Area<'_>,
    legend: &[Vec<LegendEntry>],
    (head, panels, rows): (u32, u32, usize),
) -> DrawResult {
    area.fill(&WHITE).map_err(message)?;
    draw_head(figure, area)?;
    let columns = figure.columns.max(1);
    let (_, below) = area.split_vertically(head);
    let (middle, _) = below.split_vertically(panels);
    let grid = middle.margin(0, 0, MARGIN - 12, MARGIN).split_evenly((rows, columns));
    for (place, panel) in grid.iter().zip(&figure.panels) {
        draw_panel(panel, place, area)?;
    }
    legend::draw(legend, area, (head + panels) as i32)
}

fn head_height(figure: &Figure) -> u32 {
    let lines = wrapped(&figure.subtitle, SUBTITLE).len() as u32;
    MARGIN as u32 + 58 + lines * 38 + 16
}

fn draw_head(figure: &Figure, area: &Area<'_>) -> DrawResult {
    let style = text_style(TITLE, BLACK, HPos::Left, VPos::Top);
    write_text(area, &figure.title, &style, (MARGIN, MARGIN))?;
    let style = text_style(SUBTITLE, GREY, HPos::Left, VPos::Top);
    for (i, line) in wrapped(&figure.subtitle, SUBTITLE).iter().enumerate() {
        write_text(area, line, &style, (MARGIN, MARGIN + 58 + 38 * i as i32))?;
    }
    Ok(())
}

/// Breaks `text` into lines that fit into the width.
fn wrapped(text: &str, size: f64) -> Vec<String> {
    let room = (f64::from(WIDTH as i32 - 2 * MARGIN) / (size * CHARACTER)) as usize;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn draw_panel(panel: &Panel, place: &Area<'_>, whole: &Area<'_>) -> DrawResult {
    let inner = place.margin(if panel.title.is_empty() { 8 } else { 50 }, 8, 12, 22);
    let mut builder = ChartBuilder::on(&inner);
    let names = (panel.y.scale.longest_name() as f64 * TICK * CHARACTER) as i32;
    builder.x_label_area_size(92).y_label_area_size(128.max(names + 30));
    let mut axes = builder
        .build_cartesian_2d(panel.x.scale.clone(), panel.y.scale.clone())
        .map_err(message)?;
    draw_regions(panel, &axes, whole)?;
    draw_axes(panel, &mut axes)?;
    draw_panel_title(panel, &axes, whole)?;
    let (fronts, others): (Vec<&Series>, Vec<&Series>) =
        panel.series.iter().partition(|series| series.stroke == Stroke::Front);
    for series in fronts.into_iter().chain(others) {
        draw_series(panel, series, &axes, whole)?;
    }
    panel.marks.iter().try_for_each(|mark| draw_mark(panel, mark, &axes, whole))
}

fn draw_axes(panel: &Panel, axes: &mut Axes<'_, '_>) -> DrawResult {
    let size = (WIDTH, WIDTH);
    let mut mesh = axes.configure_mesh();
    mesh.x_desc(panel.x.label.as_str()).y_desc(panel.y.label.as_str());
    mesh.axis_desc_style(("sans-serif", LABEL * 1.24).into_text_style(&size));
    mesh.label_style(("sans-serif", TICK * 1.24).into_text_style(&size));
    mesh.axis_style(GREY.stroke_width(2));
    if panel.regions.is_some() {
        mesh.disable_mesh();
    }
    mesh.bold_line_style(GRID.stroke_width(2)).light_line_style(FAINT.stroke_width(1));
    mesh.draw().map_err(message)
}

fn draw_panel_title(panel: &Panel, axes: &Axes<'_, '_>, whole: &Area<'_>) -> DrawResult {
    let (x, y) = axes.plotting_area().get_pixel_range();
    let at = ((x.start + x.end) / 2, y.start - 12);
    let style = text_style(LABEL, BLACK, HPos::Center, VPos::Bottom);
    write_text(whole, &panel.title, &style, at)
}

/// Returns the pixels of the points within the axes.
fn pixels(panel: &Panel, points: &[(f64, f64)], axes: &Axes<'_, '_>) -> Vec<(i32, i32)> {
    let inside = |p: &&(f64, f64)| panel.x.scale.contains(p.0) && panel.y.scale.contains(p.1);
    points.iter().filter(inside).map(|p| axes.backend_coord(p)).collect()
}

fn draw_series(
    panel: &Panel,
    series: &Series,
    axes: &Axes<'_, '_>,
    whole: &Area<'_>,
) -> DrawResult {
    let points = pixels(panel, &series.points, axes);
    draw_stroke(&points, series.look, series.stroke, whole)
}

fn draw_mark(panel: &Panel, mark: &Mark, axes: &Axes<'_, '_>, whole: &Area<'_>) -> DrawResult {
    let Some(&at) = pixels(panel, &[mark.at], axes).first() else { return Ok(()) };
    marker::draw_ring(whole, at, 19)?;
    if mark.text.is_empty() {
        return Ok(());
    }
    let (x, y) = axes.plotting_area().get_pixel_range();
    let right = at.0 > (x.start + x.end) / 2;
    let dx = if right { -26 } else { 26 };
    let dy = if at.1 < y.start + 40 { 26 } else { -26 };
    let side = if right { HPos::Right } else { HPos::Left };
    let style = text_style(TICK, BLACK, side, VPos::Center);
    write_text(whole, &mark.text, &style, (at.0 + dx, at.1 + dy))
}

/// Draws the cells, each with the marker of its category if there is room, so that the
/// map is readable without colours.
fn draw_regions(panel: &Panel, axes: &Axes<'_, '_>, whole: &Area<'_>) -> DrawResult {
    let Some(regions) = &panel.regions else { return Ok(()) };
    for (i, j, [low, high], category) in regions.filled() {
        let corner = |p: (f64, f64)| {
            axes.backend_coord(&(panel.x.scale.clamp(p.0), panel.y.scale.clamp(p.1)))
        };
        let (a, b) = (corner(low), corner(high));
        marker::draw_box(whole, [a, b], category.look)?;
        let (w, h) = ((b.0 - a.0).abs().max(1), (b.1 - a.1).abs().max(1));
        let every = |side: i32| (44 / side).max(1) as usize;
        if i % every(w) == every(w) / 2 && j % every(h) == every(h) / 2 {
            marker::draw_small(whole, (a.0.midpoint(b.0), a.1.midpoint(b.1)), category.look)?;
        }
    }
    Ok(())
}
