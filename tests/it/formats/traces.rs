//! The trace of a session as Parquet and Arrow: the same as in JSON, whole or broken off.

use std::collections::HashMap;
use std::io::Cursor;

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{ArrowPrimitiveType, Float32Type, Float64Type, Int8Type};
use offbd::wire::session_file::SessionFormat;
use offbd::wire::trace::{AxisTraceView, TraceView};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use reqwest::Method;
use serde_json::{Value, json};

use super::IMPORT;
use crate::cli::fixture::CliFixture;
use crate::support::{Answer, Client, ServiceFixture, csv, registration, rig};

const FORMATS: [SessionFormat; 2] = [SessionFormat::Parquet, SessionFormat::Arrow];

type Metadata = HashMap<String, String>;

fn values<T: ArrowPrimitiveType>(batch: &RecordBatch, name: &str) -> Vec<Option<T::Native>> {
    batch.column_by_name(name).unwrap().as_primitive::<T>().iter().collect()
}

fn known<T: ArrowPrimitiveType>(batch: &RecordBatch, name: &str) -> Vec<T::Native> {
    values::<T>(batch, name).into_iter().map(Option::unwrap).collect()
}

fn append_axis(trace: &mut AxisTraceView, batch: &RecordBatch, axis: &str) {
    let name = |quantity: &str| format!("{axis}_{quantity}");
    let float = |quantity: &str| values::<Float32Type>(batch, &name(quantity));
    let float_known = |quantity: &str| known::<Float32Type>(batch, &name(quantity));
    trace.command_rad.extend(float("command_rad"));
    trace.plate_angle_rad.extend(float_known("plate_angle_rad"));
    trace.position_m.extend(float("position_m"));
    trace.twin_position_m.extend(float_known("twin_position_m"));
    trace.measured_m_s2.extend(float("measured_m_s2"));
    trace.twin_m_s2.extend(float("twin_m_s2"));
    trace.limit_m_s2.extend(float_known("limit_m_s2"));
    let enabled = batch.column_by_name(&name("enabled")).unwrap().as_boolean();
    trace.enabled.extend(enabled.iter().map(Option::unwrap));
    trace.nats.extend(float_known("nats"));
    trace.counter.extend(known::<Int8Type>(batch, &name("counter")));
}

fn append(trace: &mut TraceView, batch: &RecordBatch) {
    trace.t_s.extend(known::<Float64Type>(batch, "t_s"));
    append_axis(&mut trace.x, batch, "x");
    append_axis(&mut trace.y, batch, "y");
    trace.stuck_ball_counter.extend(known::<Int8Type>(batch, "stuck_ball_counter"));
    trace.sensor_counter.extend(known::<Int8Type>(batch, "sensor_counter"));
}

fn read_parquet(file: Vec<u8>) -> (Vec<RecordBatch>, Metadata) {
    let reader = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(file)).unwrap();
    let entries = reader.metadata().file_metadata().key_value_metadata().unwrap().clone();
    let metadata = entries.into_iter().map(|entry| (entry.key, entry.value.unwrap())).collect();
    (reader.build().unwrap().map(Result::unwrap).collect(), metadata)
}

fn read_arrow(file: Vec<u8>) -> (Vec<RecordBatch>, Metadata) {
    let reader = arrow_ipc::reader::StreamReader::try_new(Cursor::new(file), None).unwrap();
    let metadata = reader.schema().metadata().clone().into();
    (reader.map(Result::unwrap).collect(), metadata)
}

/// Reads a table of `format` as the document that it corresponds to, and its metadata.
fn read(format: SessionFormat, file: Vec<u8>) -> (TraceView, Metadata) {
    let (batches, metadata) =
        if format == SessionFormat::Parquet { read_parquet(file) } else { read_arrow(file) };
    let mut trace = TraceView {
        thresholds: serde_json::from_str(&metadata["offbd.thresholds"]).unwrap(),
        ..TraceView::default()
    };
    batches.iter().for_each(|batch| append(&mut trace, batch));
    (trace, metadata)
}

async fn ask(client: &Client, path: &str, accept: &str) -> Answer {
    client.send(client.request(Method::GET, path).header("accept", accept)).await
}

/// Returns the trace as JSON, with all points.
async fn json_of(client: &Client, path: &str) -> TraceView {
    let separator = if path.contains('?') { '&' } else { '?' };
    let answer = client.get(&format!("{path}{separator}points=20000")).await;
    assert_eq!(answer.status, 200, "{}", answer.text);
    serde_json::from_str(&answer.text).unwrap()
}

async fn whole(client: &Client, path: &str, format: SessionFormat) -> (TraceView, Metadata) {
    let request = client.request(Method::GET, path).header("accept", format.media_type());
    let answer = request.send().await.unwrap();
    assert_eq!(answer.status(), 200, "{path}");
    assert_eq!(answer.headers()["content-type"], format.media_type());
    read(format, answer.bytes().await.unwrap().to_vec())
}

/// Imports `n` samples into the asset `a`; returns the id of the session.
async fn import(client: &Client, n: usize) -> String {
    client.asset("a").await;
    let recorded = rig(n, n / 2);
    let imported = client.post_text(IMPORT, "text/csv", csv(&recorded)).await.expect(201);
    imported["session"]["id"].as_str().unwrap().to_owned()
}

