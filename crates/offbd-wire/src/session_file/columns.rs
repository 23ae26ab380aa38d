//! The columns of a session as Arrow arrays: one schema for Parquet and Arrow, written with
//! 64-bit numbers. Columns of any name are read, of numbers, text, dates and times.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Date64Type, Decimal128Type, Float16Type, Float32Type,
    Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, Time32MillisecondType,
    Time32SecondType, Time64MicrosecondType, Time64NanosecondType, TimestampMicrosecondType,
    TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type,
    UInt32Type, UInt64Type,
};
use arrow_array::{
    Array, ArrayRef, Float64Array, Int64Array, RecordBatch, TimestampMicrosecondArray,
};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef, TimeUnit};
use jiff::Timestamp;

use super::line::line_of;
use super::{SessionFileError, SessionInfo, unix_micros};
use crate::session_csv::COLUMNS;
use crate::table::{Cells, JUDGED_ROWS};
use offbd_core::vocabulary::Sample;

/// The name of the column with the numbers of the samples, which may be missing.
const SEQ: &str = "seq";

/// The name of the column with absolute times, which only tables of a clock that counts from 1970
/// have.
const TIME: &str = "time";

/// The column with absolute times, if `info` says that the clock has them.
pub(super) fn time_field(info: &SessionInfo) -> Option<Field> {
    info.first_t_s.and_then(unix_micros)?;
    let data_type = DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()));
    Some(Field::new(TIME, data_type, true))
}

/// The absolute times of `t_s`, s on the device's clock, if `schema` has a column for them.
pub(super) fn times(schema: &Schema, t_s: impl Iterator<Item = f64>) -> Option<ArrayRef> {
    schema.column_with_name(TIME)?;
    let times = TimestampMicrosecondArray::from_iter(t_s.map(unix_micros));
    Some(Arc::new(times.with_timezone("UTC")))
}

/// The schema of a session's file, with `info` as its metadata.
pub(super) fn schema(info: &SessionInfo) -> SchemaRef {
    let [t_s, quantities @ ..] = COLUMNS;
    let mut fields = vec![Field::new(t_s, DataType::Float64, false)];
    fields.extend(time_field(info));
    fields.push(Field::new(SEQ, DataType::Int64, true));
    fields.extend(quantities.map(|name| Field::new(name, DataType::Float64, true)));
    let metadata = info.entries().map(|(key, value)| (key.to_owned(), value.to_owned()));
    Arc::new(Schema::new(fields).with_metadata(metadata.collect::<HashMap<_, _>>()))
}

/// The samples as a record batch of `schema`.
pub(super) fn batch(schema: &SchemaRef, samples: &[Sample]) -> Result<RecordBatch, ArrowError> {
    let column = |value: fn(&Sample) -> Option<f64>| -> ArrayRef {
        Arc::new(Float64Array::from_iter(samples.iter().map(value)))
    };
    let t_s = Float64Array::from_iter_values(samples.iter().map(|s| s.t_s));
    let seq = samples.iter().map(|s| s.seq.and_then(|seq| i64::try_from(seq).ok()));
    let mut columns = vec![Arc::new(t_s) as ArrayRef];
    columns.extend(times(schema, samples.iter().map(|s| s.t_s)));
    columns.extend([
        Arc::new(Int64Array::from_iter(seq)) as ArrayRef,
        column(|s| s.cmd_qx_rad),
        column(|s| s.cmd_qy_rad),
        column(|s| s.x_m),
        column(|s| s.y_m),
    ]);
    RecordBatch::try_new(schema.clone(), columns)
}

/// The names of the columns of `schema`.
pub(super) fn names(schema: &Schema) -> Vec<String> {
    schema.fields().iter().map(|field| line_of(field.name())).collect()
}

/// Whether values of this type can be read.
pub(super) fn is_read(data_type: &DataType) -> bool {
    let is_other = matches!(
        data_type,
        DataType::Decimal32(..)
            | DataType::Decimal64(..)
            | DataType::Decimal256(..)
            | DataType::Interval(_)
            | DataType::Duration(_)
    );
    let is_value = data_type.is_numeric()
        || data_type.is_string()
        || data_type.is_temporal()
        || *data_type == DataType::Null;
    is_value && !is_other
}

/// Checks that the columns `wanted` have types that are read.
///
/// # Errors
/// [`SessionFileError::NotANumber`].
pub(super) fn check(schema: &Schema, wanted: &[usize]) -> Result<(), SessionFileError> {
    let mut fields = wanted.iter().map(|column| schema.field(*column));
    match fields.find(|field| !is_read(field.data_type())) {
        None => Ok(()),
        Some(field) => Err(SessionFileError::NotANumber {
            column: line_of(field.name()),
            found: field.data_type().to_string(),
        }),
    }
}

