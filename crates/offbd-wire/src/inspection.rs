//! What a recording holds, as `offbd inspect` and a dry run of an import show it.

mod check;
mod motion;

use std::io::{Read, Seek};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::foreign_file::{self, HEAD_BYTES};
use crate::session_csv::COLUMNS;
use crate::session_file::{
    self, ColumnFile, SessionFileError, SessionFormat, SessionRowError, SessionRows, TextKind,
    TextRows,
};
use crate::table::{
    ColumnMapping, CsvError, DecimalSign, Dialect, OpenedTable, TableOptions, find_table, guess,
};
use crate::telemetry::{SampleView, sample_view};
use offbd_core::vocabulary::Sample;

/// Rows by which the motion is compared with the commands. Chosen: half an hour at 100 Hz.
const COMPARED_ROWS: usize = 180_000;

/// Share of rows with the time of the row before that is worth a remark. Chosen: a device that sends
/// some rows twice has fewer.
const MANY_REPEATED: f64 = 0.1;

/// Rows that are shown, and rejected rows that are named.
const SHOWN_ROWS: usize = 5;

/// Points of the motion that is shown. Chosen: more than a picture of a hand's width resolves.
const MOTION_POINTS: usize = 1000;

/// A gap is longer than this many median steps.
const GAP_STEPS: f64 = 5.0;

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct InspectedColumnView {
    /// Number of the column, from 1; `#1` in a mapping.
    pub number: usize,
    /// Its name; null if the table has none.
    pub name: Option<String>,
    /// The column as a mapping names it, in quotes if its name needs them.
    pub written: String,
    /// Its cell in the line of units below the names; null without such a line.
    pub unit: Option<String>,
    /// Its first cells.
    pub values: Vec<String>,
}

/// A quantity of a sample, and where it comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct InspectedQuantityView {
    /// The quantity, such as `x_m`.
    pub quantity: String,
    /// The column and its unit, such as `ball_x/mm`; null if no column is likely to be it.
    pub expression: Option<String>,
    /// Why this column and unit are likely; null if the name of the column or the given mapping
    /// states them. An import needs a guess stated.
    pub reason: Option<String>,
    /// Smallest and largest value in the compared rows, in SI units; null without a value.
    pub from: Option<f64>,
    pub to: Option<f64>,
}

/// Another column or unit of a quantity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MappingChangeView {
    pub quantity: String,
    pub expression: String,
}

/// What contradicts the mapping, or cannot be decided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct InspectionRemarkView {
    pub text: String,
    /// The changes of the mapping that would settle it; empty if nothing does.
    pub changes: Vec<MappingChangeView>,
}

/// The motion of the ball, by some of the samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct InspectedMotionView {
    pub t_s: Vec<f64>,
    pub x_m: Vec<Option<f64>>,
    pub y_m: Vec<Option<f64>>,
}

/// What a recording holds, and how its columns would be read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct InspectionView {
    /// `CSV`, `JSON`, `Parquet`, `Arrow`, `MCAP` or `Excel`.
    pub format: String,
    /// How a text is written: encoding, separator, decimal commas, lines before the table.
    pub layout: Vec<String>,
    /// The columns of the table.
    pub columns: Vec<InspectedColumnView>,
    /// The mapping by which the rows were read, to be given as `columns`; empty if the columns
    /// have the names of the quantities.
    pub mapping: String,
    /// The quantities of a sample, and the columns from which they come.
    pub quantities: Vec<InspectedQuantityView>,
    /// What contradicts the mapping, or cannot be decided.
    pub remarks: Vec<InspectionRemarkView>,
    /// Rows with a time.
    pub rows: u64,
    /// Rows that would be rejected.
    pub rejected: u64,
    /// The first of them, with the reason.
    pub rejections: Vec<String>,
    /// Runs whose clock starts again; each becomes a session.
    pub runs: usize,
    /// First and last time, s; null without rows.
    pub from_s: Option<f64>,
    pub to_s: Option<f64>,
    /// Rows a second, by the median step; null without two rows.
    pub rate_hz: Option<f64>,
    /// Gaps of more than five median steps, and the longest, s.
    pub gaps: u64,
    pub longest_gap_s: f64,
    /// Share of the rows in which no position is known.
    pub without_ball: f64,
    /// The first samples.
    pub first: Vec<SampleView>,
    /// The motion in the first half hour at 100 Hz, in at most 1000 points.
    pub motion: InspectedMotionView,
}

