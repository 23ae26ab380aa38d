//! The id of a batch that is refused without being parsed, or because it cannot be.

use std::fmt;

use serde::de::{IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// Returns whether a batch is MessagePack: this starts with the tag of a map, with which no JSON
/// document starts.
pub(super) fn is_msgpack(batch: &[u8]) -> bool {
    matches!(batch.first(), Some(0x80..=0x8f | 0xde | 0xdf))
}

/// Returns the id of a batch, which may be cut off or invalid after it; `None` if it has none, or
/// it cannot be read.
pub(super) fn batch_id(batch: &[u8]) -> Option<String> {
    let mut id = None;
    // Whatever comes after the id does not matter.
    if is_msgpack(batch) {
        let mut document = rmp_serde::Deserializer::new(batch);
        let _ = document.deserialize_map(UpToId(&mut id));
    } else {
        let mut document = serde_json::Deserializer::from_slice(batch);
        let _ = document.deserialize_map(UpToId(&mut id));
    }
    id
}

/// Reads a batch up to its id.
struct UpToId<'a>(&'a mut Option<String>);

impl<'de> Visitor<'de> for UpToId<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with `id`")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<String>()? {
            if key == "id" {
                *self.0 = map.next_value::<Option<BatchId>>()?.map(|id| match id {
                    BatchId::Text(text) => text,
                    BatchId::Number(number) => number.to_string(),
                });
                break;
            }
            map.next_value::<IgnoredAny>()?;
        }
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum BatchId {
    Text(String),
    Number(u64),
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_id_is_read_from_a_batch_that_is_invalid_or_cut_off_after_it() {
        let document = json!({ "id": 7, "session": "a", "samples": [{ "t_s": 0.5 }], "z": 1 });
        let (text, packed) = (document.to_string(), rmp_serde::to_vec(&document).unwrap());
        let seven = Some("7".to_owned());
        assert_eq!(
            (batch_id(&text.as_bytes()[..8]), batch_id(&packed[..5])),
            (seven.clone(), seven)
        );
        assert_eq!((batch_id(&text.as_bytes()[..5]), batch_id(&packed[..4])), (None, None));
        let late = br#"{"samples":[{"t_s":"x"},7],"id":"late"]"#;
        assert_eq!(batch_id(late).as_deref(), Some("late"));
        for without in [&b"{}"[..], b"[1]", b"junk", b"", br#"{"id":{}}"#, br#"{"samples":[}"#] {
            assert_eq!(batch_id(without), None);
        }
    }
}
