//! The parsers under test. Each parses an input, checks what it accepted, and returns the
//! kind of the result. `fuzz/` contains these parsers too, so this file uses only crates that
//! `fuzz/Cargo.toml` names.

use std::cell::LazyCell;
use std::io::Cursor;

use axum::body::Body;
use futures_util::StreamExt;
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Rig, Setup, calibrate};
use offbd_core::vocabulary::Sample;
use offbd_fmu_model::{Instance, Refusal, StartValues, VARIABLES, path_of_location};
use offbd_net::coding::Coding;
use offbd_scene_file as scene;
use offbd_service::access::Role;
use offbd_service::access::jwt::{KeySet, MAX_SUBJECT, verify};
use offbd_store::codec::{ChunkKey, decode};
use offbd_wire::bus::{TopicError, TopicStyle, encoded};
use offbd_wire::inspection::inspect;
use offbd_wire::mapping::Mapping;
use offbd_wire::table::{ColumnMapping, TableOptions, TableReader};
use offbd_wire::telemetry::{self, Batch, BatchError};
use offbd_wire::{asset, json, session_csv, session_file};
use tokio::runtime::{Builder, Runtime};

use crate::support::provider::{self, Key};
#[cfg(feature = "xlsx")]
use crate::support::workbook::{self, DOCUMENT, SHEET, STYLES, TEXTS};

pub type Parser = fn(&[u8]) -> String;

/// Every parser, with the directory of its corpus.
pub const PARSERS: &[(&str, Parser)] = &[
    ("json", |input| batch(telemetry::json(input, LIMIT))),
    ("msgpack", |input| batch(telemetry::msgpack(input, LIMIT))),
    ("ndjson", |input| batch(telemetry::ndjson(input, LIMIT))),
    ("csv", |input| batch(telemetry::csv(input, &TableOptions::default(), LIMIT))),
    ("mapped_csv", mapped_csv),
    ("session_file", |input| session_file(input.to_vec())),
    #[cfg(feature = "xlsx")]
    ("workbook", workbook),
    ("inspection", inspection),
    ("calibration", calibration),
    ("asset", asset_file),
    ("scene", scene_file),
    ("chunk", chunk),
    ("moment", timestamp),
    ("jwt", jwt),
    ("jwks", jwks),
    ("mapped", mapped),
    ("mapping", mapping),
    ("topic", topic),
    ("columns", columns),
    ("coding", coding),
    ("fmu_state", fmu_state),
    ("start_values", start_values),
    ("location", location),
];

/// Largest number of samples of a batch.
const LIMIT: usize = 200;

/// Longest reason given for a row, bytes.
const MAX_REASON_BYTES: usize = 300;

/// Returns the first words of a message, without numbers and punctuation, which depend on the
/// input.
fn kind(text: &str) -> String {
    let words = text.split(|c: char| !c.is_ascii_alphabetic() && c != '_');
    words.filter(|word| word.len() > 1).take(12).collect::<Vec<_>>().join(" ")
}

/// A mapping of columns; what is written is read back.
fn columns(input: &[u8]) -> String {
    let text = String::from_utf8_lossy(input);
    match text.parse::<ColumnMapping>() {
        Ok(mapping) => {
            let again = mapping.to_string().parse::<ColumnMapping>();
            format!("mapping {}", again == Ok(mapping))
        }
        Err(error) => kind(&error.to_string()),
    }
}

/// A table whose columns are mapped by the first line of the input.
fn mapped_csv(input: &[u8]) -> String {
    let (mapping, table) = split_line(input);
    let columns = match String::from_utf8_lossy(mapping).parse::<ColumnMapping>() {
        Ok(columns) => columns,
        Err(error) => return kind(&error.to_string()),
    };
    batch(telemetry::csv(table, &TableOptions { columns, ..TableOptions::default() }, LIMIT))
}

/// Splits off the first line.
fn split_line(input: &[u8]) -> (&[u8], &[u8]) {
    let end = input.iter().position(|byte| *byte == b'\n').unwrap_or(input.len());
    let (line, rest) = input.split_at(end);
    (line, rest.strip_prefix(b"\n").unwrap_or(rest))
}