/// Inspects a recording in any format that is read; `options` maps its columns.
///
/// # Errors
/// [`SessionFileError`] if the file cannot be read or has no rows, or `options` name a
/// column that the file does not have.
pub fn inspect(
    mut source: impl Read + Seek + Send + 'static,
    options: &TableOptions,
) -> Result<InspectionView, SessionFileError> {
    let mut head = Vec::new();
    source.by_ref().take(HEAD_BYTES).read_to_end(&mut head)?;
    source.rewind()?;
    foreign_file::check_own(&head)?;
    let format = SessionFormat::of(&head);
    let mut view = InspectionView { format: format.to_string(), ..InspectionView::default() };
    #[cfg(feature = "xlsx")]
    if format == SessionFormat::Xlsx {
        let sheet = session_file::xlsx::sheet(source)?;
        view.layout.push(format!("the sheet `{}`", sheet.name));
        return inspect_text(view, &TextKind::Text, std::io::Cursor::new(sheet.text), options);
    }
    if format == SessionFormat::Json {
        let table = session_file::json::table(source)?;
        view.layout.push(table.layout.to_owned());
        let kind = table.kind();
        return inspect_text(view, &kind, std::io::Cursor::new(table.text), options);
    }
    if format != SessionFormat::Csv {
        let mut file = session_file::column_file(source, format)?;
        let dialect = Dialect::of_columns(file.columns());
        return inspect_table(view, &dialect, &mut *file, options);
    }
    inspect_text(view, &TextKind::Text, source, options)
}

fn inspect_text(
    mut view: InspectionView,
    kind: &TextKind,
    mut source: impl Read + Seek + Send,
    options: &TableOptions,
) -> Result<InspectionView, SessionFileError> {
    let table = find_table(&mut source)?;
    if table.dialect.first_rows.is_empty() {
        return Err(CsvError::NoRows.into());
    }
    layout(&mut view, &table);
    let dialect = table.dialect.clone();
    drop(table);
    inspect_table(view, &dialect, &mut Text { kind, source }, options)
}

/// A table that is read more than once.
trait Reopened {
    /// Opens the rows by `options`.
    fn rows(&mut self, options: &TableOptions) -> Result<TextRows<'_>, SessionFileError>;
}

struct Text<'a, S> {
    kind: &'a TextKind,
    source: S,
}

impl<S: Read + Seek + Send> Reopened for Text<'_, S> {
    fn rows(&mut self, options: &TableOptions) -> Result<TextRows<'_>, SessionFileError> {
        self.source.rewind()?;
        TextRows::new(self.kind.clone(), &mut self.source, options)
    }
}

impl Reopened for dyn ColumnFile {
    fn rows(&mut self, options: &TableOptions) -> Result<TextRows<'_>, SessionFileError> {
        ColumnFile::rows(self, options)
    }
}

fn inspect_table(
    mut view: InspectionView,
    dialect: &Dialect,
    table: &mut (impl Reopened + ?Sized),
    options: &TableOptions,
) -> Result<InspectionView, SessionFileError> {
    columns(&mut view, dialect);
    let options = &options.of_table(dialect);
    let (mut mapping, mut guesses) = guess::mapping(dialect, &options.columns);
    let mut rate_hz = options.rate_hz;
    if mapping.expressions[0].is_none() && rate_hz.is_none() {
        view.remark("there is no time; give the rate, in rows a second");
        rate_hz = Some(1.0);
    }
    let counts = guess::counts(dialect, &mapping);
    if let Some(first) = counts.first() {
        let all = counts.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        view.remark(format!(
            "pixels and counts need a factor and an offset, such as `x_m={first}*0.0005-0.16`: {all}"
        ));
    }
    let mut read = read_table(&mut view, table, &mapping, rate_hz)?;
    let before = mapping.clone();
    check::by_motion(&mut view, &dialect.names, &mut mapping, &mut guesses, &read.samples);
    if mapping != before {
        view.forget_rows();
        read = read_table(&mut view, table, &mapping, rate_hz)?;
    }
    if !(options.columns.is_empty() && guesses.is_empty()) {
        view.mapping = mapping.with_names(&dialect.names).to_string();
    }
    show(&mut view, &read, |quantity| {
        let guess = guesses.iter().find(|guess| guess.quantity == quantity);
        let expression = mapping.expressions[quantity].as_ref();
        let text = expression.map(|e| e.with_names(&dialect.names).text(quantity));
        (text, guess.map(|guess| guess.reason.clone()))
    });
    Ok(view)
}

