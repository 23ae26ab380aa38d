//! A finished chart and its files.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::draw::svg;
use super::error::ChartError;
use super::figure::Figure;
use super::machine::{Document, Machine, versions};
use super::raster::png;

/// How much is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// Everything, as for publishing.
    #[default]
    Full,
    /// A few points, in about a second: to see that it works.
    Quick,
}

/// What a chart's `make` returns.
#[derive(Clone, Debug)]
pub struct Chart {
    /// The stem of its files.
    pub name: &'static str,
    /// Each serialised by the chart's own record type.
    pub records: Vec<Value>,
    /// The first is drawn as `NAME.svg` and `NAME.png`; of the others each as
    /// `NAME-WORD`, by its word.
    pub figures: Vec<(&'static str, Figure)>,
    pub table: Table,
    /// Versions of other programs measured, beside our own.
    pub versions: Vec<(String, String)>,
}

/// A short table for people.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    pub heading: Vec<&'static str>,
    /// Columns of numbers.
    pub right: Vec<usize>,
    pub rows: Vec<Vec<String>>,
}

/// Writes records and drawings into `dir`, made if need be; returns the files.
///
/// # Errors
/// If it cannot be drawn or written.
pub fn write(chart: &Chart, dir: &Path) -> Result<Vec<PathBuf>, ChartError> {
    let failed = |source| ChartError::File { path: dir.to_owned(), source };
    std::fs::create_dir_all(dir).map_err(failed)?;
    let mut written = vec![put(dir, &format!("{}.json", chart.name), &records(chart)?)?];
    for (i, (word, figure)) in chart.figures.iter().enumerate() {
        let dash = if i == 0 { String::new() } else { format!("-{word}") };
        let drawing = svg(figure)?;
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
