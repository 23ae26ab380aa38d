//! Which columns of a table the quantities of a sample come from.

use super::cell::{self, DecimalSign};
use super::dialect::Dialect;
use super::expression::{ColumnMapping, ColumnName, Expression, MappingError, Term};
use super::rows::Cells;
use super::{CsvError, TableOptions, guess, own_names};
use crate::session_csv::COLUMNS;

/// The quantities of an axis, as indices in [`COLUMNS`].
pub(crate) struct Axis {
    pub(crate) word: &'static str,
    pub(crate) command: usize,
    pub(crate) position: usize,
    /// The sign of the acceleration for a positive command: +qy moves the ball toward +x, +qx
    /// toward -y.
    pub(crate) sign: f64,
}

pub(crate) const AXES: [Axis; 2] = [
    Axis { word: "x", command: 2, position: 3, sign: 1.0 },
    Axis { word: "y", command: 1, position: 4, sign: -1.0 },
];

/// How a time is written, for one that is not a number.
const TIME_ADVICE: &str = "; a time is in seconds, or as 2026-02-20 13:51:00.25 in all rows";

/// A column with its factor, or a constant.
#[derive(Clone, Debug, PartialEq)]
struct BoundTerm {
    column: Option<usize>,
    factor: f64,
}

/// The sum of columns that is a quantity.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BoundColumns {
    terms: Vec<BoundTerm>,
    /// The quantity, which an error names.
    name: &'static str,
}

impl BoundColumns {
    /// The factor of the column and the sum of the constants, if it is one column with constants.
    pub(super) fn line(&self) -> Option<(f64, f64)> {
        let mut columns = self.terms.iter().filter(|term| term.column.is_some());
        let constants = self.terms.iter().filter(|term| term.column.is_none());
        match (columns.next(), columns.next()) {
            (Some(column), None) => Some((column.factor, constants.map(|term| term.factor).sum())),
            _ => None,
        }
    }

    /// Returns the value in `cells`; `None` if a column of it is missing.
    ///
    /// # Errors
    /// The reason why it is not a number.
    pub(super) fn value(&self, cells: &Cells, sign: DecimalSign) -> Result<Option<f64>, String> {
        let mut sum: Option<f64> = None;
        for BoundTerm { column, factor } in &self.terms {
            let value = match column {
                None => *factor,
                Some(column) => {
                    let value = match cells.number(*column) {
                        Some(value) => value,
                        None => match self.parsed(cells, *column, sign)? {
                            Some(value) => value,
                            None => return Ok(None),
                        },
                    };
                    // A factor of 1 keeps the bits of the number.
                    if *factor == 1.0 { value } else { value * factor }
                }
            };
            sum = Some(sum.map_or(value, |sum| sum + value));
        }
        Ok(sum)
    }

    /// Parses a cell of text.
    fn parsed(
        &self,
        cells: &Cells,
        column: usize,
        sign: DecimalSign,
    ) -> Result<Option<f64>, String> {
        let bytes = cells.get(column).ok_or_else(|| format!("no field `{}`", self.name))?;
        cell::parse(bytes, sign).map_err(|reason| {
            let advice = if self.name == COLUMNS[0] { TIME_ADVICE } else { "" };
            format!("`{}`: {reason}{advice}", self.name)
        })
    }

    fn columns(&self) -> impl Iterator<Item = usize> {
        self.terms.iter().filter_map(|term| term.column)
    }
}

/// Where the time comes from.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TimeSource {
    /// A sum of columns; with one column alone its factor, which a counter that wraps needs.
    Columns(BoundColumns),
    /// Dates and times of day, which are added.
    Moments(Vec<usize>),
    /// The number of the row times this, s.
    Rows(f64),
}

/// The columns of all quantities.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BoundMapping {
    pub(super) time: TimeSource,
    /// In the order of [`COLUMNS`] without the time.
    pub(super) quantities: [Option<BoundColumns>; COLUMNS.len() - 1],
    pub(super) seq: Option<usize>,
    /// Whether somebody has said which columns are read.
    pub(super) is_given: bool,
}

