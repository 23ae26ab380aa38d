//! The loads: the same samples in every format.

use anyhow::Result;
use axum::body::Bytes;
use offbd::wire::telemetry::{RowsView, sample_view};
use offbd_core::vocabulary::Sample;
use offbd_lab::simulation::{Disturbances, Fault, Preset, Reference, SimulatedRig};

/// Number of devices that send concurrently, each on its own connection.
pub(crate) const DEVICES: usize = 100;
/// Number of samples that each device sends per round.
pub(crate) const SAMPLES: usize = 20_000;
/// The same for small batches.
const SAMPLES_IN_TENS: usize = 5_000;

/// Returns `n` samples of a simulated rig, with an optional fault.
pub(crate) fn recording(n: usize, fault: Option<&str>) -> Result<Vec<Sample>> {
    let model = Preset::Chapter.model()?;
    let mut rig = SimulatedRig::new(model, Reference::Circle, Disturbances::default(), 1)?;
    if let Some(fault) = fault {
        rig.inject(fault.parse::<Fault>()?);
    }
    Ok((0..n).map(|_| rig.next_sample()).collect())
}

/// How batches are sent.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Transport {
    /// One HTTP request per batch, with this media type.
    Http(&'static str),
    /// Binary frames of a WebSocket.
    Socket,
}

/// The bodies that each device sends, one after the other.
pub(crate) struct Load {
    pub(crate) name: &'static str,
    pub(crate) transport: Transport,
    pub(crate) batch: usize,
    /// One list for all devices, or one for each.
    bodies: Vec<Vec<Bytes>>,
}

impl Load {
    pub(crate) fn new(
        name: &'static str,
        transport: Transport,
        batch: usize,
        samples: &[Sample],
        write: fn(&[Sample]) -> Vec<u8>,
    ) -> Self {
        let bodies = samples.chunks(batch).map(|part| write(part).into()).collect();
        Self { name, transport, batch, bodies: vec![bodies] }
    }

    /// A load in InfluxDB's line protocol, which names the device in each line.
    pub(crate) fn lines(
        name: &'static str,
        batch: usize,
        samples: &[Sample],
        begin_s: f64,
    ) -> Self {
        let of_device = |device: usize| {
            let write = |part: &[Sample]| line_protocol(device, part, begin_s).into();
            samples.chunks(batch).map(write).collect()
        };
        let bodies = (0..DEVICES).map(of_device).collect();
        Self { name, transport: Transport::Http("text/plain"), batch, bodies }
    }

    pub(crate) fn bodies(&self, device: usize) -> &[Bytes] {
        &self.bodies[device % self.bodies.len()]
    }
}

pub(crate) fn loads(samples: &[Sample]) -> Vec<Load> {
    let few = &samples[..SAMPLES_IN_TENS];
    let (json, msgpack) =
        (Transport::Http("application/json"), Transport::Http("application/msgpack"));
    vec![
        Load::new("JSON columns by 100", json, 100, samples, columns_as_json),
        Load::new("JSON rows by 100", json, 100, samples, rows_as_json),
        Load::new("MessagePack by 100", msgpack, 100, samples, columns_as_msgpack),
        Load::new("JSON columns by 10", json, 10, few, columns_as_json),
        Load::new("MessagePack by 10", msgpack, 10, few, columns_as_msgpack),
        Load::new("WebSocket by 100", Transport::Socket, 100, samples, columns_as_msgpack),
        Load::new("WebSocket by 10", Transport::Socket, 10, few, columns_as_msgpack),
    ]
}

/// Returns the loads for another database; samples start at `begin_s`, s since 1970.
pub(crate) fn loads_of_peer(samples: &[Sample], begin_s: f64) -> Vec<Load> {
    let few = &samples[..SAMPLES_IN_TENS];
    vec![
        Load::lines("line protocol by 100", 100, samples, begin_s),
        Load::lines("line protocol by 10", 10, few, begin_s + 3600.0),
    ]
}

pub(crate) fn columns(batch: &[Sample]) -> serde_json::Value {
    let column = |of: fn(&Sample) -> Option<f64>| batch.iter().map(of).collect::<Vec<_>>();
    serde_json::json!({
        "seq": batch.iter().map(|s| s.seq).collect::<Vec<_>>(),
        "t_s": column(|s| Some(s.t_s)),
        "cmd_qx_rad": column(|s| s.cmd_qx_rad),
        "cmd_qy_rad": column(|s| s.cmd_qy_rad),
        "x_m": column(|s| s.x_m),
        "y_m": column(|s| s.y_m),
    })
}

fn columns_as_json(batch: &[Sample]) -> Vec<u8> {
    columns(batch).to_string().into_bytes()
}

pub(crate) fn columns_as_msgpack(batch: &[Sample]) -> Vec<u8> {
    rmp_serde::to_vec_named(&columns(batch)).expect("plain values")
}

fn rows_as_json(batch: &[Sample]) -> Vec<u8> {
    let samples = batch.iter().map(sample_view).collect();
    serde_json::to_vec(&RowsView { session: None, samples }).expect("plain values")
}

fn line_protocol(device: usize, batch: &[Sample], begin_s: f64) -> Vec<u8> {
    use std::fmt::Write;
    let mut text = String::new();
    for sample in batch {
        let fields = [
            ("cmd_qx_rad", sample.cmd_qx_rad),
            ("cmd_qy_rad", sample.cmd_qy_rad),
            ("x_m", sample.x_m),
            ("y_m", sample.y_m),
        ];
        let fields =
            fields.iter().filter_map(|(name, value)| Some(format!("{name}={}", (*value)?)));
        let fields = fields.collect::<Vec<_>>().join(",");
        let at = ((begin_s + sample.t_s) * 1e9) as i64;
        writeln!(text, "rig,device=d{device} {fields} {at}")
            .expect("writing to a string cannot fail");
    }
    text.into_bytes()
}
