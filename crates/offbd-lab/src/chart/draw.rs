//! Draws a figure as SVG: title and subtitle, a grid of panels, and one legend beneath
//! them, where it covers no data.

use std::fmt::Write;

use super::figure::{Figure, Mark, Panel, Series, Stroke};
use super::look::Look;
use super::scale::Scale;

/// Width of a drawing, pixels. Chosen: readable at half that width; all sizes of text are
/// chosen so that the smallest is 13 pixels there.
const WIDTH: f64 = 1800.0;
/// Margin of the drawing, pixels.
const MARGIN: f64 = 36.0;
/// Size of the title, pixels.
const TITLE: f64 = 42.0;
/// Size of the subtitle, pixels.
const SUBTITLE: f64 = 29.0;
/// Size of labels of axes and titles of panels, pixels.
const LABEL: f64 = 28.0;
/// Size of tick labels and of the legend, pixels.
const TICK: f64 = 26.0;
/// Estimated mean width of a character relative to the size of the text, rounded up.
const CHARACTER: f64 = 0.56;
/// Space left of the axes for labels, unless names need more, and right, above (without a
/// title) and below them, pixels.
const BESIDE: [f64; 4] = [128.0, 22.0, 16.0, 100.0];
/// Height of a row of the legend, pixels.
const ROW: f64 = 44.0;
/// Width of a sample in the legend, and space after it and after its name, pixels.
const SAMPLE: [f64; 3] = [70.0, 14.0, 36.0];
/// Digit to which coordinates are drawn, pixels.
const DRAWN_PIXELS: f64 = 0.1;
/// Limits of the height of a panel with equal scales, pixels; chosen to be readable.
const HEIGHTS: (f64, f64) = (600.0, 1400.0);

const BLACK: &str = "#000000";
const GREY: &str = "#464646";

/// A point of a drawing, pixels from its upper left corner.
type Pixel = (f64, f64);

/// Draws the figure as SVG 1.1.
#[must_use]
pub fn svg(figure: &Figure) -> String {
    let columns = figure.columns.max(1);
    let subtitle = wrapped(&figure.subtitle);
    let head = MARGIN + 74.0 + 38.0 * subtitle.len() as f64;
    let panel_height = f64::from(figure.panel_height);
    let below = head + panel_height * figure.panels.len().div_ceil(columns) as f64;
    let legend = legend_rows(figure);
    let height = below + 12.0 + ROW * legend.len() as f64 + MARGIN;
    let mut drawing = Drawing(format!(
        "<svg width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" \
         xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\">\n"
    ));
    drawing.rectangle((0.0, 0.0), (WIDTH, height), "#FFFFFF");
    drawing.text(&figure.title, TITLE, "start", (MARGIN, MARGIN + 36.0), BLACK);
    for (i, line) in subtitle.iter().enumerate() {
        drawing.text(line, SUBTITLE, "start", (MARGIN, MARGIN + 84.0 + 38.0 * i as f64), GREY);
    }
    let width = (WIDTH - 2.0 * MARGIN) / columns as f64;
    for (i, panel) in figure.panels.iter().enumerate() {
        let (column, row) = ((i % columns) as f64, (i / columns) as f64);
        let corner = (MARGIN + width * column, head + panel_height * row);
        Axes::new(panel, corner, (width, panel_height)).draw(&mut drawing);
    }
    for (i, row) in legend.iter().enumerate() {
        drawing.legend_row(row, below + 12.0 + ROW * (i as f64 + 0.5));
    }
    drawing.0 + "</svg>\n"
}

/// Returns scales around the ranges `x` and `y` with equal lengths per unit, for a single
/// untitled panel in its row, and the height of that panel.
#[must_use]
pub fn equal_scales(x: (f64, f64), y: (f64, f64)) -> (Scale, Scale, u32) {
    let [left, right, above, below] = BESIDE;
    let width = WIDTH - 2.0 * MARGIN - left - right;
    let wanted = width * (y.1 - y.0) / (x.1 - x.0) + above + below;
    let height = wanted.clamp(HEIGHTS.0, HEIGHTS.1).round();
    let room = height - above - below;
    let per_pixel = ((x.1 - x.0) / width).max((y.1 - y.0) / room);
    let around = |(low, high): (f64, f64), length: f64| {
        let middle = f64::midpoint(low, high);
        Scale::Linear(middle - length / 2.0, middle + length / 2.0)
    };
    (around(x, per_pixel * width), around(y, per_pixel * room), height as u32)
}

/// Returns the estimated width of a text, pixels.
fn text_width(text: &str, size: f64) -> f64 {
    text.chars().count() as f64 * size * CHARACTER
}

