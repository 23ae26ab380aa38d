//! JSON documents, parsed with errors in plain words: what an element is, and what it must be.
//!
//! The parser's own messages name types of the program (`expected f64`, `struct BallView`)
//! and give the position in the text instead of the element. A document that is valid is
//! parsed once. One that is not is parsed again, from a tree of its values, by a
//! deserializer whose errors are worded here.

use serde::de::value::{MapAccessDeserializer, MapDeserializer, SeqDeserializer};
use serde::de::{
    DeserializeOwned, Deserializer, Error, Expected, IgnoredAny, IntoDeserializer, Unexpected,
    Visitor,
};
use serde::forward_to_deserialize_any;
use serde_json::Value;
use serde_json::error::Category;

use offbd_core::vocabulary::Invalid;

/// Longest part of a text that a message quotes, characters; a longer one is cut.
const MAX_QUOTED: usize = 40;

/// Parses a JSON document.
///
/// # Errors
/// [`Invalid`] with the JSON pointer of the element, which may be one that is missing. The
/// empty pointer stands for the whole document, with line and column in the reason if it is not
/// JSON.
pub fn parse<T: DeserializeOwned>(document: &[u8]) -> Result<T, Invalid> {
    let error = match serde_json::from_slice::<T>(document) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    // The whole text is checked first, because an element may be wrong before the syntax is.
    serde_json::from_slice::<IgnoredAny>(document).map_err(|e| Invalid::new("", words(&e)))?;
    let tree: Value = serde_json::from_slice(document)
        .map_err(|e| Invalid::new(place::<T>(document), words(&e)))?;
    match serde_path_to_error::deserialize::<_, T>(Node(tree)) {
        Err(found) => {
            let within = pointer(found.path());
            let Mismatch { reason, field } = found.into_inner();
            let field = field.map(|field| format!("/{field}")).unwrap_or_default();
            Err(Invalid::new(within + &field, reason))
        }
        // The tree has the last of two values of the same name.
        Ok(_) => Err(Invalid::new(place::<T>(document), words(&error))),
    }
}

/// Returns the pointer of the element at which the parser fails.
fn place<T: DeserializeOwned>(document: &[u8]) -> String {
    let mut json = serde_json::Deserializer::from_slice(document);
    let parsed: Result<T, _> = serde_path_to_error::deserialize(&mut json);
    parsed.err().map(|error| pointer(error.path())).unwrap_or_default()
}

/// Rejects a document that is an array: serde would accept an array of the field values
/// in place of the object.
///
/// # Errors
/// [`Invalid`] with the empty pointer.
pub fn check_object(document: &[u8]) -> Result<(), Invalid> {
    if document.trim_ascii_start().starts_with(b"[") {
        return Err(Invalid::new("", "the document is an array, not an object"));
    }
    Ok(())
}

/// Returns the JSON pointer (RFC 6901) of a path inside a document.
#[must_use]
pub fn pointer(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    let token = |segment: &Segment| match segment {
        Segment::Seq { index } => Some(format!("/{index}")),
        Segment::Map { key } => Some(format!("/{}", key.replace('~', "~0").replace('/', "~1"))),
        // The name of an enum variant is a key in the document.
        Segment::Enum { variant } => Some(format!("/{variant}")),
        Segment::Unknown => None,
    };
    path.iter().filter_map(token).collect()
}

/// Returns an error of the parser in plain words.
#[must_use]
pub fn words(error: &serde_json::Error) -> String {
    let at = format!("line {}, column {}", error.line(), error.column());
    let text = error.to_string();
    match error.classify() {
        _ if text.starts_with("number out of range") => "is a number that is too large".to_owned(),
        _ if text.starts_with("recursion limit") => format!("is nested too deeply at {at}"),
        Category::Eof if error.column() == 0 => "the JSON document is empty".to_owned(),
        Category::Eof => format!("the JSON document ends too early, at {at}"),
        Category::Syntax | Category::Io => format!("is not valid JSON at {at}"),
        Category::Data => mismatch_words(text.split(" at line ").next().unwrap_or_default()),
    }
}

/// Returns the message of a parser of any format about an element of the wrong type in plain
/// words: `invalid type: map, expected an array` says that it "is an object, not an array".
#[must_use]
pub fn mismatch_words(message: &str) -> String {
    let mismatch = message.strip_prefix("invalid type: ").and_then(|m| m.split_once(", expected "));
    if let Some((found, wanted)) = mismatch {
        let found = match found {
            "map" => "an object",
            "sequence" => "an array",
            "byte array" => "bytes",
            "unit value" | "null" => "null",
            other => ["integer ", "floating point ", "boolean ", "string "]
                .iter()
                .find_map(|kind| other.strip_prefix(kind))
                .unwrap_or(other),
        };
        return format!("is {found}, not {wanted}");
    }
    match message.strip_prefix("duplicate field ") {
        Some(field) => format!("{field} is given twice"),
        None => message.to_owned(),
    }
}

