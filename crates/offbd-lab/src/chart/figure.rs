//! Descriptions of drawings: panels with series, marks and regions.

use super::look::Look;
use super::scale::Scale;

/// Several panels under one title, above one legend.
#[derive(Clone, Debug)]
pub struct Figure {
    pub title: String,
    /// One sentence with the conclusion for the reader.
    pub subtitle: String,
    /// Number of panels per row.
    pub columns: usize,
    /// Height of a panel with its labels, in pixels of a drawing 1800 wide.
    pub panel_height: u32,
    pub panels: Vec<Panel>,
}

/// One pair of axes with their contents.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Empty for none.
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    /// Drawn first.
    pub regions: Option<Regions>,
    /// Drawn in order, Pareto fronts before all others. Series of the same name in several
    /// panels share one entry of the legend.
    pub series: Vec<Series>,
    /// Drawn last.
    pub marks: Vec<Mark>,
}

/// An axis: its scale, and its label with the unit.
#[derive(Clone, Debug)]
pub struct Axis {
    pub label: String,
    pub scale: Scale,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    Markers,
    Line,
    LineAndMarkers,
    /// A wide pale line beneath the others, for a Pareto front.
    Front,
}

/// A series of points. Points outside the axes are not drawn.
#[derive(Clone, Debug)]
pub struct Series {
    pub name: String,
    pub look: Look,
    pub stroke: Stroke,
    pub points: Vec<(f64, f64)>,
}

/// A marked point: a black ring, named in the legend, with `text` beside it unless empty.
#[derive(Clone, Debug)]
pub struct Mark {
    pub name: String,
    pub text: String,
    pub at: (f64, f64),
}

impl Panel {
    /// Creates an empty panel.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        let (series, marks) = (Vec::new(), Vec::new());
        Self { title: title.into(), x, y, regions: None, series, marks }
    }
}

impl Axis {
    #[must_use]
    pub fn new(label: impl Into<String>, scale: Scale) -> Self {
        Self { label: label.into(), scale }
    }
}

impl Series {
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        look: Look,
        stroke: Stroke,
        points: Vec<(f64, f64)>,
    ) -> Self {
        Self { name: name.into(), look, stroke, points }
    }
}

/// A category of cells, shown in the legend.
#[derive(Clone, Debug)]
pub struct Category {
    pub name: String,
    pub look: Look,
}

/// A grid of cells. Cell (i, j) spans `x_edges[i]` to `x_edges[i + 1]` and
/// `y_edges[j]` to `y_edges[j + 1]`.
#[derive(Clone, Debug)]
pub struct Regions {
    pub categories: Vec<Category>,
    /// Ascending; one more than there are columns.
    pub x_edges: Vec<f64>,
    /// Ascending; one more than there are rows.
    pub y_edges: Vec<f64>,
    /// Index of the category of cell (i, j) at `j · columns + i`; an index out of range
    /// leaves the cell blank.
    pub cells: Vec<usize>,
}

/// A cell: its column, its row, its corners, and its category.
pub(super) type FilledCell<'a> = (usize, usize, [(f64, f64); 2], &'a Category);

impl Regions {
    /// Creates cells centred on `xs` and `ys` (ascending, positive), with the edges half way
    /// between on logarithmic axes.
    #[must_use]
    pub fn centred_log(
        categories: Vec<Category>,
        xs: &[f64],
        ys: &[f64],
        category: impl Fn(usize, usize) -> usize,
    ) -> Self {
        let cells = (0..ys.len()).flat_map(|j| (0..xs.len()).map(move |i| (i, j)));
        let cells = cells.map(|(i, j)| category(i, j)).collect();
        Self { categories, x_edges: log_edges(xs), y_edges: log_edges(ys), cells }
    }

    pub(super) fn filled(&self) -> impl Iterator<Item = FilledCell<'_>> {
        let columns = self.x_edges.len().saturating_sub(1);
        self.cells.iter().enumerate().filter_map(move |(k, &category)| {
            let (i, j) = (k % columns, k / columns);
            let low = (self.x_edges[i], *self.y_edges.get(j)?);
            let high = (self.x_edges[i + 1], *self.y_edges.get(j + 1)?);
            Some((i, j, [low, high], self.categories.get(category)?))
        })
    }
}

/// Returns the geometric means of neighbours; each outer edge is as far from its centre as
/// the inner edge on the other side.
fn log_edges(centres: &[f64]) -> Vec<f64> {
    let [first, .., last] = centres else {
        let edges = |&c: &f64| vec![c / 2.0, c * 2.0];
        return centres.first().map(edges).unwrap_or_default();
    };
    let inner: Vec<f64> = centres.windows(2).map(|w| (w[0] * w[1]).sqrt()).collect();
    let (low, high) = (first * first / inner[0], last * last / inner[inner.len() - 1]);
    [&[low][..], &inner, &[high]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_of_decades_are_half_decades_away() {
        let edges = log_edges(&[1.0, 10.0, 100.0]);
        for (edge, power) in edges.iter().zip([-0.5, 0.5, 1.5, 2.5]) {
            assert!((edge.log10() - power).abs() < 1e-12, "{edges:?}");
        }
        assert_eq!(log_edges(&[1.0]), [0.5, 2.0]);
    }
}