/// Breaks a subtitle into lines that fit into the width.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line)
                if text_width(line, SUBTITLE) + text_width(word, SUBTITLE)
                    < WIDTH - 2.0 * MARGIN - SUBTITLE =>
            {
                *line += " ";
                *line += word;
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The sample beside a name in the legend.
#[derive(Clone, Copy)]
enum LegendSign {
    Series(Look, Stroke),
    Category(Look),
    Mark,
}

/// Returns names and samples of the figure, each name once, in rows that fit into the width.
fn legend_rows(figure: &Figure) -> Vec<Vec<(&str, LegendSign)>> {
    let mut all: Vec<(&str, LegendSign)> = Vec::new();
    for panel in &figure.panels {
        let categories = panel.regions.iter().flat_map(|r| &r.categories);
        all.extend(categories.map(|c| (c.name.as_str(), LegendSign::Category(c.look))));
        let signs = panel.series.iter().map(|s| (s, LegendSign::Series(s.look, s.stroke)));
        all.extend(signs.map(|(s, sign)| (s.name.as_str(), sign)));
    }
    let marks = figure.panels.iter().flat_map(|panel| &panel.marks);
    all.extend(marks.map(|mark| (mark.name.as_str(), LegendSign::Mark)));
    let mut rows: Vec<Vec<(&str, LegendSign)>> = Vec::new();
    let mut left = 0.0;
    for entry in all {
        if entry.0.is_empty() || rows.iter().flatten().any(|(name, _)| *name == entry.0) {
            continue;
        }
        left -= entry_width(entry.0);
        match rows.last_mut() {
            Some(row) if left >= 0.0 => row.push(entry),
            _ => {
                left = WIDTH - 2.0 * MARGIN - entry_width(entry.0);
                rows.push(vec![entry]);
            }
        }
    }
    rows
}

fn entry_width(name: &str) -> f64 {
    SAMPLE.iter().sum::<f64>() + text_width(name, TICK)
}

/// SVG in the making.
struct Drawing(String);

impl Drawing {
    fn put(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.0, "{element}");
    }

    /// Writes text with its anchor (`start`, `middle` or `end`) on the base line at `x`, `y`.
    fn text(&mut self, text: &str, size: f64, anchor: &str, (x, y): Pixel, colour: &str) {
        let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        self.put(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" \
             fill=\"{colour}\">{text}</text>"
        ));
    }

    fn rectangle(&mut self, a: Pixel, b: Pixel, colour: &str) {
        let (x, y, w, h) = (a.0.min(b.0), a.1.min(b.1), (a.0 - b.0).abs(), (a.1 - b.1).abs());
        self.put(format_args!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"{colour}\" \
             shape-rendering=\"crispEdges\"/>"
        ));
    }

    fn line(&mut self, points: &[Pixel], width: f64, colour: &str, more: &str) {
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        self.put(format_args!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{more}/>",
            points.join(" ")
        ));
    }

    /// Draws the marker of `look` with a radius of `r` pixels.
    fn marker(&mut self, (x, y): Pixel, look: Look, r: f64) {
        let (path, filled) = look.marker.path();
        let colour = look.colour();
        let (fill, stroke) = if filled { (colour.as_str(), "none") } else { ("none", &*colour) };
        self.put(format_args!(
            "<path d=\"{path}\" transform=\"translate({x:.1} {y:.1}) scale({})\" fill=\"{fill}\" \
             stroke=\"{stroke}\" stroke-width=\"{:.1}\"/>",
            r / 10.0,
            // 4 pixels, 3 in a small one.
            if r < 8.0 { 30.0 / r } else { 40.0 / r },
        ));
    }

    /// Draws line and markers through `points`, in panels and in the legend. Points less than
    /// a pixel from the one before are left out of the line.
    fn stroke(&mut self, points: &[Pixel], look: Look, stroke: Stroke) {
        let mut line: Vec<Pixel> = Vec::new();
        for (i, &(x, y)) in points.iter().enumerate() {
            let away = line.last().map_or(f64::INFINITY, |b| (b.0 - x).hypot(b.1 - y));
            if away >= 1.0 || i + 1 == points.len() && away >= DRAWN_PIXELS {
                line.push((x, y));
            }
        }
        let dash = look.dash.map(|(on, off)| format!(" stroke-dasharray=\"{on} {off}\""));
        match stroke {
            // What stays where it is has no line.
            _ if line.len() < 2 => {}
            Stroke::Markers => {}
            Stroke::Front => self.line(&line, 16.0, &look.colour(), " stroke-opacity=\"0.3\""),
            _ => self.line(&line, 4.0, &look.colour(), &dash.unwrap_or_default()),
        }
        if matches!(stroke, Stroke::Markers | Stroke::LineAndMarkers) {
            points.iter().for_each(|&at| self.marker(at, look, 9.0));
        }
    }

    fn category(&mut self, a: Pixel, b: Pixel, look: Look, with_marker: bool) {
        self.rectangle(a, b, &look.colour());
        if with_marker {
            self.marker((a.0.midpoint(b.0), a.1.midpoint(b.1)), look.ink(), 5.0);
        }
    }

    fn legend_row(&mut self, row: &[(&str, LegendSign)], y: f64) {
        let mut x = MARGIN;
        let [width, gap, _] = SAMPLE;
        for &(name, sign) in row {
            let (end, middle) = (x + width, (x + width / 2.0, y));
            match sign {
                LegendSign::Mark => self.marker(middle, Look::BLACK, 15.0),
                LegendSign::Category(look) => {
                    self.category((x + 10.0, y - 15.0), (end - 10.0, y + 15.0), look, true);
                }
                LegendSign::Series(look, stroke) => {
                    if stroke != Stroke::Markers {
                        let line = if stroke == Stroke::Front { stroke } else { Stroke::Line };
                        self.stroke(&[(x, y), (end, y)], look, line);
                    }
                    if matches!(stroke, Stroke::Markers | Stroke::LineAndMarkers) {
                        self.marker(middle, look, 10.0);
                    }
                }
            }
            self.text(name, TICK, "start", (end + gap, y + 0.36 * TICK), BLACK);
            x += entry_width(name);
        }
    }
}