impl InspectionView {
    fn remark(&mut self, text: impl Into<String>) {
        self.remarks.push(InspectionRemarkView { text: text.into(), changes: Vec::new() });
    }

    /// Forgets what was read of the rows, which are read once more.
    fn forget_rows(&mut self) {
        let Self { format, layout, columns, mapping, remarks, .. } = std::mem::take(self);
        *self = Self { format, layout, columns, mapping, remarks, ..Self::default() };
    }
}

/// Rows as they are read.
#[derive(Default)]
struct ReadRows {
    /// The first [`COMPARED_ROWS`] samples of the first run.
    samples: Vec<Sample>,
    /// Smallest and largest value of each of the [`COLUMNS`], of all rows.
    ranges: [Option<(f64, f64)>; COLUMNS.len()],
}

impl ReadRows {
    fn add(&mut self, sample: Sample, is_compared: bool) {
        let Sample { t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m, .. } = sample;
        let values = [Some(t_s), cmd_qx_rad, cmd_qy_rad, x_m, y_m];
        for (range, value) in self.ranges.iter_mut().zip(values) {
            let Some(value) = value else { continue };
            let (from, to) = range.unwrap_or((value, value));
            *range = Some((from.min(value), to.max(value)));
        }
        if is_compared && self.samples.len() < COMPARED_ROWS {
            self.samples.push(sample);
        }
    }
}

/// Reads the rows of a table by `mapping`; no sample if a column is missing.
fn read_table(
    view: &mut InspectionView,
    table: &mut (impl Reopened + ?Sized),
    mapping: &ColumnMapping,
    rate_hz: Option<f64>,
) -> Result<ReadRows, SessionFileError> {
    let options = TableOptions { columns: mapping.clone(), rate_hz, ..TableOptions::default() };
    match table.rows(&options) {
        Ok(mut rows) => read(view, &mut rows),
        Err(SessionFileError::Csv(CsvError::MissingColumn { name, .. })) => {
            view.remark(format!("no column is likely to be `{name}`; map one"));
            Ok(ReadRows::default())
        }
        Err(error) => Err(error),
    }
}

/// Shows the quantities of the rows, each with its expression and the reason of a guess, and the
/// motion.
fn show(
    view: &mut InspectionView,
    ReadRows { samples, ranges }: &ReadRows,
    stated: impl Fn(usize) -> (Option<String>, Option<String>),
) {
    for (quantity, name) in COLUMNS.into_iter().enumerate() {
        let (expression, reason) = stated(quantity);
        let (from, to) = ranges[quantity].unzip();
        view.quantities.push(InspectedQuantityView {
            quantity: name.to_owned(),
            expression,
            reason,
            from,
            to,
        });
    }
    for sample in samples.iter().step_by(samples.len().div_ceil(MOTION_POINTS).max(1)) {
        view.motion.t_s.push(sample.t_s);
        view.motion.x_m.push(sample.x_m);
        view.motion.y_m.push(sample.y_m);
    }
}