/// A value of a document; its deserializer words the errors.
struct Node(Value);

/// Why a value does not fit.
#[derive(Debug, thiserror::Error)]
#[error("{reason}")]
struct Mismatch {
    reason: String,
    /// The field of the object that the error is about, if it is not the object itself.
    field: Option<&'static str>,
}

impl Mismatch {
    fn new(reason: String) -> Self {
        Self { reason, field: None }
    }
}

impl Error for Mismatch {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        Self::new(mismatch_words(&message.to_string()))
    }

    fn invalid_type(found: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::new(format!("is {}, not {}", found_words(found), wanted_words(&wanted.to_string())))
    }

    fn invalid_value(found: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::invalid_type(found, wanted)
    }

    fn invalid_length(n: usize, wanted: &dyn Expected) -> Self {
        Self::new(format!("has {n} elements, not {}", wanted_words(&wanted.to_string())))
    }

    fn unknown_variant(found: &str, words: &'static [&'static str]) -> Self {
        Self::new(format!("`{}` is not one of {}", cut(found), words.join(", ")))
    }

    fn unknown_field(_: &str, names: &'static [&'static str]) -> Self {
        Self::new(match names {
            [] => "is not known; there are no fields here".to_owned(),
            names => format!("is not known; the fields are {}", names.join(", ")),
        })
    }

    fn missing_field(field: &'static str) -> Self {
        Self { reason: "is missing".to_owned(), field: Some(field) }
    }

    fn duplicate_field(field: &'static str) -> Self {
        Self { reason: "is given twice".to_owned(), field: Some(field) }
    }
}

fn cut(text: &str) -> String {
    match text.char_indices().nth(MAX_QUOTED) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

fn found_words(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(value) => value.to_string(),
        Unexpected::Unsigned(value) => value.to_string(),
        Unexpected::Signed(value) => value.to_string(),
        Unexpected::Float(value) => value.to_string(),
        Unexpected::Str(text) => format!("the text \"{}\"", cut(text)),
        Unexpected::Unit | Unexpected::Option => "null".to_owned(),
        Unexpected::Seq => "an array".to_owned(),
        Unexpected::Map => "an object".to_owned(),
        other => other.to_string(),
    }
}

/// Returns the JSON words for what a visitor says that it expects. A visitor of the program
/// has its own words.
fn wanted_words(wanted: &str) -> String {
    let words = match wanted {
        "f64" | "f32" => "a number",
        "u64" | "usize" => "a whole number from 0",
        "u32" => "a whole number of 0 to 4294967295",
        "u16" => "a whole number of 0 to 65535",
        "u8" => "a whole number of 0 to 255",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "a string" | "str" => "text",
        "a boolean" => "true or false",
        "a sequence" => "an array",
        "a map" => "an object",
        "variant identifier" | "string or map" => "a word",
        _ if wanted.starts_with("struct ") => "an object",
        _ if wanted.starts_with("enum ") => "a word",
        _ if wanted.starts_with("tuple ") => "an array",
        _ => wanted,
    };
    words.to_owned()
}

