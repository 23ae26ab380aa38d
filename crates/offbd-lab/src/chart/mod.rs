//! Charts: measurements with their records, drawings and a table.
//!
//! A chart measures, stores the records together with the machine and the versions, and
//! draws them, as SVG with its text as text, and as PNG. Drawings are described as data
//! ([`Figure`], [`Panel`], [`Series`], [`Regions`]) and drawn by one function, so that all
//! charts share axes, legend, colours and markers.
//!
//! To add a chart: a module here whose `make` returns a [`Chart`], and its name
//! in `crates/offbd-lab-cli/src/chart.rs`.

mod canvas;
pub mod certificate;
mod dash;
pub mod detectors;
mod draw;
mod equal;
mod error;
pub mod estimators;
pub mod fidelity;
mod figure;
mod front;
mod legend;
mod look;
mod machine;
mod marker;
mod raster;
mod regions;
mod scale;
pub mod stability;
mod stroke;
#[cfg(test)]
mod tests;
pub mod work_precision;
mod write;

pub use draw::svg;
pub use equal::equal_scales;
pub use error::ChartError;
pub use figure::{Axis, Figure, Mark, Panel, Series, Stroke};
pub use front::{FrontPoint, front};
pub use look::{Look, Marker};
pub use machine::{Document, Machine, versions};
pub use raster::png;
pub use regions::{Category, Regions};
pub use scale::Scale;
pub use write::{Chart, ChartTable, Effort, write};
