//! What a recording holds, as `offbd inspect` and a dry run of an import show it.

use std::io::{Read, Seek};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::columns::{AXES, Axis};
use super::expression::{ColumnMapping, Dimension};
use super::guess::{self, Guess};
use super::motion::{self, ASKED_M_S2, Motion};
use super::{CsvError, OpenedTable, TableOptions, TableReader, find_table};
use crate::session_csv::COLUMNS;
use crate::session_file::{
    self, CsvRows, HEAD_BYTES, SessionFileError, SessionFormat, SessionRowError, SessionRows,
};
use crate::telemetry::{SampleView, sample_view};
use offbd_core::vocabulary::Sample;

/// Rows by which the motion is compared with the commands. Chosen: half an hour at 100 Hz.
const COMPARED_ROWS: usize = 180_000;

/// Rows that are shown, and rejected rows that are named.
const SHOWN_ROWS: usize = 5;

/// A gap is longer than this many median steps.
const GAP_STEPS: f64 = 5.0;

/// Smallest correlation by which the motion decides a sign, an axis or a unit. Chosen: below it
/// more than three quarters of the motion has another cause.
const MIN_CORRELATION: f64 = 0.5;

/// The motion contradicts the units beyond this factor. Chosen: a servo's lever or a hollow ball
/// stays within it, a unit does not.
const UNIT_FACTOR: f64 = 2.2;

/// Lengths and angles that a rig has, m and rad: the largest value of a recording lies between
/// them. Chosen.
const USUAL_M: (f64, f64) = (0.003, 1.5);
const USUAL_RAD: (f64, f64) = (0.003, 1.6);

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ColumnView {
    /// Number of the column, from 1; `#1` in a mapping.
    pub number: usize,
    /// Its name; null if the table has none.
    pub name: Option<String>,
    /// What the line of units below the names says of it; null without such a line.
    pub unit: Option<String>,
    /// Its first cells.
    pub values: Vec<String>,
}

/// A part of a mapping that was guessed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GuessView {
    /// The quantity, such as `x_m`.
    pub quantity: String,
    /// The column and its unit, such as `ball_x/mm`.
    pub expression: String,
    /// Why.
    pub reason: String,
}

/// What a recording holds, and how its columns would be read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct InspectionView {
    /// `CSV`, `Parquet`, `Arrow`, `MCAP` or `Excel`.
    pub format: String,
    /// How a text is written: encoding, separator, decimal commas, lines before the table.
    pub layout: Vec<String>,
    /// The columns of a text.
    pub columns: Vec<ColumnView>,
    /// The mapping by which the rows were read, to be given as `columns`; empty if the columns
    /// have the names of the quantities.
    pub mapping: String,
    /// The parts of the mapping that were guessed; an import needs them stated.
    pub guessed: Vec<GuessView>,
    /// What contradicts the mapping, or cannot be decided.
    pub remarks: Vec<String>,
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
}

/// Inspects a recording in any format that is read; `options` maps columns of a text.
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
    let format = SessionFormat::of(&head);
    let mut view = InspectionView { format: format.to_string(), ..InspectionView::default() };
    if format != SessionFormat::Csv {
        read(&mut view, &mut *session_file::open(source, Some(format), options)?)?;
        return Ok(view);
    }
    let table = find_table(&mut source)?;
    if table.dialect.first_rows.is_empty() {
        return Err(CsvError::NoRows.into());
    }
    layout(&mut view, &table);
    let (mut mapping, mut guesses) = guess::mapping(&table.dialect, &options.columns);
    let dialect = table.dialect.clone();
    drop(table);
    let mut rate_hz = options.rate_hz;
    if mapping.expressions[0].is_none() && rate_hz.is_none() {
        view.remarks.push("there is no time; give the rate, in rows a second".to_owned());
        rate_hz = Some(1.0);
    }
    let own = TableOptions { columns: mapping.clone(), rate_hz };
    source.rewind()?;
    let samples = match TableReader::recording(&mut source, &own) {
        Ok(rows) => read(&mut view, &mut CsvRows(rows))?,
        Err(CsvError::MissingColumn { name, .. }) => {
            view.remarks.push(format!("no column is likely to be `{name}`; map one"));
            Vec::new()
        }
        Err(error) => return Err(error.into()),
    };
    let largest = |value: fn(&Sample) -> Option<f64>| {
        samples.iter().filter_map(value).fold(0.0, |most: f64, value| most.max(value.abs()))
    };
    let largest = [
        0.0,
        largest(|s| s.cmd_qx_rad),
        largest(|s| s.cmd_qy_rad),
        largest(|s| s.x_m),
        largest(|s| s.y_m),
    ];
    let motion = motion::compare(&samples);
    let (to, by) = (&mut view, &mut mapping);
    Check { view: to, mapping: by, guesses: &mut guesses, motion, largest }.run();
    let is_stated = options.columns.is_empty() && guesses.is_empty();
    if !is_stated {
        view.mapping = mapping.with_names(&dialect.names).to_string();
    }
    view.guessed =
        guesses.iter().map(|guess| guess_view(guess, &mapping, &dialect.names)).collect();
    Ok(view)
}