impl IntoDeserializer<'_, Mismatch> for Node {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Node {
    type Error = Mismatch;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mismatch> {
        match self.0 {
            Value::Null => visitor.visit_unit(),
            Value::Bool(value) => visitor.visit_bool(value),
            Value::Number(value) => match (value.as_u64(), value.as_i64()) {
                (Some(value), _) => visitor.visit_u64(value),
                (_, Some(value)) => visitor.visit_i64(value),
                _ => visitor.visit_f64(value.as_f64().unwrap_or(f64::NAN)),
            },
            Value::String(text) => visitor.visit_string(text),
            Value::Array(items) => {
                let mut items = SeqDeserializer::new(items.into_iter().map(Node));
                let value = visitor.visit_seq(&mut items)?;
                items.end().map(|()| value)
            }
            Value::Object(fields) => visitor.visit_map(fields_of(fields)),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mismatch> {
        match self.0 {
            Value::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Mismatch> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        words: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mismatch> {
        match self.0 {
            Value::String(word) => visitor.visit_enum(word.into_deserializer()),
            Value::Object(fields) if fields.len() == 1 => {
                visitor.visit_enum(MapAccessDeserializer::new(fields_of(fields)))
            }
            Value::Object(fields) => {
                let reason = format!("has {} keys, not one of {}", fields.len(), words.join(", "));
                Err(Mismatch::new(reason))
            }
            other => Node(other).deserialize_any(visitor),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// A deserializer of the fields of an object.
type Fields<'de> = MapDeserializer<'de, FieldIterator, Mismatch>;

/// The fields of an object in their order.
type FieldIterator =
    std::iter::Map<serde_json::map::IntoIter, fn((String, Value)) -> (String, Node)>;

fn fields_of<'de>(fields: serde_json::Map<String, Value>) -> Fields<'de> {
    let node: fn((String, Value)) -> (String, Node) = |(name, value)| (name, Node(value));
    MapDeserializer::new(fields.into_iter().map(node))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "only parsed")]
    struct Rig {
        name: String,
        #[serde(default)]
        ball: Option<Ball>,
        #[serde(default)]
        n: u32,
        #[serde(default)]
        order: Vec<Order>,
    }

    #[derive(Debug, Deserialize)]
    #[allow(dead_code, reason = "only parsed")]
    struct Ball {
        mass_kg: f64,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    #[allow(dead_code, reason = "only parsed")]
    enum Order {
        Newest,
        Oldest,
        Only { t_s: f64 },
    }

    #[test]
    fn an_error_names_the_element_in_words_of_json() {
        for (document, element, reason) in [
            ("{}", "/name", "is missing"),
            ("{\"name\":3}", "/name", "is 3, not text"),
            ("{\"name\":\"a\",\"ball\":{}}", "/ball/mass_kg", "is missing"),
            (
                "{\"name\":\"a\",\"ball\":{\"mass_kg\":null}}",
                "/ball/mass_kg",
                "is null, not a number",
            ),
            (
                "{\"name\":\"a\",\"ball\":{\"mass_kg\":\"heavy\"}}",
                "/ball/mass_kg",
                "is the text \"heavy\", not a number",
            ),
            ("{\"name\":\"a\",\"ball\":7}", "/ball", "is 7, not an object"),
            ("{\"name\":\"a\",\"n\":-1}", "/n", "is -1, not a whole number of 0 to 4294967295"),
            ("{\"name\":\"a\",\"n\":1.5}", "/n", "is 1.5, not a whole number of 0 to 4294967295"),
            (
                "{\"name\":\"a\",\"order\":[\"odd\"]}",
                "/order/0",
                "`odd` is not one of newest, oldest, only",
            ),
            ("{\"name\":\"a\",\"order\":[{\"only\":{}}]}", "/order/0/only/t_s", "is missing"),
            (
                "{\"name\":\"a\",\"colour\":1}",
                "/colour",
                "is not known; the fields are name, ball, n, order",
            ),
            ("{\"name\":\"a\",\"name\":\"b\"}", "", "`name` is given twice"),
            (
                "{\"name\":\"a\",\"ball\":{\"mass_kg\":1e999}}",
                "/ball/mass_kg",
                "is a number that is too large",
            ),
            ("{\"name\":", "", "the JSON document ends too early, at line 1, column 8"),
            ("", "", "the JSON document is empty"),
            ("<name/>", "", "is not valid JSON at line 1, column 1"),
            ("{\"name\":3,}", "", "is not valid JSON at line 1, column 11"),
            ("{\"name\":\"a\"} 7", "", "is not valid JSON at line 1, column 14"),
        ] {
            let found = parse::<Rig>(document.as_bytes()).unwrap_err();
            assert_eq!((&*found.element, &*found.reason), (element, reason), "{document}");
        }
    }

    #[test]
    fn a_valid_document_is_parsed() {
        let all = "{\"name\":\"a\",\"ball\":{\"mass_kg\":1},\"order\":[\"newest\",{\"only\":{\"t_s\":2}}]}";
        let rig: Rig = parse(all.as_bytes()).unwrap();
        assert_eq!((rig.name.as_str(), rig.order.len()), ("a", 2));
    }

    #[test]
    fn a_long_text_is_cut_in_a_message() {
        let document = format!("{{\"name\":\"a\",\"n\":\"{}\"}}", "é".repeat(100));
        let reason = parse::<Rig>(document.as_bytes()).unwrap_err().reason;
        assert_eq!(reason.chars().filter(|c| *c == 'é').count(), MAX_QUOTED, "{reason}");
    }
}
