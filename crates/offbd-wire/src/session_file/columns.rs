//! The columns of a session as Arrow arrays: one schema for Parquet and Arrow, written with
//! 64-bit numbers and read from any numeric type.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type,
    Int64Type, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{
    Array, ArrayRef, Float64Array, Int64Array, RecordBatch, TimestampMicrosecondArray,
};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef, TimeUnit};

use super::{RejectedRow, RowPlace, SessionFileError, SessionInfo, SessionRowError, unix_micros};
use crate::session_csv::COLUMNS;
use crate::telemetry::MAX_SEQ;
use offbd_core::vocabulary::Sample;

/// The name of the column with the numbers of the samples, which may be missing.
const SEQ: &str = "seq";

/// The name of the column with absolute times, which only tables of a clock that counts from 1970
/// have. It is not read back.
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

/// Indices of the columns of a session in a schema.
#[derive(Clone, Copy, Debug)]
pub(super) struct SchemaIndices {
    columns: [usize; COLUMNS.len()],
    seq: Option<usize>,
}

impl SchemaIndices {
    /// Finds the columns in `schema`.
    ///
    /// # Errors
    /// [`SessionFileError`] if one is missing, repeated or not numeric.
    pub(super) fn of(schema: &Schema) -> Result<Self, SessionFileError> {
        let mut columns = [0; COLUMNS.len()];
        for (slot, name) in columns.iter_mut().zip(COLUMNS) {
            *slot = find(schema, name)?.ok_or(SessionFileError::NoColumn(name))?;
        }
        Ok(Self { columns, seq: find(schema, SEQ)? })
    }

    /// All indices.
    pub(super) fn all(&self) -> impl Iterator<Item = usize> {
        self.columns.into_iter().chain(self.seq)
    }
}

fn find(schema: &Schema, name: &'static str) -> Result<Option<usize>, SessionFileError> {
    let mut found = (0..schema.fields().len()).filter(|&i| schema.field(i).name() == name);
    let (first, second) = (found.next(), found.next());
    if second.is_some() {
        return Err(SessionFileError::TwoColumns(name));
    }
    let Some(index) = first else { return Ok(None) };
    let data_type = schema.field(index).data_type();
    if data_type.is_integer() || data_type.is_floating() || *data_type == DataType::Null {
        return Ok(Some(index));
    }
    Err(SessionFileError::NotANumber { column: name, found: data_type.to_string() })
}

/// A value of a numeric column.
#[derive(Clone, Copy)]
enum Number {
    Missing,
    Whole(i128),
    Real(f64),
}

impl Number {
    /// Reads the value at `row`, which must be in the array.
    fn of(array: &dyn Array, row: usize) -> Self {
        fn value<T: ArrowPrimitiveType>(array: &dyn Array, row: usize) -> Option<T::Native> {
            array.as_primitive_opt::<T>().map(|a| a.value(row))
        }
        let whole = |value: Option<i128>| value.map_or(Self::Missing, Self::Whole);
        let real = |value: Option<f64>| value.map_or(Self::Missing, Self::Real);
        if array.is_null(row) {
            return Self::Missing;
        }
        match array.data_type() {
            DataType::Float64 => real(value::<Float64Type>(array, row)),
            DataType::Float32 => real(value::<Float32Type>(array, row).map(f64::from)),
            DataType::Float16 => real(value::<Float16Type>(array, row).map(f64::from)),
            DataType::Int64 => whole(value::<Int64Type>(array, row).map(i128::from)),
            DataType::Int32 => whole(value::<Int32Type>(array, row).map(i128::from)),
            DataType::Int16 => whole(value::<Int16Type>(array, row).map(i128::from)),
            DataType::Int8 => whole(value::<Int8Type>(array, row).map(i128::from)),
            DataType::UInt64 => whole(value::<UInt64Type>(array, row).map(i128::from)),
            DataType::UInt32 => whole(value::<UInt32Type>(array, row).map(i128::from)),
            DataType::UInt16 => whole(value::<UInt16Type>(array, row).map(i128::from)),
            DataType::UInt8 => whole(value::<UInt8Type>(array, row).map(i128::from)),
            _ => Self::Missing,
        }
    }

    /// The value as a quantity. NaN is the missing value of many data frames.
    fn quantity(self, column: &str) -> Result<Option<f64>, String> {
        match self {
            Self::Missing => Ok(None),
            Self::Whole(value) => Ok(Some(value as f64)),
            Self::Real(value) if value.is_nan() => Ok(None),
            Self::Real(value) if value.is_finite() => Ok(Some(value)),
            Self::Real(value) => Err(format!("`{column}`: `{value}` is not finite")),
        }
    }

    /// The value as the number of a sample, which data frames with missing ones keep as a
    /// double.
    fn seq(self) -> Result<Option<u64>, String> {
        let (whole, shown) = match self {
            Self::Missing => return Ok(None),
            Self::Real(value) if value.is_nan() => return Ok(None),
            Self::Whole(value) => (Some(value), value.to_string()),
            Self::Real(value) => {
                ((value.fract() == 0.0).then_some(value as i128), value.to_string())
            }
        };
        let seq = whole.and_then(|whole| u64::try_from(whole).ok()).filter(|seq| *seq <= MAX_SEQ);
        seq.map(Some).ok_or_else(|| format!("`{SEQ}`: `{shown}` is not a whole number of a sample"))
    }
}

/// The rows of one record batch after the other.
pub(super) struct BatchRows {
    batch: Option<(RecordBatch, SchemaIndices)>,
    next: usize,
    n_read: u64,
}

impl BatchRows {
    pub(super) const fn new() -> Self {
        Self { batch: None, next: 0, n_read: 0 }
    }

    /// Continues with the rows of `batch`.
    pub(super) fn set(&mut self, batch: RecordBatch) -> Result<(), SessionFileError> {
        let indices = SchemaIndices::of(&batch.schema())?;
        (self.batch, self.next) = (Some((batch, indices)), 0);
        Ok(())
    }

    /// Returns the next row; `None` at the end of the batch.
    pub(super) fn next(&mut self) -> Option<Result<Sample, SessionRowError>> {
        let (batch, indices) = self.batch.as_ref()?;
        if self.next >= batch.num_rows() {
            self.batch = None;
            return None;
        }
        self.n_read += 1;
        let row = sample(batch, indices, self.next);
        self.next += 1;
        let rejected =
            |reason| SessionRowError::Rejected(RejectedRow { place: self.place(), reason });
        Some(row.map_err(rejected))
    }

    /// The place of the row read last.
    pub(super) const fn place(&self) -> RowPlace {
        RowPlace::Row(self.n_read)
    }
}

fn sample(batch: &RecordBatch, indices: &SchemaIndices, row: usize) -> Result<Sample, String> {
    let number = |index: usize| Number::of(batch.column(index), row);
    let quantity = |i: usize| number(indices.columns[i]).quantity(COLUMNS[i]);
    Ok(Sample {
        seq: indices.seq.map_or(Ok(None), |index| number(index).seq())?,
        t_s: quantity(0)?.ok_or_else(|| format!("`{}` is missing", COLUMNS[0]))?,
        cmd_qx_rad: quantity(1)?,
        cmd_qy_rad: quantity(2)?,
        x_m: quantity(3)?,
        y_m: quantity(4)?,
    })
}