fn guess_view(guess: &Guess, mapping: &ColumnMapping, names: &[String]) -> GuessView {
    let mut one = ColumnMapping::default();
    one.expressions[guess.quantity].clone_from(&mapping.expressions[guess.quantity]);
    let text = one.with_names(names).to_string();
    let expression = text.split_once('=').map_or("", |(_, expression)| expression).to_owned();
    let quantity = COLUMNS[guess.quantity].to_owned();
    GuessView { quantity, expression, reason: guess.reason.clone() }
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
    view.layout.push(format!("{}, separated by {separator}", table.encoding));
    if dialect.has_decimal_commas {
        view.layout.push("decimal commas".to_owned());
    }
    if dialect.n_preamble > 0 {
        view.layout.push(format!("{} lines before the table are skipped", dialect.n_preamble));
    }
    if let Some(mark) = dialect.comment {
        view.layout.push(format!("lines that begin with {} are comments", char::from(mark)));
    }
    if dialect.names.is_empty() {
        view.layout.push("the columns have no names".to_owned());
    }
    view.columns = (0..dialect.n_columns())
        .map(|i| ColumnView {
            number: i + 1,
            name: dialect.names.get(i).cloned(),
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

/// Counts the rows; returns the first [`COMPARED_ROWS`] samples of the first run.
fn read(
    view: &mut InspectionView,
    rows: &mut dyn SessionRows,
) -> Result<Vec<Sample>, SessionFileError> {
    let mut samples: Vec<Sample> = Vec::new();
    let (mut n_blind, mut steps) = (0_u64, Steps::default());
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
        }
        if view.first.len() < SHOWN_ROWS {
            view.first.push(sample_view(&sample));
        }
        if samples.len() < COMPARED_ROWS && rows.n_runs() == 1 {
            samples.push(sample);
        }
    }
    if steps.median_s.is_none() {
        steps.settle();
    }
    view.runs = rows.n_runs();
    view.without_ball = if view.rows > 0 { n_blind as f64 / view.rows as f64 } else { 0.0 };
    view.rate_hz = steps.median_s.map(|median| 1.0 / median);
    (view.gaps, view.longest_gap_s) = (steps.n_gaps, steps.longest_s);
    Ok(samples)
}

/// A table whose mapping is compared with the motion.
struct Check<'a> {
    view: &'a mut InspectionView,
    mapping: &'a mut ColumnMapping,
    guesses: &'a mut [Guess],
    motion: Motion,
    /// Largest value of each quantity, in the order of [`COLUMNS`].
    largest: [f64; COLUMNS.len()],
}