fn layout(view: &mut InspectionView, table: &OpenedTable<'_>) {
    let dialect = &table.dialect;
    let separator = match dialect.separator {
        b',' => "commas",
        b';' => "semicolons",
        b'\t' => "tabs",
        b' ' => "blanks",
        _ => "vertical bars",
    };
    if view.layout.is_empty() {
        // The library writes this name in small letters.
        let encoding = table.encoding.replace("windows", "Windows");
        view.layout.push(format!("{encoding}, separated by {separator}"));
    }
    if dialect.decimal == DecimalSign::Comma {
        view.layout.push("decimal commas".to_owned());
    }
    if dialect.n_preamble > 0 {
        let lines = match dialect.n_preamble {
            1 => "a line before the table is skipped".to_owned(),
            n => format!("{n} lines before the table are skipped"),
        };
        view.layout.push(lines);
    }
    if let Some(mark) = dialect.comment {
        view.layout.push(format!("lines that begin with {} are comments", char::from(mark)));
    }
    if dialect.names.is_empty() {
        view.layout.push("the columns have no names".to_owned());
    }
}

fn columns(view: &mut InspectionView, dialect: &Dialect) {
    view.columns = (0..dialect.n_columns())
        .map(|i| InspectedColumnView {
            number: i + 1,
            name: dialect.names.get(i).cloned(),
            written: guess::name(dialect, i).to_string(),
            unit: dialect.units.get(i).cloned(),
            values: dialect
                .first_rows
                .iter()
                .take(3)
                .filter_map(|row| row.get(i).cloned())
                .collect(),
        })
        .collect();
}

/// The steps of the time from row to row.
#[derive(Default)]
struct Steps {
    first: Vec<f64>,
    median_s: Option<f64>,
    n_gaps: u64,
    longest_s: f64,
}

/// Steps of which the median is taken. Chosen: ten seconds at 100 Hz.
const MEDIAN_STEPS: usize = 1000;

impl Steps {
    fn add(&mut self, step: f64) {
        if step <= 0.0 {
            return;
        }
        match self.median_s {
            None => {
                self.first.push(step);
                if self.first.len() == MEDIAN_STEPS {
                    self.settle();
                }
            }
            Some(median) if step > GAP_STEPS * median => {
                self.n_gaps += 1;
                self.longest_s = self.longest_s.max(step);
            }
            Some(_) => {}
        }
    }

    /// Takes the median, and counts the gaps so far.
    fn settle(&mut self) {
        let mut first = std::mem::take(&mut self.first);
        let mut sorted = first.clone();
        sorted.sort_by(f64::total_cmp);
        self.median_s = sorted.get(sorted.len() / 2).copied();
        for step in first.drain(..) {
            self.add(step);
        }
    }
}

/// Counts the rows.
fn read(
    view: &mut InspectionView,
    rows: &mut dyn SessionRows,
) -> Result<ReadRows, SessionFileError> {
    let mut read = ReadRows::default();
    let (mut n_blind, mut n_repeated, mut steps) = (0_u64, 0_u64, Steps::default());
    while let Some(row) = rows.next() {
        let sample = match row {
            Err(SessionRowError::Unreadable(error)) => return Err(error),
            Err(SessionRowError::Rejected(row)) => {
                view.rejected += 1;
                if view.rejections.len() < SHOWN_ROWS {
                    view.rejections.push(row.to_string());
                }
                continue;
            }
            Ok(sample) => sample,
        };
        view.rows += 1;
        n_blind += u64::from(sample.x_m.is_none() && sample.y_m.is_none());
        view.from_s.get_or_insert(sample.t_s);
        if let Some(last) = view.to_s.replace(sample.t_s) {
            steps.add(sample.t_s - last);
            n_repeated += u64::from(sample.t_s == last);
        }
        if view.first.len() < SHOWN_ROWS {
            view.first.push(sample_view(&sample));
        }
        read.add(sample, rows.n_runs() == 1);
    }
    if steps.median_s.is_none() {
        steps.settle();
    }
    view.runs = rows.n_runs();
    view.without_ball = if view.rows > 0 { n_blind as f64 / view.rows as f64 } else { 0.0 };
    view.rate_hz = steps.median_s.map(|median| 1.0 / median);
    (view.gaps, view.longest_gap_s) = (steps.n_gaps, steps.longest_s);
    if n_repeated as f64 > MANY_REPEATED * view.rows as f64 {
        let n = view.rows;
        view.remark(format!(
            "{n_repeated} of {n} rows have the time of the row before and would be rejected; if the \
             clock is coarser than the rows, leave it out with `t_s=none` and give the rate"
        ));
    }
    Ok(read)
}

#[cfg(test)]
mod tests;
