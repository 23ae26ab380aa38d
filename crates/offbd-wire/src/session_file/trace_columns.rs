//! The columns of a trace as Arrow arrays, which Parquet files and Arrow streams of traces have.
//!
//! Their names are those of the JSON document, with `x_` and `y_` before the names of an axis.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Float32Array, Float64Array, Int8Array, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};

use super::{SessionInfo, columns};
use crate::trace::{AxisTraceView, TraceView};

/// The schema of a trace of the session of `info`, with `entries` as its metadata.
pub(super) fn schema(info: &SessionInfo, entries: &[(String, String)]) -> SchemaRef {
    let float = |name| Field::new(name, DataType::Float32, true);
    let known = |name, data_type| Field::new(name, data_type, false);
    let mut fields = vec![Field::new("t_s", DataType::Float64, false)];
    fields.extend(columns::time_field(info));
    for axis in ["x", "y"] {
        let name = |quantity: &str| format!("{axis}_{quantity}");
        fields.extend([
            float(name("command_rad")),
            known(name("plate_angle_rad"), DataType::Float32),
            float(name("position_m")),
            known(name("twin_position_m"), DataType::Float32),
            float(name("measured_m_s2")),
            float(name("twin_m_s2")),
            known(name("limit_m_s2"), DataType::Float32),
            known(name("enabled"), DataType::Boolean),
            known(name("nats"), DataType::Float32),
            known(name("counter"), DataType::Int8),
        ]);
    }
    let counters = ["stuck_ball_counter", "sensor_counter"];
    fields.extend(counters.map(|name| Field::new(name, DataType::Int8, false)));
    let metadata: HashMap<_, _> = entries.iter().cloned().collect();
    Arc::new(Schema::new(fields).with_metadata(metadata))
}

/// The moments of `trace` as a record batch of `schema`.
pub(super) fn batch(schema: &SchemaRef, trace: &TraceView) -> Result<RecordBatch, ArrowError> {
    let mut columns: Vec<ArrayRef> = vec![Arc::new(Float64Array::from(trace.t_s.clone()))];
    columns.extend(columns::times(schema, trace.t_s.iter().copied()));
    columns.extend(axis(&trace.x));
    columns.extend(axis(&trace.y));
    for counter in [&trace.stuck_ball_counter, &trace.sensor_counter] {
        columns.push(Arc::new(Int8Array::from(counter.clone())));
    }
    RecordBatch::try_new(schema.clone(), columns)
}

/// The columns of an axis, in the order of the schema.
fn axis(trace: &AxisTraceView) -> [ArrayRef; 10] {
    let float = |values: &[Option<f32>]| Arc::new(Float32Array::from(values.to_vec())) as ArrayRef;
    let known = |values: &[f32]| Arc::new(Float32Array::from(values.to_vec())) as ArrayRef;
    [
        float(&trace.command_rad),
        known(&trace.plate_angle_rad),
        float(&trace.position_m),
        known(&trace.twin_position_m),
        float(&trace.measured_m_s2),
        float(&trace.twin_m_s2),
        known(&trace.limit_m_s2),
        Arc::new(BooleanArray::from(trace.enabled.clone())),
        known(&trace.nats),
        Arc::new(Int8Array::from(trace.counter.clone())),
    ]
}