/// A recording of which a person wants to know what it contains. The columns that the result
/// proposes must be a mapping.
fn inspection(input: &[u8]) -> String {
    let view = match inspect(Cursor::new(input.to_vec()), &TableOptions::default()) {
        Ok(view) => view,
        Err(error) => return kind(&error.to_string()),
    };
    assert!(view.mapping.parse::<ColumnMapping>().is_ok(), "{}", view.mapping);
    serde_json::to_string(&view).unwrap();
    let (n_remarks, n_quantities) = (view.remarks.len().min(3), view.quantities.len());
    format!("{} {n_remarks} {n_quantities} {}", view.format, view.runs.min(2))
}

/// The parts of a workbook, with a zero byte between two: the sheet, the texts that cells share,
/// the styles and the list of sheets. A whole workbook has checksums, which mutations break.
#[cfg(feature = "xlsx")]
fn workbook(input: &[u8]) -> String {
    let parts = input.splitn(4, |byte| *byte == 0);
    let parts: Vec<(&str, &[u8])> =
        [SHEET, TEXTS, STYLES, DOCUMENT].into_iter().zip(parts).collect();
    session_file(workbook::workbook(&parts))
}

/// Reads a file of any format that the build has, and as many rows of it as of a batch.
fn session_file(input: Vec<u8>) -> String {
    let rows = match session_file::open(Cursor::new(input), None, &TableOptions::default()) {
        Ok(rows) => rows,
        Err(error) => return kind(&error.to_string()),
    };
    let mut samples = Vec::new();
    for row in rows.take(LIMIT) {
        match row {
            Ok(sample) => samples.push(sample),
            Err(error) => return kind(&error.to_string()),
        }
    }
    assert!(samples.iter().all(is_finite), "{samples:?}");
    judge(&samples);
    "rows".to_owned()
}

fn batch(read: Result<Batch, BatchError>) -> String {
    let batch = match read {
        Ok(batch) => batch,
        Err(error) => return kind(&error.to_string()),
    };
    assert!(batch.rows.len() <= LIMIT);
    let refused: Vec<&String> = batch.rows.iter().filter_map(|row| row.as_ref().err()).collect();
    assert!(refused.iter().all(|reason| reason.len() <= MAX_REASON_BYTES), "{refused:?}");
    let samples: Vec<Sample> =
        batch.rows.iter().filter_map(|row| row.as_ref().ok()).copied().collect();
    if samples.iter().all(is_finite) {
        assert_eq!(written_and_read(&samples), samples);
    }
    judge(&samples);
    let first = refused.first().map_or(String::new(), |reason| kind(reason));
    let named = (batch.session.is_some(), batch.id.is_some());
    format!("taken {named:?} {} {first}", samples.len().min(3))
}

/// A payload of a device with its own format.
fn mapped(input: &[u8]) -> String {
    let topic = serde_json::json!({
        "pattern": "a", "asset": "a", "samples": "/s", "session": "/n", "seq": "/q",
        "t": { "pointer": "/t", "unit": "ms" },
        "x": { "pointer": "/p/0", "unit": "mm", "negate": true },
        "qy": { "pointer": "/p/1", "unit": "deg" },
    });
    let view = serde_json::from_value(serde_json::json!({ "topics": [topic] })).unwrap();
    let mapping = Mapping::new(view).unwrap();
    let (entry, _) = mapping.find("a").unwrap();
    batch(entry.batch(input, LIMIT))
}

/// A mapping file: the first topic gets a message.
fn mapping(input: &[u8]) -> String {
    let mapping = match json::parse(input).and_then(Mapping::new) {
        Ok(mapping) => mapping,
        Err(error) => return kind(&error.to_string()),
    };
    let topics: Vec<String> = mapping.filters().collect();
    let Some(topic) = topics.first() else { return "no topic".to_owned() };
    let payload = br#"{"n":"a","q":1,"t":0.5,"p":[1,2],"s":[{"t":0,"p":[1,2]}]}"#;
    match mapping.find(&topic.replace('+', "a")) {
        Some((entry, asset)) => format!("{} {}", asset.is_ok(), batch(entry.batch(payload, LIMIT))),
        None => "no entry".to_owned(),
    }
}

/// A topic of a device, which must be that of the asset in it.
fn topic(input: &[u8]) -> String {
    let text = String::from_utf8_lossy(input);
    let style = if text.contains('/') { TopicStyle::Mqtt } else { TopicStyle::Nats };
    match style.parse(&text) {
        Ok((asset, kind)) => {
            assert_eq!(style.topic(&[&encoded(&asset), kind.as_str()]), text);
            kind.as_str().to_owned()
        }
        Err(TopicError::Foreign { .. }) => "foreign".to_owned(),
        Err(TopicError::Name { .. }) => "name".to_owned(),
    }
}