#[tokio::test]
async fn a_trace_is_the_same_in_each_format() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let id = import(client, 3000).await;
    let session = client.get(&format!("sessions/{id}")).await.expect(200);
    let hash = session["verdict"]["verdict_hash"].as_str().unwrap();
    for query in ["", "?from_s=5&to_s=12.5", "?profile=textbook", "?calibration=none"] {
        let path = format!("sessions/{id}/trace{query}");
        let expected = json_of(client, &path).await;
        assert!(expected.t_s.len() > 100, "{query}");
        for format in FORMATS {
            let (trace, metadata) = whole(client, &path, format).await;
            assert_eq!(trace, expected, "{format} {query}");
            assert_eq!(metadata["offbd.session"], "s");
            assert_eq!(metadata["offbd.version"], env!("CARGO_PKG_VERSION"));
            // The hash is that of the whole session, judged with its own settings.
            let is_recorded = query.is_empty();
            let found = metadata.get("offbd.verdict_hash").map(String::as_str);
            assert_eq!(found, is_recorded.then_some(hash), "{format} {query}");
            let asset: Value = serde_json::from_str(&metadata["offbd.asset_file"]).unwrap();
            let id = metadata.get("offbd.calibration_id").map(String::as_str);
            assert_eq!(asset["calibration"]["id"].as_str(), id, "{format} {query}");
            assert_eq!(id.is_none(), query == "?calibration=none", "{format} {query}");
            let profile = &asset["diagnostics"]["profile"];
            assert_eq!(*profile == json!("textbook"), query == "?profile=textbook", "{asset}");
        }
    }
}

#[tokio::test]
async fn what_a_table_of_a_trace_cannot_be_is_refused() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let id = import(client, 200).await;
    let path = format!("sessions/{id}/trace");
    for format in FORMATS {
        let kind = format.media_type();
        let problem = ask(client, &format!("{path}?points=50"), kind).await.problem(400);
        assert_eq!(problem["parameter"], "points", "{problem}");
        ask(client, &format!("{path}?calibration=other"), kind).await.problem(404);
        ask(client, "sessions/none/trace", kind).await.problem(404);
        let (trace, _) = whole(client, &format!("{path}?from_s=1e6"), format).await;
        assert!(trace.t_s.is_empty(), "a stretch without samples has no rows");
    }
    ask(client, &path, "text/csv").await.problem(406);
}

#[tokio::test]
async fn a_trace_of_a_damaged_recording_is_refused_or_breaks_off() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    // Evidence is renewed at every fifth sample, and a block has 8192 moments.
    for (name, n, status) in [("short", 9000, 500), ("long", 60_000, 200)] {
        client.post("assets", &registration(name)).await.expect(201);
        let path = IMPORT.replace("assets/a/", &format!("assets/{name}/"));
        let imported = client.post_text(&path, "text/csv", csv(&rig(n, n))).await.expect(201);
        let id = imported["session"]["id"].as_str().unwrap();
        let last = "SELECT MAX(first_index) FROM chunk WHERE session = $1";
        let sql =
            format!("UPDATE chunk SET data = $2 WHERE session = $1 AND first_index = ({last})");
        let mut db = fixture.store().await;
        for format in FORMATS {
            let path = format!("sessions/{id}/trace");
            whole(client, &path, format).await;
        }
        let query = sqlx::query(sqlx::AssertSqlSafe(sql)).bind(id).bind(&b"damaged"[..]);
        assert_eq!(query.execute(&mut db).await.unwrap().rows_affected(), 1);
        for format in FORMATS {
            let path = format!("sessions/{id}/trace");
            let request = client.request(Method::GET, &path).header("accept", format.media_type());
            let answer = request.send().await.unwrap();
            assert_eq!(answer.status(), status, "{name} {format}");
            assert_eq!(answer.bytes().await.is_err(), status == 200, "{name} {format}");
        }
    }
}

#[tokio::test]
async fn a_trace_on_the_command_line_is_that_of_the_service() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let id = import(client, 3000).await;
    let expected = json_of(client, &format!("sessions/{id}/trace")).await;
    let cli = CliFixture::new();
    cli.write("asset.json", &registration("a").to_string());
    let mut rows = csv(&rig(3000, 1500));
    // A row that repeats, and one that is none.
    let last = rows.lines().last().unwrap().to_owned();
    rows.push_str(&format!("{last}\nnonsense,,,,\n"));
    cli.write("s.csv", &rows);
    for format in FORMATS {
        let file = format!("trace.{}", format.suffix());
        cli.ok(&format!("export s.csv --asset asset.json --trace {file}"));
        let (trace, metadata) = read(format, std::fs::read(cli.path(&file)).unwrap());
        assert_eq!(trace, expected, "{format}");
        let judged = cli.ok("replay --asset asset.json --format json s.csv");
        assert_eq!(metadata["offbd.verdict_hash"], judged.summaries()[0]["verdict_hash"]);
    }
    cli.ok("export s.csv --asset asset.json -o both.csv --trace both.arrow");
    assert!(cli.path("both.csv").exists() && cli.path("both.arrow").exists());
    for wrong in ["--trace t.parquet", "--asset asset.json --trace t.csv", "--asset asset.json"] {
        cli.run(2, &format!("export s.csv {wrong}"));
    }
}
