//! Which columns of a table the quantities of a sample come from.

use super::cell;
use super::dialect::Dialect;
use super::expression::{ColumnMapping, ColumnName, Expression, MappingError, Term};
use super::rows::Cells;
use super::{CsvError, TableOptions, guess};
use crate::session_csv::COLUMNS;

/// The quantities of an axis, as indices in [`COLUMNS`].
pub(super) struct Axis {
    pub(super) word: &'static str,
    pub(super) command: usize,
    pub(super) position: usize,
    /// The sign of the acceleration for a positive command: +qy moves the ball toward +x, +qx
    /// toward -y.
    pub(super) sign: f64,
}

pub(super) const AXES: [Axis; 2] = [
    Axis { word: "x", command: 2, position: 3, sign: 1.0 },
    Axis { word: "y", command: 1, position: 4, sign: -1.0 },
];

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
    /// The factor, if it is one column alone.
    pub(super) fn factor(&self) -> Option<f64> {
        match &self.terms[..] {
            [BoundTerm { column: Some(_), factor }] => Some(*factor),
            _ => None,
        }
    }

    /// Returns the value in `cells`; `None` if a column of it is missing.
    ///
    /// # Errors
    /// The reason why it is not a number.
    pub(super) fn value(
        &self,
        cells: &Cells,
        has_decimal_commas: bool,
    ) -> Result<Option<f64>, String> {
        let mut sum: Option<f64> = None;
        for BoundTerm { column, factor } in &self.terms {
            let value = match column {
                None => *factor,
                Some(column) => {
                    let value = match cells.number(*column) {
                        Some(value) => value,
                        None => match self.parsed(cells, *column, has_decimal_commas)? {
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
        has_decimal_commas: bool,
    ) -> Result<Option<f64>, String> {
        let bytes = cells.get(column).ok_or_else(|| format!("no field `{}`", self.name))?;
        cell::parse(bytes, has_decimal_commas)
            .map_err(|reason| format!("`{}`: {reason}", self.name))
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

/// Returns the mapping with the columns that have the name of a quantity, in any case, where
/// `mapping` says nothing.
///
/// # Errors
/// [`CsvError::DoubleColumn`].
pub(super) fn with_own_names(
    mapping: &ColumnMapping,
    dialect: &Dialect,
) -> Result<ColumnMapping, CsvError> {
    let mut whole = mapping.clone();
    for (slot, name) in whole.expressions.iter_mut().zip(COLUMNS) {
        if slot.is_none()
            && let Some(column) = find(dialect, name)?
        {
            let column = Some(ColumnName::Number(column + 1));
            *slot = Some(Expression { terms: vec![Term { column, factor: 1.0 }] });
        }
    }
    Ok(whole)
}

fn find(dialect: &Dialect, name: &'static str) -> Result<Option<usize>, CsvError> {
    let mut found =
        (0..dialect.names.len()).filter(|i| dialect.names[*i].eq_ignore_ascii_case(name));
    match (found.next(), found.next()) {
        (_, Some(_)) => Err(CsvError::DoubleColumn(name)),
        (first, None) => Ok(first),
    }
}

impl BoundMapping {
    /// Finds the columns that `options` map, and those with the name of a quantity.
    ///
    /// # Errors
    /// [`CsvError`] if a column is missing.
    pub(super) fn new(dialect: &Dialect, options: &TableOptions) -> Result<Self, CsvError> {
        let mapping = with_own_names(&options.columns, dialect)?;
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
        Ok(Self { time, quantities, seq: find(dialect, "seq")?, is_given })
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

/// Whether a table has all columns that `mapping` names.
pub(super) fn has_all(dialect: &Dialect, mapping: &ColumnMapping) -> bool {
    let mut terms = mapping.expressions.iter().flatten().flat_map(|e| &e.terms);
    terms.all(|term| term.column.as_ref().is_none_or(|name| place(dialect, name).is_some()))
}

/// Returns where the column is.
fn place(dialect: &Dialect, name: &ColumnName) -> Option<usize> {
    match name {
        ColumnName::Number(number) => Some(number - 1).filter(|i| *i < dialect.n_columns()),
        ColumnName::Name(name) => {
            let exact = dialect.names.iter().position(|column| column == name);
            let same = |column: &String| column.eq_ignore_ascii_case(name);
            exact.or_else(|| dialect.names.iter().position(same))
        }
    }
}

/// Finds the columns of an expression.
fn bind(
    dialect: &Dialect,
    quantity: &'static str,
    expression: &Expression,
) -> Result<BoundColumns, CsvError> {
    let column = |name: &ColumnName| -> Result<usize, CsvError> {
        place(dialect, name).ok_or_else(|| {
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

/// The time is a date if the first rows have dates where numbers would be.
fn time_source(dialect: &Dialect, columns: BoundColumns) -> TimeSource {
    let indices: Option<Vec<usize>> =
        columns.terms.iter().map(|term| term.column.filter(|_| term.factor == 1.0)).collect();
    let is_moment = |indices: &Vec<usize>| {
        let first = dialect.first_rows.first();
        first.is_some_and(|row| {
            indices.iter().all(|i| row.get(*i).is_some_and(|cell| cell::is_moment(cell)))
        })
    };
    match indices.filter(is_moment) {
        Some(indices) => TimeSource::Moments(indices),
        None => TimeSource::Columns(columns),
    }
}
