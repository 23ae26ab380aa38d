//! Tables that come from Python: anything with the Arrow PyCapsule interface (tables of
//! pandas, polars, pyarrow, DuckDB), or a dictionary of columns (NumPy arrays, lists).
//!
//! The samples are read from the columns of a session: `t_s`, `cmd_qx_rad`, `cmd_qy_rad`, `x_m`,
//! `y_m` and optionally `seq`; others are ignored. Null and NaN are missing values. Numbers of other
//! types than 64-bit floats are converted. The batches of a stream are read one after the
//! other, so that a long recording need not be in memory.

#![expect(unsafe_code, reason = "the Arrow PyCapsule interface passes pointers")]

use std::ffi::CStr;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi::{FFI_ArrowArray, FFI_ArrowSchema, from_ffi};
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::types::{
    ArrowPrimitiveType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{
    Array, ArrayRef, Float64Array, RecordBatch, StringArray, StructArray, UInt64Array,
};
use arrow_schema::{ArrowError, DataType};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyMapping, PyString};

use crate::table::STREAM;
use offbd_core::vocabulary::Sample;
use offbd_wire::session_csv::COLUMNS;

/// Why the columns of a recording cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ColumnError {
    #[error("the column `{0}` is missing; required: t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m")]
    Missing(&'static str),
    #[error("the column `{column}` has the type {data_type}, which is not a number")]
    NotNumbers { column: &'static str, data_type: DataType },
    #[error("the column `seq` has {value} in row {row}, which is not a whole number from 0 on")]
    NotSeq { value: f64, row: usize },
    #[error("the column `{0}` is neither numbers nor text in one dimension")]
    NotValues(String),
    #[error("the columns `{first}` and `{column}` have different lengths, {expected} and {found}")]
    Lengths { first: String, column: String, expected: usize, found: usize },
    #[error("the source of the recording failed: {0}")]
    Source(#[from] ArrowError),
}

impl From<ColumnError> for PyErr {
    fn from(error: ColumnError) -> Self {
        PyValueError::new_err(error.to_string())
    }
}

/// The columns of samples, all of the same length.
pub(crate) struct SampleColumns {
    seq: Option<UInt64Array>,
    /// In the order of [`COLUMNS`].
    numbers: [Float64Array; COLUMNS.len()],
}

impl SampleColumns {
    /// Takes the columns of a record batch.
    pub(crate) fn of_batch(batch: &RecordBatch) -> Result<Self, ColumnError> {
        let column = |name: &'static str| match batch.column_by_name(name) {
            Some(column) => floats(name, column),
            None => Err(ColumnError::Missing(name)),
        };
        let [t, qx, qy, x, y] = COLUMNS;
        let seq = batch.column_by_name("seq").map(|column| whole_numbers(column)).transpose()?;
        Ok(Self { seq, numbers: [column(t)?, column(qx)?, column(qy)?, column(x)?, column(y)?] })
    }

    /// Calls `take` with each sample, in the order of the rows.
    pub(crate) fn for_each(&self, take: &mut impl FnMut(Sample)) {
        let [t_s, qx, qy, x, y] = &self.numbers;
        for row in 0..t_s.len() {
            take(Sample {
                seq: self.seq.as_ref().filter(|seq| seq.is_valid(row)).map(|seq| seq.value(row)),
                // A row without a time is rejected by the engine.
                t_s: number(t_s, row).unwrap_or(f64::NAN),
                cmd_qx_rad: number(qx, row),
                cmd_qy_rad: number(qy, row),
                x_m: number(x, row),
                y_m: number(y, row),
            });
        }
    }
}

/// The number of a row; `None` if it is missing.
fn number(column: &Float64Array, row: usize) -> Option<f64> {
    column.is_valid(row).then(|| column.value(row)).filter(|value| !value.is_nan())
}

/// Returns a column of numbers as 64-bit floats; those are not copied.
fn floats(column: &'static str, array: &dyn Array) -> Result<Float64Array, ColumnError> {
    Ok(match array.data_type() {
        DataType::Float64 => array.as_primitive::<Float64Type>().clone(),
        DataType::Float32 => converted::<Float32Type>(array, f64::from),
        DataType::Int8 => converted::<Int8Type>(array, f64::from),
        DataType::Int16 => converted::<Int16Type>(array, f64::from),
        DataType::Int32 => converted::<Int32Type>(array, f64::from),
        DataType::Int64 => converted::<Int64Type>(array, |v| v as f64),
        DataType::UInt8 => converted::<UInt8Type>(array, f64::from),
        DataType::UInt16 => converted::<UInt16Type>(array, f64::from),
        DataType::UInt32 => converted::<UInt32Type>(array, f64::from),
        DataType::UInt64 => converted::<UInt64Type>(array, |v| v as f64),
        DataType::Null => Float64Array::new_null(array.len()),
        other => return Err(ColumnError::NotNumbers { column, data_type: other.clone() }),
    })
}

fn converted<T: ArrowPrimitiveType>(
    array: &dyn Array,
    to: impl Fn(T::Native) -> f64,
) -> Float64Array {
    array.as_primitive::<T>().unary(to)
}

/// Largest whole number up to which a 64-bit float represents all.
const MAX_EXACT: f64 = 9_007_199_254_740_992.0;

/// Returns the column `seq` as whole numbers; those of 64 bits are not copied.
fn whole_numbers(array: &dyn Array) -> Result<UInt64Array, ColumnError> {
    match array.data_type() {
        DataType::UInt64 => return Ok(array.as_primitive::<UInt64Type>().clone()),
        DataType::Int64 => {
            let values = array.as_primitive::<Int64Type>();
            let negative =
                |(row, value): (usize, Option<i64>)| Some((row, value.filter(|v| *v < 0)?));
            if let Some((row, value)) = values.iter().enumerate().find_map(negative) {
                return Err(ColumnError::NotSeq { value: value as f64, row });
            }
            return Ok(values.unary(i64::cast_unsigned));
        }
        _ => {}
    }
    let numbers = floats("seq", array)?;
    let whole = |row: usize| match number(&numbers, row) {
        None => Ok(None),
        Some(value) if (0.0..=MAX_EXACT).contains(&value) && value.fract() == 0.0 => {
            Ok(Some(value as u64))
        }
        Some(value) => Err(ColumnError::NotSeq { value, row }),
    };
    (0..numbers.len()).map(whole).collect()
}

/// Returns the columns of a mapping from their names; those of neither numbers nor text are left out.
pub(crate) fn batch_of_mapping(columns: &Bound<'_, PyMapping>) -> PyResult<RecordBatch> {
    let mut fields: Vec<(String, ArrayRef)> = Vec::new();
    for item in columns.items()? {
        let (name, values): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let Ok(name) = name.extract::<String>() else { continue };
        let column = match python_column(&values)? {
            Some(column) => column,
            None if COLUMNS.contains(&name.as_str()) => {
                return Err(ColumnError::NotValues(name).into());
            }
            None => continue,
        };
        if let Some((first, expected)) = fields.first().filter(|(_, c)| c.len() != column.len()) {
            let (first, expected, found) = (first.clone(), expected.len(), column.len());
            return Err(ColumnError::Lengths { first, column: name, expected, found }.into());
        }
        fields.push((name, column));
    }
    let fields = fields.into_iter().map(|(name, column)| (name, column, true));
    Ok(RecordBatch::try_from_iter_with_nullable(fields).map_err(ColumnError::from)?)
}

/// Returns a column of a mapping; `None` if it has neither numbers nor text. The values of a NumPy
/// array are copied, because other threads may change it while it is judged.
fn python_column(values: &Bound<'_, PyAny>) -> PyResult<Option<ArrayRef>> {
    let is_array = values.hasattr("dtype")? && values.hasattr("tobytes")?;
    let is_flat = !is_array || values.getattr("ndim")?.extract::<usize>()? == 1;
    if !is_flat || values.is_instance_of::<PyString>() {
        return Ok(None);
    }
    if is_array && let Ok(values) = values.call_method1("astype", ("<f8",)) {
        let bytes = values.call_method0("tobytes")?;
        let (values, _) = bytes.extract::<&[u8]>()?.as_chunks();
        let values = values.iter().copied().map(f64::from_le_bytes);
        return Ok(Some(Arc::new(Float64Array::from_iter_values(values))));
    }
    if let Ok(numbers) = values.extract::<Vec<Option<f64>>>() {
        return Ok(Some(Arc::new(Float64Array::from(numbers))));
    }
    let texts = values.extract::<Vec<Option<String>>>().ok();
    Ok(texts.map(|texts| Arc::new(StringArray::from(texts)) as ArrayRef))
}

/// Takes the stream of record batches that `source` offers.
pub(crate) fn stream(source: &Bound<'_, PyAny>) -> PyResult<RecordBatchStreamReader> {
    let capsule = source.call_method0("__arrow_c_stream__")?;
    let stream = pointer::<FFI_ArrowArrayStream>(&capsule, STREAM)?;
    // SAFETY: a capsule of this name holds an initialised stream, which is moved out of it.
    let reader = unsafe { RecordBatchStreamReader::from_raw(stream) };
    Ok(reader.map_err(ColumnError::from)?)
}

/// Takes the record batch that `source` offers.
pub(crate) fn record_batch(source: &Bound<'_, PyAny>) -> PyResult<RecordBatch> {
    let capsules = source.call_method0("__arrow_c_array__")?;
    let schema = pointer::<FFI_ArrowSchema>(&capsules.get_item(0)?, c"arrow_schema")?;
    let array = pointer::<FFI_ArrowArray>(&capsules.get_item(1)?, c"arrow_array")?;
    // SAFETY: capsules of these names hold an initialised schema and array, which belong
    // together and are moved out of them.
    let data =
        unsafe { from_ffi(FFI_ArrowArray::from_raw(array), &FFI_ArrowSchema::from_raw(schema)) };
    let data = data.map_err(ColumnError::from)?;
    match data.data_type() {
        DataType::Struct(_) => Ok(StructArray::from(data).into()),
        other => {
            Err(PyTypeError::new_err(format!("a recording is a table, not an array of {other}")))
        }
    }
}

/// Returns the pointer in the capsule `capsule`, which must have the name `name`.
fn pointer<T>(capsule: &Bound<'_, PyAny>, name: &'static CStr) -> PyResult<*mut T> {
    Ok(capsule.cast::<PyCapsule>()?.pointer_checked(Some(name))?.cast().as_ptr())
}
