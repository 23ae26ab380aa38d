//! Maps: rectangular cells of discrete categories on the axes of a panel.

use super::look::Look;

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