/// A panel at its place in the drawing.
struct Axes<'a> {
    panel: &'a Panel,
    /// Left end of the panel with its labels, pixels.
    edge: f64,
    /// The upper left and the lower right corner of the plotted area.
    corners: [Pixel; 2],
}

impl<'a> Axes<'a> {
    fn new(panel: &'a Panel, (x, y): Pixel, (width, height): Pixel) -> Self {
        let [left, right, above, below] = BESIDE;
        let names = panel.y.scale.longest_name() as f64 * TICK * CHARACTER;
        let above = if panel.title.is_empty() { above } else { above + 42.0 };
        let upper = (x + left.max(names + 30.0), y + above);
        Self { panel, edge: x, corners: [upper, (x + width - right, y + height - below)] }
    }

    /// Returns the pixel of a point within the axes.
    fn pixel(&self, (x, y): (f64, f64)) -> Option<Pixel> {
        let inside = self.panel.x.scale.contains(x) && self.panel.y.scale.contains(y);
        inside.then(|| (self.along(x), self.up(y)))
    }

    fn along(&self, x: f64) -> f64 {
        let [a, b] = self.corners;
        a.0 + self.panel.x.scale.share(x) * (b.0 - a.0)
    }

    fn up(&self, y: f64) -> f64 {
        let [a, b] = self.corners;
        b.1 - self.panel.y.scale.share(y) * (b.1 - a.1)
    }

    fn draw(&self, drawing: &mut Drawing) {
        self.draw_regions(drawing);
        if self.panel.regions.is_none() {
            self.draw_grid(drawing);
        }
        self.draw_labels(drawing);
        let (fronts, others): (Vec<&Series>, Vec<&Series>) =
            self.panel.series.iter().partition(|series| series.stroke == Stroke::Front);
        for series in fronts.into_iter().chain(others) {
            let points: Vec<Pixel> = series.points.iter().filter_map(|&p| self.pixel(p)).collect();
            drawing.stroke(&points, series.look, series.stroke);
        }
        self.panel.marks.iter().for_each(|mark| self.draw_mark(mark, drawing));
    }

    /// Draws lines at the ticks, those with a label darker.
    fn draw_grid(&self, drawing: &mut Drawing) {
        let [a, b] = self.corners;
        let ticks =
            [(Scale::ticks as fn(&Scale) -> Vec<f64>, "#EEEEEE"), (Scale::labelled, "#D6D6D6")];
        for (ticks, colour) in ticks {
            for x in ticks(&self.panel.x.scale).into_iter().map(|x| self.along(x)) {
                drawing.line(&[(x, a.1), (x, b.1)], 2.0, colour, "");
            }
            for y in ticks(&self.panel.y.scale).into_iter().map(|y| self.up(y)) {
                drawing.line(&[(a.0, y), (b.0, y)], 2.0, colour, "");
            }
        }
    }

