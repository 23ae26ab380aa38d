//! Topics of devices that have their own formats: which topic is which asset, and where in
//! a JSON payload the quantities of a sample are, in which unit and with which sign. Axes are
//! exchanged by exchanging their pointers.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;

use super::bus::{TopicError, decoded, encoded};
use super::telemetry::{Batch, BatchError, MAX_SEQ};
use offbd_core::vocabulary::{Invalid, Sample};

/// Most topics of a mapping; one more is refused at the start.
pub const MAX_MAPPED_TOPICS: usize = 256;

/// The level of a pattern that is the name of the asset.
const ASSET_LEVEL: &str = "{asset}";

/// A mapping file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MappingView {
    pub topics: Vec<MappedTopicView>,
}

/// One topic of a mapping file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MappedTopicView {
    /// The topic; the level `{asset}` is the name of the asset, `+` is any level.
    pub pattern: String,
    /// The asset, if the pattern has no `{asset}`.
    pub asset: Option<String>,
    /// Pointer to an array of samples; without it the payload is one sample.
    pub samples: Option<String>,
    /// Pointer to the name of the session, from the root of the payload.
    pub session: Option<String>,
    /// Pointer to the number of the sample.
    pub seq: Option<String>,
    /// Time on the device's clock.
    pub t: MappedValueView<TimeUnitWord>,
    /// Position of the ball along x.
    pub x: Option<MappedValueView<LengthUnitWord>>,
    /// Position of the ball along y.
    pub y: Option<MappedValueView<LengthUnitWord>>,
    /// Command of the plate angle about x.
    pub qx: Option<MappedValueView<AngleUnitWord>>,
    /// Command of the plate angle about y.
    pub qy: Option<MappedValueView<AngleUnitWord>>,
}

/// Where a quantity is, in which unit, and whether its sign is the opposite one.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MappedValueView<U> {
    /// JSON pointer (RFC 6901) within the sample.
    pub pointer: String,
    pub unit: U,
    #[serde(default)]
    pub negate: bool,
}

/// A unit of a quantity, by how many of it make the SI unit.
trait Unit: Copy {
    fn per_si(self) -> f64;
}