fn is_finite(sample: &Sample) -> bool {
    let Sample { t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m, .. } = *sample;
    t_s.is_finite() && [cmd_qx_rad, cmd_qy_rad, x_m, y_m].into_iter().flatten().all(f64::is_finite)
}

fn written_and_read(samples: &[Sample]) -> Vec<Sample> {
    let mut text = Vec::new();
    session_csv::write(&mut text, samples).unwrap();
    TableReader::batch(text.as_slice(), &TableOptions::default())
        .unwrap()
        .map(|row| row.unwrap())
        .collect()
}

/// Checks that the engine does not panic.
fn judge(samples: &[Sample]) {
    let setup = Setup::new(Rig::chapter("fuzz"), None).unwrap();
    let mut engine = Engine::new(setup, FaultMemory::default());
    let mut transitions = Vec::new();
    for sample in samples {
        engine.handle(Input::Sample(*sample), &mut transitions);
    }
    engine.handle(Input::End, &mut transitions);
}

/// A recording from which a rig is calibrated.
fn calibration(input: &[u8]) -> String {
    let reader = match TableReader::batch(input, &TableOptions::default()) {
        Ok(reader) => reader,
        Err(error) => return kind(&error.to_string()),
    };
    let samples: Vec<Sample> = reader.filter_map(Result::ok).collect();
    match calibrate(&Rig::chapter("fuzz"), &[samples]) {
        Ok(learnt) => {
            let rig = Rig { calibration: Some(Box::new(learnt)), ..Rig::chapter("fuzz") };
            let file = serde_json::to_vec(&asset::view(&rig)).unwrap();
            let again = asset::parse(&file).map(|rig| asset::view(&rig));
            format!("learnt {}", again.is_ok())
        }
        Err(error) => kind(&error.to_string()),
    }
}

fn asset_file(input: &[u8]) -> String {
    let rig = match asset::parse(input) {
        Ok(rig) => rig,
        Err(error) => return kind(&error.to_string()),
    };
    let file = serde_json::to_string(&asset::view(&rig)).unwrap();
    let again = asset::parse(file.as_bytes()).unwrap();
    assert_eq!(serde_json::to_string(&asset::view(&again)).unwrap(), file);
    match Setup::new(rig, None) {
        Ok(setup) => {
            let mut engine = Engine::new(setup, FaultMemory::default());
            let mut transitions = Vec::new();
            for i in 0..20 {
                let t_s = f64::from(i) * 0.01;
                let (x_m, y_m) = (Some(0.01), Some(-0.01));
                let sample = Sample {
                    seq: None,
                    t_s,
                    cmd_qx_rad: Some(0.0),
                    cmd_qy_rad: Some(0.0),
                    x_m,
                    y_m,
                };
                engine.handle(Input::Sample(sample), &mut transitions);
            }
            format!("a rig {}", again.calibration.is_some())
        }
        Err(error) => kind(&error.to_string()),
    }
}

fn scene_file(input: &[u8]) -> String {
    match scene::parse(input) {
        Ok(scene) => {
            assert!(!scene.name.is_empty());
            assert_eq!(scene::parse(input), Ok(scene));
            "a scene".to_owned()
        }
        Err(error) => kind(&error.to_string()),
    }
}

/// A chunk, the compressed form of samples in the store.
fn chunk(input: &[u8]) -> String {
    let key = ChunkKey { session: "s", first_index: 0 };
    match decode(input, key) {
        Ok(samples) => format!("{} samples", samples.len().min(3)),
        Err(error) => kind(&error.to_string()),
    }
}

/// A timestamp of a query or a request body.
fn timestamp(input: &[u8]) -> String {
    match offbd_service::parse_timestamp(&String::from_utf8_lossy(input)) {
        Ok(timestamp) => format!("a timestamp {}", timestamp < 0),
        Err(reason) => kind(&reason),
    }
}

/// A time in 2027, when the tokens of the corpus are valid, µs since 1970.
const NOW: i64 = 1_800_000_000_000_000;