    fn draw_labels(&self, drawing: &mut Drawing) {
        let [a, b] = self.corners;
        let middle = (a.0.midpoint(b.0), a.1.midpoint(b.1));
        let Panel { title, x, y, .. } = self.panel;
        drawing.line(&[a, (a.0, b.1), b], 2.0, GREY, "");
        for value in x.scale.labelled() {
            let at = self.along(value);
            drawing.line(&[(at, b.1), (at, b.1 + 6.0)], 2.0, GREY, "");
            drawing.text(&x.scale.label(value), TICK, "middle", (at, b.1 + 34.0), BLACK);
        }
        for value in y.scale.labelled() {
            let at = self.up(value);
            drawing.line(&[(a.0 - 6.0, at), (a.0, at)], 2.0, GREY, "");
            let place = (a.0 - 10.0, at + 0.36 * TICK);
            drawing.text(&y.scale.label(value), TICK, "end", place, BLACK);
        }
        drawing.text(title, LABEL, "middle", (middle.0, a.1 - 14.0), BLACK);
        drawing.text(&x.label, LABEL, "middle", (middle.0, b.1 + 82.0), BLACK);
        let place = (self.edge + 24.0, middle.1);
        drawing.put(format_args!("<g transform=\"rotate(-90 {:.1} {:.1})\">", place.0, place.1));
        drawing.text(&y.label, LABEL, "middle", place, BLACK);
        drawing.put(format_args!("</g>"));
    }

    fn draw_mark(&self, mark: &Mark, drawing: &mut Drawing) {
        let Some(at) = self.pixel(mark.at) else { return };
        drawing.marker(at, Look::BLACK, 19.0);
        let [a, b] = self.corners;
        let right = at.0 > a.0.midpoint(b.0);
        let (dx, anchor) = if right { (-26.0, "end") } else { (26.0, "start") };
        let dy = if at.1 < a.1 + 40.0 { 36.0 } else { -18.0 };
        // A white rim keeps the text readable on lines.
        let rim = "<g stroke=\"#FFFFFF\" stroke-width=\"6\" paint-order=\"stroke\">";
        drawing.put(format_args!("{rim}"));
        drawing.text(&mark.text, TICK, anchor, (at.0 + dx, at.1 + dy), BLACK);
        drawing.put(format_args!("</g>"));
    }

    /// Draws the cells, each with the marker of its category if there is room, so that the
    /// map is readable without colours.
    fn draw_regions(&self, drawing: &mut Drawing) {
        let Some(regions) = &self.panel.regions else { return };
        let corner = |p: (f64, f64)| {
            let Panel { x, y, .. } = self.panel;
            (self.along(x.scale.clamp(p.0)), self.up(y.scale.clamp(p.1)))
        };
        for (i, j, [low, high], category) in regions.filled() {
            let (a, b) = (corner(low), corner(high));
            let every = |side: f64| (44.0 / side.abs().max(1.0)).max(1.0) as usize;
            let (columns, rows) = (every(b.0 - a.0), every(b.1 - a.1));
            let with_marker = i % columns == columns / 2 && j % rows == rows / 2;
            drawing.category(a, b, category.look, with_marker);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::chart::Axis;

    /// Draws a line from `a` to `b`; returns its length in pixels.
    fn drawn(a: (f64, f64), b: (f64, f64), ranges: [(f64, f64); 2]) -> f64 {
        let (x, y, panel_height) = equal_scales(ranges[0], ranges[1]);
        let mut panel = Panel::new("", Axis::new("x", x), Axis::new("y", y));
        panel.series.push(Series::new("line", Look::of(0), Stroke::Line, vec![a, b]));
        let (title, subtitle) = ("t".to_owned(), "s".to_owned());
        let drawing =
            svg(&Figure { title, subtitle, columns: 1, panel_height, panels: vec![panel] });
        let line = drawing.lines().find(|l| l.contains("#0072B2")).unwrap();
        let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
        let ends: Vec<f64> =
            points.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
        (ends[2] - ends[0]).hypot(ends[3] - ends[1])
    }

    #[test]
    fn what_stays_where_it_is_has_no_line() {
        let (x, y, panel_height) = equal_scales((-1.0, 1.0), (-1.0, 1.0));
        let mut panel = Panel::new("", Axis::new("x", x), Axis::new("y", y));
        panel.series.push(Series::new("rests", Look::of(0), Stroke::Line, vec![(0.1, 0.1); 3]));
        let (title, subtitle) = ("t".to_owned(), "s".to_owned());
        let drawing =
            svg(&Figure { title, subtitle, columns: 1, panel_height, panels: vec![panel] });
        for line in drawing.lines().filter(|line| line.contains("<polyline")) {
            let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
            let points: BTreeSet<&str> = points.split(' ').collect();
            assert!(points.len() > 1, "{line}");
        }
    }

    #[test]
    fn a_length_is_as_long_along_both_axes() {
        for ranges in [[(-0.2, 0.2), (-0.13, 0.13)], [(-1.0, 1.0), (-9.0, 1.0)]] {
            let along = drawn((0.0, 0.0), (0.1, 0.0), ranges);
            let across = drawn((0.0, 0.0), (0.0, 0.1), ranges);
            assert!((along - across).abs() <= 0.3 && along > 5.0, "{along} and {across}");
        }
    }
}