/// Appends the value at `row`, which must be in the array; nothing of a type that is not read.
fn push(cells: &mut Cells, array: &dyn Array, row: usize) {
    fn value<T: ArrowPrimitiveType>(array: &dyn Array, row: usize) -> T::Native {
        array.as_primitive::<T>().value(row)
    }
    /// A date, a time of day or both, of so many units in a second.
    fn moment(cells: &mut Cells, value: i64, units: i64, is_clock: bool) {
        let nanoseconds = i128::from(value) * i128::from(1_000_000_000 / units);
        match Timestamp::from_nanosecond(nanoseconds) {
            Ok(moment) if is_clock => {
                let moment = moment.to_string();
                cells.push_text(moment.trim_start_matches("1970-01-01T").trim_end_matches('Z'));
            }
            Ok(moment) => cells.push_text(&moment.to_string()),
            Err(_) => cells.push_text(&value.to_string()),
        }
    }
    if array.is_null(row) {
        return cells.push_text("");
    }
    match array.data_type() {
        DataType::Float64 => cells.push_number(value::<Float64Type>(array, row)),
        DataType::Float32 => cells.push_number(f64::from(value::<Float32Type>(array, row))),
        DataType::Float16 => cells.push_number(f64::from(value::<Float16Type>(array, row))),
        // Text keeps all digits of the number of a sample.
        DataType::Int64 => cells.push_text(&value::<Int64Type>(array, row).to_string()),
        DataType::Int32 => cells.push_number(f64::from(value::<Int32Type>(array, row))),
        DataType::Int16 => cells.push_number(f64::from(value::<Int16Type>(array, row))),
        DataType::Int8 => cells.push_number(f64::from(value::<Int8Type>(array, row))),
        DataType::UInt64 => cells.push_text(&value::<UInt64Type>(array, row).to_string()),
        DataType::UInt32 => cells.push_number(f64::from(value::<UInt32Type>(array, row))),
        DataType::UInt16 => cells.push_number(f64::from(value::<UInt16Type>(array, row))),
        DataType::UInt8 => cells.push_number(f64::from(value::<UInt8Type>(array, row))),
        DataType::Decimal128(..) => {
            cells.push_text(&array.as_primitive::<Decimal128Type>().value_as_string(row));
        }
        DataType::Utf8 => cells.push_text(array.as_string::<i32>().value(row)),
        DataType::LargeUtf8 => cells.push_text(array.as_string::<i64>().value(row)),
        DataType::Utf8View => cells.push_text(array.as_string_view().value(row)),
        DataType::Date32 => {
            moment(cells, i64::from(value::<Date32Type>(array, row)) * 86_400, 1, false);
        }
        DataType::Date64 => moment(cells, value::<Date64Type>(array, row), 1000, false),
        DataType::Time32(TimeUnit::Second) => {
            moment(cells, i64::from(value::<Time32SecondType>(array, row)), 1, true);
        }
        DataType::Time32(_) => {
            moment(cells, i64::from(value::<Time32MillisecondType>(array, row)), 1000, true);
        }
        DataType::Time64(TimeUnit::Microsecond) => {
            moment(cells, value::<Time64MicrosecondType>(array, row), 1_000_000, true);
        }
        DataType::Time64(_) => {
            moment(cells, value::<Time64NanosecondType>(array, row), 1_000_000_000, true);
        }
        DataType::Timestamp(unit, _) => match unit {
            TimeUnit::Second => moment(cells, value::<TimestampSecondType>(array, row), 1, false),
            TimeUnit::Millisecond => {
                moment(cells, value::<TimestampMillisecondType>(array, row), 1000, false);
            }
            TimeUnit::Microsecond => {
                moment(cells, value::<TimestampMicrosecondType>(array, row), 1_000_000, false);
            }
            TimeUnit::Nanosecond => {
                moment(cells, value::<TimestampNanosecondType>(array, row), 1_000_000_000, false);
            }
        },
        _ => cells.push_text(""),
    }
}

/// Returns the first values of a column as text, as [`JUDGED_ROWS`] are judged.
pub(super) fn first_values(array: &dyn Array) -> Vec<String> {
    let text = |row: usize| {
        let mut cells = Cells::default();
        push(&mut cells, array, row);
        cells.text(0)
    };
    (0..array.len().min(JUDGED_ROWS)).map(text).collect()
}

/// Returns the rows of columns of values; a column without a value has an empty one.
pub(super) fn rows_of(columns: &[Vec<String>]) -> Vec<Vec<String>> {
    let n_rows = columns.iter().map(Vec::len).max().unwrap_or_default();
    let row = |i: usize| {
        columns.iter().map(|column| column.get(i).cloned().unwrap_or_default()).collect()
    };
    (0..n_rows).map(row).collect()
}

/// The rows of one record batch after the other.
pub(super) struct BatchRows {
    /// Of each column of the file, its place in the batches; `None` if it is not read.
    places: Vec<Option<usize>>,
    batch: Option<RecordBatch>,
    next: usize,
    n_read: u64,
}

impl BatchRows {
    /// Rows of a file with `n_columns`, in whose batches the columns have the places `places`.
    pub(super) const fn new(places: Vec<Option<usize>>) -> Self {
        Self { places, batch: None, next: 0, n_read: 0 }
    }

    /// Continues with the rows of `batch`.
    pub(super) fn set(&mut self, batch: RecordBatch) {
        (self.batch, self.next) = (Some(batch), 0);
    }

    /// Reads the next row; false at the end of the batch.
    pub(super) fn next(&mut self, cells: &mut Cells) -> bool {
        let Some(batch) = self.batch.as_ref().filter(|batch| self.next < batch.num_rows()) else {
            self.batch = None;
            return false;
        };
        cells.clear();
        for place in &self.places {
            match place {
                Some(place) => push(cells, batch.column(*place), self.next),
                None => cells.push_text(""),
            }
        }
        self.n_read += 1;
        self.next += 1;
        true
    }

    /// The number of the row read last, from 1.
    pub(super) const fn n_read(&self) -> u64 {
        self.n_read
    }
}
