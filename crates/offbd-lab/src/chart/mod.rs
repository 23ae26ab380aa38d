//! Charts: measurements with their records, drawings and a table.
//!
//! A chart measures, stores the records together with the machine and the versions, and
//! draws them, as SVG with its text as text, and as PNG. Drawings are described as data
//! ([`Figure`], [`Panel`], [`Series`], [`Regions`]) and drawn by one function, so that all
//! charts share axes, legend, colours and markers.
//!
//! To add a chart: a module here whose `make` returns a [`Chart`], and its name
//! in `crates/offbd-lab-cli/src/chart.rs`.

pub mod certificate;
pub mod detectors;
mod draw;
mod error;
pub mod estimators;
pub mod fidelity;
mod figure;
mod front;
mod look;
mod machine;
mod raster;
mod scale;
pub mod stability;
#[cfg(test)]
mod tests;
pub mod work_precision;
mod write;

pub use draw::{equal_scales, svg};
pub use error::ChartError;
pub use figure::{Axis, Category, Figure, Mark, Panel, Regions, Series, Stroke};
pub use front::{FrontPoint, front};
pub use look::{Look, Marker};
pub use machine::{Document, Machine, versions};
pub use raster::png;
pub use scale::Scale;
pub use write::{Chart, ChartTable, Effort, write};
