//! Imported files that are made to harm the service: that expand a thousandfold, or whose parts
//! refer to each other many times.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;
use std::sync::OnceLock;

use mcap::WriteOptions;
use mcap::records::MessageHeader;
use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::json;
use tokio::task::JoinHandle;

use crate::support::process::Process;
use crate::support::workbook::{SHEET, STYLES, TEXTS, archive, sheet, workbook};
use crate::support::{Answer, Client, ServiceFixture, csv, eventually, rig};

const MCAP: &str = "application/vnd.mcap";
const XLSX: &str = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet";
const CSV: &str = "text/csv";

const ROW: &str = "<row><c><v>0</v></c><c><v>0</v></c><c><v>0</v></c><c/><c/></row>";

fn import(client: &Client, asset: &str, kind: &str, file: Vec<u8>) -> reqwest::RequestBuilder {
    let path = format!("assets/{asset}/sessions/import?name=s");
    client.request(Method::POST, &path).header("content-type", kind).body(file)
}

async fn imported(client: &Client, kind: &str, file: Vec<u8>) -> Answer {
    client.send(import(client, "a", kind, file)).await
}

async fn n_sessions(client: &Client) -> usize {
    client.get("sessions").await.expect(200)["items"].as_array().unwrap().len()
}

/// An MCAP file with these samples, and then `n_chunks` that expand to 15 MiB each.
fn mcap_file(samples: &[Sample], n_chunks: usize) -> Vec<u8> {
    let mut writer = WriteOptions::new().create(Cursor::new(Vec::new())).unwrap();
    let mut send = |schema: &str, messages: &[Vec<u8>]| {
        let schema = writer.add_schema(schema, "jsonschema", b"{}").unwrap();
        let channel_id = writer.add_channel(schema, "/x", "json", &BTreeMap::new()).unwrap();
        for message in messages {
            let header = MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
            writer.write_to_known_channel(&header, message).unwrap();
        }
        writer.flush().unwrap();
    };
    let view = |sample| serde_json::to_vec(&offbd::wire::telemetry::sample_view(sample)).unwrap();
    send("offbd.Sample", &samples.iter().map(view).collect::<Vec<_>>());
    send("other", &[vec![0; 15 << 20]]);
    writer.finish().unwrap();
    let file = writer.into_inner().into_inner();
    // The last chunk, as often as it is to be.
    let mut at = 8;
    let mut chunks = Vec::new();
    while at < file.len() - 8 {
        let length = u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
        if file[at] == mcap::records::op::CHUNK {
            chunks.push(at..at + 9 + length);
        }
        at += 9 + length;
    }
    let last = chunks.pop().unwrap();
    [&file[..last.start], &file[last.clone()].repeat(n_chunks), &file[last.end..]].concat()
}

/// A workbook whose sheet has a row, and behind it 390 MiB that say nothing.
fn long_workbook() -> Vec<u8> {
    static FILE: OnceLock<Vec<u8>> = OnceLock::new();
    let make = || {
        let gap = "<row/>".to_owned() + &" ".repeat(1000);
        let gaps = gap.repeat((390 << 20) / gap.len());
        workbook(&[(SHEET, sheet(&(ROW.to_owned() + &gaps)).as_bytes())])
    };
    FILE.get_or_init(make).clone()
}

/// Imports that are not over; they are broken off if this is dropped.
struct Sending(Vec<JoinHandle<Answer>>);

impl Sending {
    fn check_none_is_over(&self) {
        let over = self.0.iter().filter(|import| import.is_finished()).count();
        assert_eq!(over, 0, "imports are over before other requests");
    }
}

impl Drop for Sending {
    fn drop(&mut self) {
        self.0.iter().for_each(JoinHandle::abort);
    }
}

