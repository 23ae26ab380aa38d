//! Descriptions of drawings: panels with series, marks and regions.

use super::look::Look;
use super::regions::Regions;
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
