//! The parsers under test. Each parses an input, checks what it accepted, and returns the
//! kind of the result.

use offbd::service::access::Role;
use offbd::service::access::jwt::{KeySet, MAX_SUBJECT, verify};
use offbd::store::codec::ChunkKey;
use offbd::wire::bus::{TopicError, TopicStyle, encoded};
use offbd::wire::mapping::Mapping;
use offbd::wire::table::{ColumnMapping, TableOptions, TableReader};
use offbd::wire::telemetry::{self, Batch, BatchError};
use offbd::wire::{asset, session_csv, session_file};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Rig, Setup, calibrate};
use offbd_core::vocabulary::Sample;
use offbd_scene_file as scene;

use crate::support::provider::{self, Key};

pub type Parser = fn(&[u8]) -> String;

/// Every parser, with the directory of its corpus.
pub const PARSERS: [(&str, Parser); 15] = [
    ("json", |input| batch(telemetry::json(input, LIMIT))),
    ("msgpack", |input| batch(telemetry::msgpack(input, LIMIT))),
    ("ndjson", |input| batch(telemetry::ndjson(input, LIMIT))),
    ("csv", |input| batch(telemetry::csv(input, &TableOptions::default(), LIMIT))),
    ("session_file", session_file),
    ("calibration", calibration),
    ("asset", asset_file),
    ("scene", scene_file),
    ("chunk", chunk),
    ("moment", timestamp),
    ("jwt", jwt),
    ("jwks", jwks),
    ("mapped", mapped),
    ("topic", topic),
    ("columns", columns),
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

/// Reads a file of any format that the build has, and as many rows of it as of a batch.
fn session_file(input: &[u8]) -> String {
    let source = std::io::Cursor::new(input.to_vec());
    let rows = match session_file::open(source, None, &TableOptions::default()) {
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

/// A topic of a device, which must be that of the asset in it.
fn topic(input: &[u8]) -> String {
    let text = String::from_utf8_lossy(input);
    match TopicStyle::Mqtt.parse(&text) {
        Ok((asset, kind)) => {
            assert_eq!(TopicStyle::Mqtt.topic(&[&encoded(&asset), kind.as_str()]), text);
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
    match offbd::store::codec::decode(input, key) {
        Ok(samples) => format!("{} samples", samples.len().min(3)),
        Err(error) => kind(&error.to_string()),
    }
}

/// A timestamp of a query or a request body.
fn timestamp(input: &[u8]) -> String {
    match offbd::service::parse_timestamp(&String::from_utf8_lossy(input)) {
        Ok(timestamp) => format!("a timestamp {}", timestamp < 0),
        Err(reason) => kind(&reason),
    }
}

/// A time in 2027, when the tokens of the corpus are valid, µs since 1970.
const NOW: i64 = 1_800_000_000_000_000;

/// A token of an identity provider: the first line of the input is its header, the rest its
/// claims; it is signed with the provider's key.
fn jwt(input: &[u8]) -> String {
    let key = Key::new("k");
    let end = input.iter().position(|byte| *byte == b'\n').unwrap_or(input.len());
    let (header, claims) = input.split_at(end);
    let claims = claims.strip_prefix(b"\n").unwrap_or(claims);
    let message = format!("{}.{}", provider::base64(header), provider::base64(claims));
    let token = format!("{message}.{}", provider::base64(key.sign(message.as_bytes())));
    let keys = KeySet::parse(provider::jwks(&[&key]).as_bytes()).unwrap();
    match verify(&token, &keys, &provider::config("").expected(), NOW) {
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
        let refusal = verify(&forged, &keys, &provider::config("").expected(), NOW).unwrap_err();
        kind(&refusal.to_string())
    });
    format!("{} {}", keys.n_keys().min(3), refusals.join(" "))
}