/// Defines a closed set of units, each with how many of it make the SI unit.
macro_rules! units {
    ($(#[$doc:meta])* $name:ident { $($variant:ident = $word:literal: $per_si:expr),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
        pub enum $name { $(#[serde(rename = $word)] $variant),+ }

        impl Unit for $name {
            fn per_si(self) -> f64 {
                match self { $(Self::$variant => $per_si),+ }
            }
        }
    };
}

units! {
    /// A unit of time.
    TimeUnitWord { Second = "s": 1.0, Millisecond = "ms": 1e3, Microsecond = "us": 1e6 }
}
units! {
    /// A unit of length.
    LengthUnitWord { Metre = "m": 1.0, Centimetre = "cm": 1e2, Millimetre = "mm": 1e3 }
}
units! {
    /// A unit of angle.
    AngleUnitWord { Radian = "rad": 1.0, Degree = "deg": 180.0 / std::f64::consts::PI }
}

/// The checked topics of a mapping file.
#[derive(Clone, Debug, Default)]
pub struct Mapping {
    topics: Vec<Arc<MappedTopic>>,
}

/// A checked topic.
#[derive(Clone, Debug)]
pub struct MappedTopic {
    view: MappedTopicView,
}

impl Mapping {
    /// Checks a mapping file.
    ///
    /// # Errors
    /// [`Invalid`] with the pointer of the first invalid key.
    pub fn new(view: MappingView) -> Result<Self, Invalid> {
        if view.topics.len() > MAX_MAPPED_TOPICS {
            let reason = format!("has more than {MAX_MAPPED_TOPICS} topics");
            return Err(Invalid::new("/topics", reason));
        }
        let mut filters = BTreeSet::new();
        for (i, topic) in view.topics.iter().enumerate() {
            let at =
                |(key, reason): (String, String)| Invalid::new(format!("/topics/{i}{key}"), reason);
            check(topic).map_err(at)?;
            if !filters.insert(filter(&topic.pattern)) {
                let reason =
                    format!("`{}` matches the same topics as an earlier one", topic.pattern);
                return Err(at(("/pattern".to_owned(), reason)));
            }
        }
        Ok(Self {
            topics: view.topics.into_iter().map(|view| Arc::new(MappedTopic { view })).collect(),
        })
    }

    /// Returns the filters to subscribe to.
    pub fn filters(&self) -> impl Iterator<Item = String> {
        self.topics.iter().map(|topic| filter(&topic.view.pattern))
    }

    /// Returns the first entry for `topic`, with the name of its asset.
    #[must_use]
    pub fn find(&self, topic: &str) -> Option<(Arc<MappedTopic>, Result<String, TopicError>)> {
        self.topics.iter().find_map(|entry| Some((entry.clone(), entry.asset(topic)?)))
    }
}

/// Returns the MQTT filter of a pattern.
fn filter(pattern: &str) -> String {
    pattern.replace(ASSET_LEVEL, "+")
}

/// Checks a topic; an error is the key and the reason.
fn check(topic: &MappedTopicView) -> Result<(), (String, String)> {
    check_pattern(topic).map_err(|reason| ("/pattern".to_owned(), reason))?;
    if let Some(asset) = &topic.asset {
        let level = encoded(asset);
        decoded(&level).map_err(|error| ("/asset".to_owned(), error.to_string()))?;
    }
    let pointer = |value: Option<&String>, key: &str| check_pointer(value, key);
    pointer(topic.samples.as_ref(), "/samples")?;
    pointer(topic.session.as_ref(), "/session")?;
    pointer(topic.seq.as_ref(), "/seq")?;
    pointer(Some(&topic.t.pointer), "/t/pointer")?;
    pointer(topic.x.as_ref().map(|value| &value.pointer), "/x/pointer")?;
    pointer(topic.y.as_ref().map(|value| &value.pointer), "/y/pointer")?;
    pointer(topic.qx.as_ref().map(|value| &value.pointer), "/qx/pointer")?;
    pointer(topic.qy.as_ref().map(|value| &value.pointer), "/qy/pointer")
}

fn check_pattern(topic: &MappedTopicView) -> Result<(), String> {
    let pattern = &topic.pattern;
    let levels: Vec<&str> = pattern.split('/').collect();
    let is_plain = |level: &str| {
        ["+", ASSET_LEVEL].contains(&level) || !level.contains(['+', '#', '{', '}', '\0'])
    };
    let n_assets = levels.iter().filter(|level| **level == ASSET_LEVEL).count();
    if pattern.is_empty() || !levels.iter().all(|level| is_plain(level)) {
        return Err(format!(
            "`{pattern}` is not levels of text, `+` or `{{asset}}` with `/` between"
        ));
    }
    if pattern.starts_with('$') || ["offbd", "+", ASSET_LEVEL].contains(&levels[0]) {
        return Err(format!("`{pattern}` could be a topic of offbd or of the broker"));
    }
    match (n_assets, &topic.asset) {
        (1, None) | (0, Some(_)) => Ok(()),
        (0, None) => Err(format!("`{pattern}` has no `{{asset}}`, and there is no key `asset`")),
        (1, Some(_)) => Err(format!("`{pattern}` has `{{asset}}`, and there is a key `asset`")),
        _ => Err(format!("`{pattern}` has more than one `{{asset}}`")),
    }
}

fn check_pointer(pointer: Option<&String>, key: &str) -> Result<(), (String, String)> {
    match pointer {
        Some(pointer) if !pointer.is_empty() && !pointer.starts_with('/') => Err((
            key.to_owned(),
            format!("`{pointer}` is not a JSON pointer: it must begin with `/`"),
        )),
        _ => Ok(()),
    }
}

impl MappedTopic {
    /// Returns the name of the asset of `topic`; `None` if the pattern does not match.
    fn asset(&self, topic: &str) -> Option<Result<String, TopicError>> {
        let mut asset = self.view.asset.clone().map(Ok);
        let (mut pattern, mut levels) = (self.view.pattern.split('/'), topic.split('/'));
        loop {
            match (pattern.next(), levels.next()) {
                (None, None) => return asset,
                (Some(ASSET_LEVEL), Some(level)) => asset = Some(decoded(level)),
                (Some("+"), Some(_)) => {}
                (Some(wanted), Some(level)) if wanted == level => {}
                _ => return None,
            }
        }
    }

    /// Parses a payload, with at most `limit` samples. A sample that cannot be read is an
    /// invalid row.
    ///
    /// # Errors
    /// [`BatchError`] if the payload is not JSON, or does not have the session or the samples
    /// that it must have.
    pub fn batch(&self, payload: &[u8], limit: usize) -> Result<Batch, BatchError> {
        let malformed = |pointer: &str, reason: String| BatchError::Malformed {
            pointer: pointer.to_owned(),
            reason,
        };
        let document: Value =
            serde_json::from_slice(payload).map_err(|error| malformed("", error.to_string()))?;
        let samples = match &self.view.samples {
            None => std::slice::from_ref(&document),
            Some(pointer) => match document.pointer(pointer) {
                Some(Value::Array(samples)) => samples,
                _ => return Err(malformed(pointer, "must be an array of samples".to_owned())),
            },
        };
        if samples.len() > limit {
            return Err(BatchError::TooMany { found: samples.len(), limit });
        }
        let session = match self.view.session.as_ref().map(|p| (p, document.pointer(p))) {
            None => None,
            Some((_, Some(Value::String(name)))) => Some(name.clone()),
            Some((_, Some(Value::Number(number)))) => Some(number.to_string()),
            Some((pointer, _)) => {
                return Err(malformed(pointer, "must be the name of the session".to_owned()));
            }
        };
        let rows = samples.iter().map(|sample| self.sample(sample)).collect();
        Ok(Batch { session, rows, ..Batch::default() })
    }

    fn sample(&self, sample: &Value) -> Result<Sample, String> {
        let MappedTopicView { seq, t, x, y, qx, qy, .. } = &self.view;
        Ok(Sample {
            seq: seq.as_ref().map(|pointer| number(sample, pointer)).transpose()?,
            t_s: quantity(sample, t)?.ok_or_else(|| format!("`{}` is missing", t.pointer))?,
            cmd_qx_rad: optional(sample, qx.as_ref())?,
            cmd_qy_rad: optional(sample, qy.as_ref())?,
            x_m: optional(sample, x.as_ref())?,
            y_m: optional(sample, y.as_ref())?,
        })
    }
}

fn number(sample: &Value, pointer: &str) -> Result<u64, String> {
    let seq = sample.pointer(pointer).and_then(Value::as_u64).filter(|seq| *seq <= MAX_SEQ);
    seq.ok_or_else(|| format!("`{pointer}` is not an integer from 0 to {MAX_SEQ}"))
}

fn optional<U: Unit>(
    sample: &Value,
    value: Option<&MappedValueView<U>>,
) -> Result<Option<f64>, String> {
    value.map_or(Ok(None), |value| quantity(sample, value))
}

/// Returns the quantity in SI units; `None` if it is missing or null.
fn quantity<U: Unit>(sample: &Value, value: &MappedValueView<U>) -> Result<Option<f64>, String> {
    match sample.pointer(&value.pointer) {
        None | Some(Value::Null) => Ok(None),
        Some(found) => {
            let number =
                found.as_f64().ok_or_else(|| format!("`{}` is not a number", value.pointer))?;
            let si = number / value.unit.per_si();
            Ok(Some(if value.negate { -si } else { si }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn mapping(topics: &Value) -> Result<Mapping, String> {
        let view =
            serde_json::from_value(json!({ "topics": topics })).map_err(|e| e.to_string())?;
        Mapping::new(view).map_err(|error| format!("{} {error}", error.element))
    }

    fn topic() -> Value {
        json!({
            "pattern": "lab/{asset}/+/status", "session": "/boot", "seq": "/n",
            "t": { "pointer": "/ms", "unit": "ms" },
            "x": { "pointer": "/ball/1", "unit": "mm", "negate": true },
            "y": { "pointer": "/ball/0", "unit": "cm" },
            "qx": { "pointer": "/servo/roll", "unit": "deg" },
        })
    }

    #[test]
    fn a_payload_becomes_samples_in_si_units() {
        let mapping = mapping(&json!([topic()])).unwrap();
        assert_eq!(mapping.filters().collect::<Vec<_>>(), ["lab/+/+/status"]);
        assert!(mapping.find("lab/rig/status").is_none());
        let (entry, asset) = mapping.find("lab/rig/7/status").unwrap();
        assert_eq!(asset.unwrap(), "rig");
        let payload = br#"{"boot":3,"n":7,"ms":1500,"ball":[12,-250],"servo":{"roll":180}}"#;
        let batch = entry.batch(payload, 1).unwrap();
        assert_eq!(batch.session.as_deref(), Some("3"));
        let expected = Sample {
            seq: Some(7),
            t_s: 1.5,
            cmd_qx_rad: Some(std::f64::consts::PI),
            cmd_qy_rad: None,
            x_m: Some(0.25),
            y_m: Some(0.12),
        };
        assert_eq!(batch.rows, [Ok(expected)]);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let mapping = mapping(&json!([topic()])).unwrap();
        let (entry, _) = mapping.find("lab/rig/7/status").unwrap();
        let row = |payload: &str| {
            entry.batch(payload.as_bytes(), 1).unwrap().rows[0].clone().unwrap_err()
        };
        assert_eq!(row(r#"{"boot":"b","n":1}"#), "`/ms` is missing");
        assert!(row(r#"{"boot":"b","n":-1,"ms":1}"#).contains("`/n`"));
        assert_eq!(
            row(r#"{"boot":"b","n":1,"ms":1,"ball":["a","b"]}"#),
            "`/ball/1` is not a number"
        );
        let pointer = |payload: &[u8]| match entry.batch(payload, 1) {
            Err(BatchError::Malformed { pointer, .. }) => pointer,
            other => panic!("{other:?}"),
        };
        assert_eq!(pointer(b"\xff"), "");
        assert_eq!(pointer(b"{}"), "/boot");
    }

    #[test]
    fn an_invalid_entry_is_named() {
        for (key, value, named) in [
            ("pattern", json!("a/#"), "/topics/0/pattern"),
            ("pattern", json!("a/x{asset}"), "/topics/0/pattern"),
            ("pattern", json!("a/b"), "/topics/0/pattern"),
            ("pattern", json!("offbd/{asset}"), "/topics/0/pattern"),
            ("pattern", json!("{asset}/a"), "/topics/0/pattern"),
            ("pattern", json!("$SYS/{asset}"), "/topics/0/pattern"),
            ("pattern", json!("a/{asset}/{asset}"), "/topics/0/pattern"),
            ("asset", json!("rig"), "/topics/0/pattern"),
            ("seq", json!("n"), "/topics/0/seq"),
            ("x", json!({ "pointer": "x", "unit": "m" }), "/topics/0/x/pointer"),
            ("x", json!({ "pointer": "/x", "unit": "inch" }), "inch"),
            ("z", json!({}), "`z`"),
        ] {
            let mut entry = topic();
            entry[key] = value;
            let error = mapping(&json!([entry])).unwrap_err();
            assert!(error.contains(named), "{key}: {error}");
        }
        let error = mapping(&json!([topic(), topic()])).unwrap_err();
        assert!(error.starts_with("/topics/1/pattern"), "{error}");
    }
}