impl BoundMapping {
    /// Finds the columns that `options` map, and those with the name of a quantity.
    ///
    /// # Errors
    /// [`CsvError`] if a column is missing.
    pub(super) fn new(dialect: &Dialect, options: &TableOptions) -> Result<Self, CsvError> {
        let mapping = own_names::with_own_names(&options.columns, dialect)?;
        let missing = |quantity: usize| CsvError::MissingColumn {
            name: COLUMNS[quantity],
            found: guess::listed(dialect),
            proposal: guess::proposal(dialect, &options.columns),
        };
        let bound = |quantity: usize| -> Result<Option<BoundColumns>, CsvError> {
            let expression = mapping.expressions[quantity].as_ref();
            let expression = expression.filter(|e| !e.terms.is_empty());
            expression.map(|e| bind(dialect, COLUMNS[quantity], e)).transpose()
        };
        let time = bound(0)?;
        let quantities = [bound(1)?, bound(2)?, bound(3)?, bound(4)?];
        // A quantity that is left out is not missing.
        let is_mapped = |quantity: usize| mapping.expressions[quantity].is_some();
        if time.is_none() && options.rate_hz.is_none() {
            return Err(missing(0));
        }
        for axis in &AXES {
            if let [Some(absent), None] | [None, Some(absent)] =
                [axis.command, axis.position].map(|q| (!is_mapped(q)).then_some(q))
            {
                return Err(missing(absent));
            }
        }
        if AXES.iter().all(|axis| !is_mapped(axis.command)) {
            return Err(missing(AXES[1].command));
        }
        if quantities.iter().all(Option::is_none) {
            return Err(missing(AXES[0].position));
        }
        let time = match (time, options.rate_hz) {
            (Some(columns), _) => time_source(dialect, columns),
            (None, rate) => TimeSource::Rows(1.0 / rate.unwrap_or(1.0)),
        };
        let is_given = !options.columns.is_empty();
        Ok(Self { time, quantities, seq: own_names::find(dialect, "seq")?, is_given })
    }

    /// The columns that are read.
    pub(super) fn columns(&self) -> Vec<usize> {
        let mut columns: Vec<usize> = match &self.time {
            TimeSource::Columns(columns) => columns.columns().collect(),
            TimeSource::Moments(columns) => columns.clone(),
            TimeSource::Rows(_) => Vec::new(),
        };
        columns.extend(self.quantities.iter().flatten().flat_map(BoundColumns::columns));
        columns.extend(self.seq);
        columns.sort_unstable();
        columns.dedup();
        columns
    }
}

/// Whether `mapping` is for a table: it has all columns that the mapping names. Numbers of columns
/// are not for a table with the names of the quantities, whose columns are in another order.
pub(super) fn has_all(dialect: &Dialect, mapping: &ColumnMapping) -> bool {
    let is_here = |name: &ColumnName| match name {
        ColumnName::Number(_) => !dialect.has_own_names() && places(dialect, name).count() > 0,
        ColumnName::Name(_) => places(dialect, name).count() > 0,
    };
    let mut terms = mapping.expressions.iter().flatten().flat_map(|e| &e.terms);
    terms.all(|term| term.column.as_ref().is_none_or(is_here))
}

/// Returns where columns of this name are: those with the same letters, else those that differ in
/// their case.
fn places<'a>(dialect: &'a Dialect, name: &'a ColumnName) -> impl Iterator<Item = usize> + 'a {
    let is_exact = matches!(name, ColumnName::Name(name) if dialect.names.contains(name));
    let is_it = move |column: usize| match name {
        ColumnName::Number(number) => number - 1 == column,
        ColumnName::Name(name) => dialect.names.get(column).is_some_and(|other| {
            if is_exact { other == name } else { other.eq_ignore_ascii_case(name) }
        }),
    };
    (0..dialect.n_columns()).filter(move |column| is_it(*column))
}

/// Finds the columns of an expression.
fn bind(
    dialect: &Dialect,
    quantity: &'static str,
    expression: &Expression,
) -> Result<BoundColumns, CsvError> {
    let column = |name: &ColumnName| -> Result<usize, CsvError> {
        let mut places = places(dialect, name);
        let place = places.next();
        if let (Some(first), Some(second)) = (place, places.next()) {
            let reason =
                format!("is the name of two columns; write #{} or #{}", first + 1, second + 1);
            return Err(MappingError::new(name, reason).into());
        }
        place.ok_or_else(|| {
            let reason = match guess::nearest(dialect, name) {
                Some(near) => format!(
                    "is not a column of the file; the nearest is `{near}`, of {}",
                    guess::listed(dialect)
                ),
                None => {
                    format!("is not a column of the file, which has {}", guess::listed(dialect))
                }
            };
            MappingError::new(name, reason).into()
        })
    };
    let bound = |Term { column: name, factor }: &Term| {
        let column = name.as_ref().map(&column).transpose()?;
        Ok(BoundTerm { column, factor: *factor })
    };
    let terms = expression.terms.iter().map(bound).collect::<Result<Vec<_>, CsvError>>()?;
    Ok(BoundColumns { terms, name: quantity })
}

/// The time is a date if the first value of each of its columns is one.
fn time_source(dialect: &Dialect, columns: BoundColumns) -> TimeSource {
    let indices: Option<Vec<usize>> =
        columns.terms.iter().map(|term| term.column.filter(|_| term.factor == 1.0)).collect();
    let is_moment = |i: &usize| guess::first_value(dialect, *i).is_some_and(cell::is_moment);
    match indices.filter(|indices| indices.iter().all(is_moment)) {
        Some(indices) => TimeSource::Moments(indices),
        None => TimeSource::Columns(columns),
    }
}