/// Waits until the service has so many bytes of bodies in memory, as long as `check` succeeds.
async fn until_bodies_have(client: &Client, n_bytes: usize, check: impl Fn()) {
    let line = format!("\noffbd_bodies_bytes {n_bytes}\n");
    eventually(async || {
        let metrics = client.get("/metrics").await.text;
        check();
        metrics.contains(&line).then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn files_that_take_long_to_read_keep_no_other_request_waiting() {
    const N: usize = 4;
    let samples = rig(100, 100);
    for (kind, file) in [(MCAP, mcap_file(&samples, 80)), (XLSX, long_workbook())] {
        let data = tempfile::tempdir().unwrap();
        let process = Process::start_with(data.path(), &[("TOKIO_WORKER_THREADS", Path::new("2"))]);
        let client = &process.client;
        client.asset("other").await;
        let mut sending = Sending(Vec::new());
        for i in 0..N {
            let asset = format!("a{i}");
            client.asset(&asset).await;
            let (client, file) = (client.clone(), file.clone());
            sending.0.push(tokio::spawn(async move {
                client.send(import(&client, &asset, kind, file)).await
            }));
        }
        until_bodies_have(client, N * file.len(), || sending.check_none_is_over()).await;
        assert_eq!(client.get("/healthz").await.status, 200);
        let ack = client.telemetry("other", Some("live"), &samples).await;
        assert_eq!(ack["accepted"], 100);
        sending.check_none_is_over();
        drop(sending);
        // Nobody reads on for clients that are gone.
        until_bodies_have(client, 0, || {}).await;
        eventually(async || (n_sessions(client).await == 1).then_some(())).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_without_its_client_ends_and_leaves_nothing() {
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    let client = &process.client;
    client.asset("a").await;
    let samples = rig(600_000, 2000);
    let sending = tokio::spawn(import(client, "a", CSV, csv(&samples).into_bytes()).send());
    eventually(async || {
        let sessions = client.get("sessions").await.expect(200);
        (sessions["items"][0]["samples"].as_u64() > Some(10_000)).then_some(())
    })
    .await;
    sending.abort();
    until_bodies_have(client, 0, || {}).await;
    eventually(async || (n_sessions(client).await == 0).then_some(())).await;
    let faults = client.get("assets/a/faults?status=all").await.expect(200);
    let is_new = |fault: &serde_json::Value| fault["status"] != "cleared";
    assert!(!faults["items"].as_array().unwrap().iter().any(is_new), "{faults}");
    let again = eventually(async || {
        let answer = imported(client, CSV, csv(&samples[..6000]).into_bytes()).await;
        (answer.status == 201).then_some(answer)
    });
    assert_eq!(again.await.json()["accepted"], 6000);
}

/// An archive in whose list 16 parts share the bytes of one with 30 MiB.
fn overlapping() -> Vec<u8> {
    let gap = "<row/>".to_owned() + &" ".repeat(1000);
    let one = archive(&[("xl/pa@", gap.repeat((30 << 20) / gap.len()).as_bytes())]);
    let end = one.len() - 22;
    let start = u32::from_le_bytes(one[end + 16..end + 20].try_into().unwrap()) as usize;
    let mut file = one[..start].to_vec();
    for letter in b'A'..=b'P' {
        let mut entry = one[start..end].to_vec();
        entry[46 + 5] = letter;
        file.extend(entry);
    }
    let list = (file.len() - start) as u32;
    file.extend(&one[end..end + 8]);
    file.extend([16, 0, 16, 0]);
    file.extend(list.to_le_bytes());
    file.extend(&one[end + 16..]);
    file
}

/// The styles of a workbook, `n` of which have a format of `length` bytes.
fn styles(n: usize, length: usize) -> String {
    let (format, style) = ("0".repeat(length), r#"<xf numFmtId="200"/>"#.repeat(n));
    format!(
        r#"<styleSheet><numFmts><numFmt numFmtId="200" formatCode="{format}"/></numFmts><cellXfs>{style}</cellXfs></styleSheet>"#
    )
}

/// A list of `n` empty texts that states another number of them.
fn texts(n: usize, stated: u64) -> String {
    format!(r#"<sst uniqueCount="{stated}">{}</sst>"#, "<si/>".repeat(n))
}

#[tokio::test]
async fn a_file_without_a_usable_row_is_not_a_session() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("live"), &rig(100, 100)).await;
    let head = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n";
    let rows = |row: &str| format!("{head}{}", row.repeat(5000)).into_bytes();
    for (file, reason) in [
        (head.as_bytes().to_vec(), "no usable row"),
        (rows("x,0,0,0,0\n"), "no usable row: line 2: `t_s`: `x` is not a number"),
        (rows("0,0,0,0\n"), "no usable row: line 2: no field `y_m`"),
    ] {
        let problem = imported(client, CSV, file).await.problem(400);
        assert!(problem["detail"].as_str().unwrap().starts_with(reason), "{problem}");
        let sessions = client.get("sessions").await.expect(200);
        assert_eq!(sessions["items"][0]["state"], "open", "{reason}: {sessions}");
        assert_eq!(n_sessions(client).await, 1, "{reason}");
    }
    // What only the rig's limits reject.
    let problem = imported(client, CSV, rows("0,0,0,1e3,0\n")).await.problem(400);
    assert_eq!(problem["detail"], "no usable row: x_m is 1000, beyond ±50");
    assert_eq!(n_sessions(client).await, 1);
}

#[tokio::test]
async fn a_file_that_expands_too_far_is_refused_and_nothing_of_it_is_kept() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(6000, 2000);
    let one_row = sheet(ROW);
    let of_sheet = |sheet: &str| workbook(&[(SHEET, sheet.as_bytes())]);
    let with = |name, part: &str| workbook(&[(SHEET, one_row.as_bytes()), (name, part.as_bytes())]);
    let names: String = (0..20_000).map(|i| format!("xl/{i:050}")).collect();
    let names: Vec<_> = (0..20_000).map(|i| (&names[i * 53..(i + 1) * 53], &b""[..])).collect();
    let kept = "the list of its texts and styles expands to more than 67108864 bytes";
    for (kind, file, reason) in [
        (MCAP, mcap_file(&samples, 80), "the file expands to more than 1073741824 bytes"),
        (XLSX, long_workbook(), "the file expands to more than 402653184 bytes"),
        (XLSX, overlapping(), "the file expands to more than 402653184 bytes"),
        (XLSX, archive(&names), "the list of its parts expands to more than 1048576 bytes"),
        (
            XLSX,
            of_sheet(&sheet(&" ".repeat(2 << 20))),
            "a tag or a text of the file expands to more than 1048576 bytes",
        ),
        (
            XLSX,
            of_sheet(&sheet(&format!("<row><c><is>{}</is></c></row>", "<b>1</b>".repeat(1 << 18)))),
            "a tag or a text of the file expands to more than 1048576 bytes",
        ),
        (XLSX, with(TEXTS, &texts(1 << 20, 1)[..]), kept),
        (XLSX, with(TEXTS, &texts(1, 400_000_000_000)), "it states a number of texts"),
        (XLSX, with(STYLES, &styles(20_000, 200_000)), kept),
        (XLSX, of_sheet(&"<a>".repeat(100_000)), "its elements are nested deeper than 64"),
    ] {
        let problem = imported(client, kind, file).await.problem(400);
        assert!(problem["detail"].as_str().unwrap().contains(reason), "{problem}");
        assert_eq!(n_sessions(client).await, 0, "{reason}");
    }
    let faults = client.get("assets/a/faults?status=all").await.expect(200);
    assert_eq!(faults["items"], json!([]), "{faults}");
    let whole = imported(client, MCAP, mcap_file(&samples, 10)).await.expect(201);
    assert_eq!(whole["accepted"], 6000);
}

/// Short workbooks whose parts would need gigabytes, if they were believed or copied.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_short_workbook_takes_no_gigabytes_of_memory() {
    const LIMIT: f64 = 300e6;
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    let client = &process.client;
    client.asset("a").await;
    let one_row = sheet(ROW);
    let (texts, styles) = (texts(1_000_000, 9_999_999), styles(50_000, 200));
    let text = format!("<sst><si><t>{}</t></si></sst>", "1".repeat(500_000));
    let quoting = sheet(&r#"<row><c t="s"><v>0</v></c></row>"#.repeat(10_000));
    let naming = format!(
        "<worksheet><sheetData><row>{}</row></sheetData></worksheet>",
        r#"<c t="s"><v>0</v></c>"#.repeat(10_000)
    );
    let with = |sheet: &str, name, part: &str| {
        workbook(&[(SHEET, sheet.as_bytes()), (name, part.as_bytes())])
    };
    for (file, status) in [
        (with(&one_row, TEXTS, &texts), 201),
        (with(&one_row, STYLES, &styles), 201),
        (with(&quoting, TEXTS, &text), 400),
        (with(&naming, TEXTS, &text), 400),
    ] {
        assert!(file.len() < 100_000, "{}", file.len());
        let sending = {
            let client = client.clone();
            tokio::spawn(async move { imported(&client, XLSX, file).await })
        };
        let mut most: f64 = 0.0;
        while !sending.is_finished() {
            most = most.max(client.resident_bytes().await);
            assert!(most < LIMIT, "{most} bytes");
        }
        println!("at most {most} bytes");
        let view = sending.await.unwrap().expect(status);
        if let Some(id) = view["session"]["id"].as_str() {
            client.delete(&format!("sessions/{id}")).await.expect(204);
        }
    }
}

/// A reader of a library that panics on a damaged file is not a panic of the service.
#[cfg(feature = "parquet")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_file_leaves_no_backtrace_in_the_log() {
    use offbd::wire::session_file;
    use offbd::wire::table::TableOptions;
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/formats/polars.arrow");
    let whole = std::fs::read(file).unwrap();
    let damaged = |at: usize| {
        let mut file = whole.clone();
        file[at] ^= 0xff;
        file
    };
    let contradicts = |file: &Vec<u8>| {
        let rows = session_file::open(Cursor::new(file.clone()), None, &TableOptions::default());
        let error = match rows {
            Ok(rows) => rows.filter_map(Result::err).last().map(|error| error.to_string()),
            Err(error) => Some(error.to_string()),
        };
        error.is_some_and(|error| error.contains("contradict each other"))
    };
    let file = (0..whole.len()).map(damaged).find(contradicts).expect("a reader panics");
    let data = tempfile::tempdir().unwrap();
    let process = Process::start_with(data.path(), &[("RUST_BACKTRACE", Path::new("1"))]);
    process.client.asset("a").await;
    let kind = "application/vnd.apache.arrow.stream";
    let refused = imported(&process.client, kind, file).await.problem(400);
    assert!(refused["detail"].as_str().unwrap().contains("contradict each other"), "{refused}");
    let log = process.log();
    assert!(!log.contains("panicked"), "{log}");
}
