//! Tables that go to Python, by the Arrow PyCapsule interface: pandas, polars, pyarrow and
//! DuckDB take them without a copy.

use std::sync::Arc;

use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{ArrayRef, Float64Array, RecordBatch, RecordBatchIterator, UInt64Array};
use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::ArrowError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyType};

use crate::unusable;
use offbd_core::vocabulary::Sample;

/// The name of a capsule with a stream, as the interface demands.
pub(crate) const STREAM: &std::ffi::CStr = c"arrow_array_stream";

/// A table of columns of equal length.
#[pyclass(frozen, module = "offbd")]
pub(crate) struct Table {
    batch: RecordBatch,
}

impl Table {
    /// Creates a table of these columns.
    pub(crate) fn new<'a>(
        columns: impl IntoIterator<Item = (&'a str, ArrayRef)>,
    ) -> Result<Self, ArrowError> {
        let columns = columns.into_iter().map(|(name, column)| (name, column, true));
        Ok(Self { batch: RecordBatch::try_from_iter_with_nullable(columns)? })
    }

    /// Creates the table of a session, with the column `seq` if `with_seq` is true.
    pub(crate) fn of_samples(samples: &[Sample], with_seq: bool) -> Result<Self, ArrowError> {
        let numbers = |of: fn(&Sample) -> Option<f64>| numbers(samples.iter().map(of));
        let seq = with_seq.then(|| UInt64Array::from_iter(samples.iter().map(|s| s.seq)));
        let seq = seq.map(|seq| ("seq", Arc::new(seq) as ArrayRef));
        Self::new(seq.into_iter().chain([
            ("t_s", numbers(|s| Some(s.t_s))),
            ("cmd_qx_rad", numbers(|s| s.cmd_qx_rad)),
            ("cmd_qy_rad", numbers(|s| s.cmd_qy_rad)),
            ("x_m", numbers(|s| s.x_m)),
            ("y_m", numbers(|s| s.y_m)),
        ]))
    }
}

/// Returns a column of numbers; `None` becomes null.
pub(crate) fn numbers(values: impl IntoIterator<Item = Option<f64>>) -> ArrayRef {
    Arc::new(Float64Array::from_iter(values))
}

#[pymethods]
impl Table {
    /// The table in the bytes of an Arrow stream, as [`__reduce__`](Self::__reduce__) writes it.
    #[new]
    fn of_ipc(bytes: &[u8]) -> PyResult<Self> {
        let mut batches = StreamReader::try_new(bytes, None).map_err(unusable)?;
        let batch = batches.next().ok_or_else(|| unusable("the Arrow stream has no rows"))?;
        Ok(Self { batch: batch.map_err(unusable)? })
    }

    /// How the table is pickled.
    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyType>, (Bound<'py, PyBytes>,))> {
        let batch = &slf.get().batch;
        let mut writer = StreamWriter::try_new(Vec::new(), batch.schema_ref()).map_err(unusable)?;
        writer.write(batch).map_err(unusable)?;
        let bytes = writer.into_inner().map_err(unusable)?;
        Ok((slf.get_type(), (PyBytes::new(slf.py(), &bytes),)))
    }

    #[getter]
    fn column_names(&self) -> Vec<String> {
        self.batch.schema_ref().fields().iter().map(|field| field.name().clone()).collect()
    }

    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    fn __repr__(&self) -> String {
        format!("offbd.Table({} rows: {})", self.batch.num_rows(), self.column_names().join(", "))
    }

    /// Returns the table as a stream of Arrow record batches. A requested schema is
    /// permitted to be ignored.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        let _ = requested_schema;
        let batches = [Ok(self.batch.clone())];
        let reader = RecordBatchIterator::new(batches, self.batch.schema());
        PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(reader)), STREAM)
    }

    /// Returns the columns as lists.
    fn to_pydict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        use arrow_array::cast::AsArray;
        use arrow_array::types::{Float64Type, UInt64Type};
        use arrow_schema::DataType;

        let columns = PyDict::new(py);
        for (field, column) in self.batch.schema_ref().fields().iter().zip(self.batch.columns()) {
            let name = field.name();
            match column.data_type() {
                DataType::UInt64 => {
                    let values: Vec<_> = column.as_primitive::<UInt64Type>().iter().collect();
                    columns.set_item(name, values)?;
                }
                DataType::Boolean => {
                    let values: Vec<_> = column.as_boolean().iter().collect();
                    columns.set_item(name, values)?;
                }
                DataType::Float64 => {
                    let values: Vec<_> = column.as_primitive::<Float64Type>().iter().collect();
                    columns.set_item(name, values)?;
                }
                other => return Err(unusable(format!("column `{name}` has the type {other}"))),
            }
        }
        Ok(columns)
    }
}
