//! A chart and its files.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::draw::svg;
use super::error::ChartError;
use super::figure::Figure;
use super::machine::{Document, Machine, versions};
use super::raster::png;

/// The extent of a measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// All points, for publication.
    #[default]
    Full,
    /// A few points, to test that the chart works.
    Quick,
}

/// A measured chart: its records, figures and table.
#[derive(Clone, Debug)]
pub struct Chart {
    /// The stem of the file names.
    pub name: &'static str,
    /// The records, serialised from the chart's own type.
    pub records: Vec<Value>,
    /// The figures with a suffix each. The first is written as `NAME.svg` and `NAME.png`,
    /// the others as `NAME-SUFFIX.svg` and `NAME-SUFFIX.png`.
    pub figures: Vec<(&'static str, Figure)>,
    pub table: ChartTable,
    /// Versions of other programs measured.
    pub versions: Vec<(String, String)>,
}

/// A short table for the terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ChartTable {
    pub heading: Vec<&'static str>,
    /// Indices of the right-aligned columns.
    pub right: Vec<usize>,
    pub rows: Vec<Vec<String>>,
}

/// Writes records and drawings into `dir`, which is created if missing; returns the files.
///
/// # Errors
/// [`ChartError`] if a figure cannot be rasterised or a file cannot be written.
pub fn write(chart: &Chart, dir: &Path) -> Result<Vec<PathBuf>, ChartError> {
    let failed = |source| ChartError::File { path: dir.to_owned(), source };
    std::fs::create_dir_all(dir).map_err(failed)?;
    let mut written = vec![put(dir, &format!("{}.json", chart.name), &records(chart)?)?];
    for (i, (word, figure)) in chart.figures.iter().enumerate() {
        let dash = if i == 0 { String::new() } else { format!("-{word}") };
        let drawing = svg(figure);
        let name = |ending| format!("{}{dash}.{ending}", chart.name);
        written.push(put(dir, &name("svg"), drawing.as_bytes())?);
        written.push(put(dir, &name("png"), &png(&drawing)?)?);
    }
    Ok(written)
}

fn records(chart: &Chart) -> Result<Vec<u8>, ChartError> {
    let mut versions = versions();
    versions.extend(chart.versions.iter().cloned());
    let document = Document {
        chart: chart.name.to_owned(),
        machine: Machine::this(),
        versions,
        records: chart.records.clone(),
    };
    let mut text = serde_json::to_vec_pretty(&document)?;
    text.push(b'\n');
    Ok(text)
}

fn put(dir: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, ChartError> {
    let path = dir.join(name);
    match std::fs::write(&path, bytes) {
        Ok(()) => Ok(path),
        Err(source) => Err(ChartError::File { path, source }),
    }
}