/// A unit, and the factor by which the values change if they are in it.
type UnitChange = (&'static str, f64);

const REASON: &str = "the motion decides";

impl Check<'_> {
    fn run(&mut self) {
        let correlation = |axis: usize, command: usize| {
            self.motion[axis][command].map_or(0.0, |fit| fit.correlation.abs())
        };
        let own = correlation(0, 1).max(correlation(1, 0));
        let other = correlation(0, 0).max(correlation(1, 1));
        if other > MIN_CORRELATION && other > 2.0 * own {
            self.exchange();
        }
        for (i, axis) in AXES.iter().enumerate() {
            match self.motion[i][axis.command - 1] {
                Some(fit) if fit.correlation.abs() >= MIN_CORRELATION => {
                    if fit.slope * axis.sign < 0.0 {
                        self.negate(axis);
                    }
                    self.units(axis, fit.slope.abs() / ASKED_M_S2);
                }
                Some(_) => self.view.remarks.push(format!(
                    "the motion along {} hardly follows a command: its unit and sign are not checked",
                    axis.word
                )),
                None => {}
            }
        }
    }

    fn guess(&mut self, quantity: usize) -> Option<&mut Guess> {
        self.guesses.iter_mut().find(|guess| guess.quantity == quantity)
    }

    /// Exchanges the commands, if both were guessed.
    fn exchange(&mut self) {
        if self.guess(1).is_none() || self.guess(2).is_none() {
            let remark = "each axis moves as the command of the other one asks: are the commands, \
                or x and y, exchanged?";
            self.view.remarks.push(remark.to_owned());
            return;
        }
        self.mapping.expressions.swap(1, 2);
        self.largest.swap(1, 2);
        for row in &mut self.motion {
            row.swap(0, 1);
        }
        for guess in &mut *self.guesses {
            guess.quantity = [0, 2, 1, 3, 4][guess.quantity];
            if [1, 2].contains(&guess.quantity) {
                guess.reason = REASON.to_owned();
            }
        }
    }

    /// Changes the sign of a command that was guessed.
    fn negate(&mut self, axis: &Axis) {
        let expression = self.mapping.expressions[axis.command].as_mut();
        let found = self.guesses.iter_mut().find(|guess| guess.quantity == axis.command);
        let (Some(expression), Some(guess)) = (expression, found) else {
            self.view.remarks.push(format!(
                "the ball moves along {} against `{}`: is a sign wrong?",
                axis.word, COLUMNS[axis.command]
            ));
            return;
        };
        for term in &mut expression.terms {
            term.factor = -term.factor;
        }
        guess.reason = REASON.to_owned();
    }

    /// Compares the size of the motion, `ratio` of what the commands ask, with other units.
    fn units(&mut self, axis: &Axis, ratio: f64) {
        if ratio.ln().abs() < UNIT_FACTOR.ln() {
            return;
        }
        let best = self.candidates(axis, ratio);
        let Some((position, command)) = best else {
            self.view.remarks.push(format!(
                "the motion along {} is {:.2} of what the commands ask, and no other unit explains \
                 that",
                axis.word, ratio
            ));
            return;
        };
        let mut asked = Vec::new();
        for (quantity, (word, change)) in [(axis.position, position), (axis.command, command)] {
            if change == 1.0 {
                continue;
            }
            let found = self.guesses.iter_mut().find(|guess| guess.quantity == quantity);
            match (found, self.mapping.expressions[quantity].as_mut()) {
                (Some(guess), Some(expression)) => {
                    for term in &mut expression.terms {
                        // By the word, so that the mapping shows it.
                        let mut units = Dimension::of(quantity).units().iter();
                        let si = units.find(|(unit, _)| *unit == word).map_or(1.0, |u| u.1);
                        term.factor = si.copysign(term.factor);
                    }
                    guess.unit = word;
                    guess.reason = REASON.to_owned();
                }
                _ => asked.push(format!("`{}` in {word}", COLUMNS[quantity])),
            }
        }
        if !asked.is_empty() {
            self.view.remarks.push(format!(
                "the motion along {} is {:.2} of what the commands ask: is {}?",
                axis.word,
                ratio,
                asked.join(" and ")
            ));
        }
    }

    /// Returns the units of position and command, each with its change of the values, that explain
    /// the motion best.
    fn candidates(&self, axis: &Axis, ratio: f64) -> Option<(UnitChange, UnitChange)> {
        let changes = |quantity: usize, usual: (f64, f64)| -> Vec<UnitChange> {
            let guess = self.guesses.iter().find(|guess| guess.quantity == quantity);
            let factor =
                self.mapping.expressions[quantity].as_ref().and_then(|e| match &e.terms[..] {
                    [term] => Some(term.factor.abs()),
                    _ => None,
                });
            let is_fixed = guess.is_some_and(Guess::is_stated) || factor.is_none();
            let units = Dimension::of(quantity).units().iter().filter_map(|(word, si)| {
                let change = si / factor?;
                let largest = self.largest[quantity] * change;
                let is_usual = largest >= usual.0 && largest <= usual.1;
                (!is_fixed && is_usual || change == 1.0).then_some((*word, change))
            });
            let found: Vec<_> = units.collect();
            if found.is_empty() { vec![("", 1.0)] } else { found }
        };
        let error = |(position, command): &(UnitChange, UnitChange)| {
            let explained = (ratio * position.1 / command.1).ln().abs();
            // Of two equal explanations the one that changes less.
            explained + 0.1 * f64::from(u8::from(position.1 != 1.0) + u8::from(command.1 != 1.0))
        };
        let commands = changes(axis.command, USUAL_RAD);
        let pairs = changes(axis.position, USUAL_M)
            .into_iter()
            .flat_map(|position| commands.iter().map(move |command| (position, *command)));
        let best = pairs.min_by(|a, b| error(a).total_cmp(&error(b)))?;
        (error(&best) < UNIT_FACTOR.ln()).then_some(best)
    }
}

#[cfg(test)]
mod tests;