/// A token of an identity provider: the first line of the input is its header, the rest its
/// claims; it is signed with the provider's key.
fn jwt(input: &[u8]) -> String {
    thread_local! {
        static KEY: LazyCell<Key> = LazyCell::new(|| Key::new("k"));
    }
    let (header, claims) = split_line(input);
    let message = format!("{}.{}", provider::base64(header), provider::base64(claims));
    let (signature, jwks) =
        KEY.with(|key| (key.sign(message.as_bytes()), provider::jwks(&[&**key])));
    let token = format!("{message}.{}", provider::base64(signature));
    let keys = KeySet::parse(jwks.as_bytes()).unwrap();
    match verify(&token, &keys, &provider::expected(), NOW) {
        Ok(verified) => {
            assert!((1..=MAX_SUBJECT).contains(&verified.subject.len()));
            assert!(verified.expires_at > NOW);
            assert_eq!(verified.role == Role::Device, verified.asset.is_some());
            format!("{} {}", verified.role, verified.expires_at == i64::MAX)
        }
        Err(refusal) => kind(&refusal.to_string()),
    }
}

/// The key set of an identity provider, tried with forged tokens.
fn jwks(input: &[u8]) -> String {
    let keys = match KeySet::parse(input) {
        Ok(keys) => keys,
        Err(error) => return kind(&error.to_string()),
    };
    let claims = provider::claims("s", "admin");
    let refusals = ["EdDSA", "ES256", "ES384", "RS256", "PS512"].map(|algorithm| {
        let header = serde_json::json!({ "alg": algorithm, "kid": "k" });
        let forged = provider::token(&header, &claims, |_| vec![1; 64]);
        let refusal = verify(&forged, &keys, &provider::expected(), NOW).unwrap_err();
        kind(&refusal.to_string())
    });
    format!("{} {}", keys.n_keys().min(3), refusals.join(" "))
}

/// A compressed body of a request: the first byte says how.
fn coding(input: &[u8]) -> String {
    /// Most bytes of the body.
    const MOST: usize = 1 << 20;
    thread_local! {
        static RUNTIME: LazyCell<Runtime> =
            LazyCell::new(|| Builder::new_current_thread().build().unwrap());
    }
    let Some((first, body)) = input.split_first() else { return "empty".to_owned() };
    let coding = match first {
        b'g' => Coding::Gzip,
        b'z' => Coding::Zstd,
        _ => Coding::Identity,
    };
    let mut pieces = coding.decode(Body::from(body.to_vec()), MOST);
    RUNTIME.with(|runtime| {
        runtime.block_on(async {
            let mut n_bytes = 0;
            while let Some(piece) = pieces.next().await {
                match piece {
                    Ok(piece) => n_bytes += piece.len(),
                    Err(error) => return kind(&error.to_string()),
                }
                assert!(n_bytes <= MOST, "{n_bytes} bytes");
            }
            format!("{coding:?} {}", n_bytes.min(3))
        })
    })
}

/// The saved state of an FMU, which does a step if it can.
fn fmu_state(input: &[u8]) -> String {
    let mut instance = match Instance::from_bytes(input) {
        Ok(instance) => instance,
        Err(refusal) => return kind(&refusal.to_string()),
    };
    let saved = instance.to_bytes().unwrap();
    assert_eq!(Instance::from_bytes(&saved).unwrap().to_bytes().unwrap(), saved);
    let values = (0..=VARIABLES.len()).filter_map(|n| instance.get(u32::try_from(n).unwrap()).ok());
    let n_values = values.count();
    let initialized = instance.enter_initialization().and_then(|()| instance.exit_initialization());
    let from_s = instance.get(0).unwrap_or(0.0);
    let step = instance.step(from_s, 0.01);
    let results = [initialized, step].map(|result| result.err().map(|e| kind(&e.to_string())));
    format!("{n_values} {results:?}")
}

/// The start values of an FMU; what is written is read back.
fn start_values(input: &[u8]) -> String {
    match StartValues::parse(&String::from_utf8_lossy(input)) {
        Ok(values) => {
            assert!(StartValues::parse(&values.to_text()) == Ok(values), "what is written is read");
            "values".to_owned()
        }
        Err(error) => kind(&error.to_string()),
    }
}

/// The place of the files of an FMU, which an importer names.
fn location(input: &[u8]) -> String {
    match path_of_location(&String::from_utf8_lossy(input)) {
        Ok(path) => format!("a path {} {}", path.is_absolute(), path.starts_with("/a")),
        Err(Refusal::Location { why, .. }) => kind(why),
        Err(other) => kind(&other.to_string()),
    }
}
