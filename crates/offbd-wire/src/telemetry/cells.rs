//! The syntactic view of a batch in JSON or MessagePack, whose *cells* (the values of its
//! rows and columns) may have any type.

use std::cell::RefCell;
use std::fmt;

use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::{BatchError, MAX_SEQ};
use crate::json::{self, pointer};
use offbd_core::vocabulary::{Brief, Sample};

/// Deepest nesting of a MessagePack document, as in `serde_json`.
const MAX_DEPTH: usize = 128;

/// Number of values for which memory is reserved; less if an array announces fewer. JSON arrays
/// announce nothing. Chosen: a usual batch.
const MAX_RESERVED: usize = 128;

/// A value where a number is expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Cell {
    #[default]
    Missing,
    Null,
    Number(f64),
    Whole(u64),
    /// A value of another type, with its name.
    Other(&'static str),
}

impl Cell {
    fn number(self, field: &str) -> Result<Option<f64>, String> {
        match self {
            Self::Missing | Self::Null => Ok(None),
            Self::Number(value) => Ok(Some(value)),
            Self::Whole(value) => Ok(Some(value as f64)),
            Self::Other(what) => Err(format!("`{field}` is {what}, not a number")),
        }
    }

    fn seq(self) -> Result<Option<u64>, String> {
        match self {
            Self::Missing | Self::Null => Ok(None),
            Self::Whole(seq) if seq <= MAX_SEQ => Ok(Some(seq)),
            Self::Whole(seq) => Err(format!("`seq` is {seq}, beyond {MAX_SEQ}")),
            Self::Number(value) => {
                Err(format!("`seq` is {}, not a whole number from 0", Brief(value)))
            }
            Self::Other(what) => Err(format!("`seq` is {what}, not a whole number")),
        }
    }

    fn time(self) -> Result<f64, String> {
        match self {
            Self::Missing => Err("`t_s` is missing".to_owned()),
            Self::Null => Err("`t_s` is null".to_owned()),
            _ => self.number("t_s").map(Option::unwrap_or_default),
        }
    }
}

/// Names of the fields of a sample, in the order of [`SampleCells`] and of the columns of a
/// batch.
pub(super) const FIELDS: [&str; 6] = ["t_s", "seq", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"];

/// Index of the field `t_s`, which every batch in columns must have.
const T_S: usize = 0;

/// The cells of one sample, in the order of [`FIELDS`].
pub(super) type SampleCells = [Cell; FIELDS.len()];

/// Returns the sample of a row. `has_unknown` tells whether the batch has keys that are not
/// understood: then a row without any command or position is not one of a blind sensor.
fn sample(cells: SampleCells, has_unknown: bool) -> Result<Sample, String> {
    let [t_s, seq, cmd_qx_rad, cmd_qy_rad, x_m, y_m] = cells;
    let sample = Sample {
        seq: seq.seq()?,
        t_s: t_s.time()?,
        cmd_qx_rad: cmd_qx_rad.number("cmd_qx_rad")?,
        cmd_qy_rad: cmd_qy_rad.number("cmd_qy_rad")?,
        x_m: x_m.number("x_m")?,
        y_m: y_m.number("y_m")?,
    };
    if has_unknown && [cmd_qx_rad, cmd_qy_rad, x_m, y_m] == [Cell::Missing; 4] {
        return Err("has none of the keys cmd_qx_rad, cmd_qy_rad, x_m, y_m".to_owned());
    }
    Ok(sample)
}

/// A row of a batch: an object, one with a key twice, or a value of another type, with its name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum BatchRow {
    Object(SampleCells),
    /// Of the two values one would be lost.
    Repeated(&'static str),
    Other(&'static str),
}

impl BatchRow {
    pub(super) fn sample(self, has_unknown: bool) -> Result<Sample, String> {
        match self {
            Self::Object(cells) => sample(cells, has_unknown),
            Self::Repeated(key) => Err(format!("has the key `{key}` twice")),
            Self::Other(what) => Err(format!("the row is {what}, not an object")),
        }
    }
}

/// The values of an array up to the limit, and the length of the whole array.
#[derive(Debug, Default)]
pub(super) struct LimitedArray<T> {
    pub(super) values: Vec<T>,
    pub(super) n: usize,
}

/// The columns of a batch, in the order of [`FIELDS`]; `None` if a column is missing.
#[derive(Debug, Default)]
pub(super) struct BatchColumns([Option<LimitedArray<Cell>>; FIELDS.len()]);

impl BatchColumns {
    pub(super) fn is_empty(&self) -> bool {
        self.0.iter().all(Option::is_none)
    }

    /// Returns the length of the longest column.
    pub(super) fn n(&self) -> usize {
        self.0.iter().flatten().map(|column| column.n).max().unwrap_or(0)
    }

    /// Returns the samples, one per row.
    ///
    /// # Errors
    /// The name of the missing or wrong column, and the reason.
    pub(super) fn samples(
        self,
        has_unknown: bool,
    ) -> Result<Vec<Result<Sample, String>>, (&'static str, String)> {
        let Some(t_s) = &self.0[T_S] else {
            return Err(("t_s", "the batch has neither `samples` nor a column `t_s`".to_owned()));
        };
        for (name, column) in FIELDS.into_iter().zip(&self.0) {
            if let Some(column) = column
                && column.n != t_s.n
            {
                return Err((name, format!("has {} values where `t_s` has {}", column.n, t_s.n)));
            }
        }
        let cell = |column: &Option<LimitedArray<Cell>>, i: usize| {
            column.as_ref().and_then(|c| c.values.get(i)).copied().unwrap_or_default()
        };
        let row = |i: usize| std::array::from_fn(|field| cell(&self.0[field], i));
        Ok((0..t_s.n).map(|i| sample(row(i), has_unknown)).collect())
    }
}

/// The syntactic view of a batch.
#[derive(Debug, Default)]
pub(super) struct BatchDocument {
    pub(super) session: Option<String>,
    pub(super) id: Option<String>,
    pub(super) samples: Option<LimitedArray<BatchRow>>,
    pub(super) columns: BatchColumns,
    pub(super) unknown: UnknownKeys,
}

/// Unknown keys of a batch that are named.
const MAX_UNKNOWN: usize = 8;

/// Bytes of an unknown key that are kept.
const MAX_KEY_BYTES: usize = 64;

/// The unknown keys of a document, each once, in the order of their first occurrence; at most
/// [`MAX_UNKNOWN`].
#[derive(Debug, Default)]
pub(super) struct UnknownKeys(RefCell<Vec<String>>);

impl UnknownKeys {
    pub(super) fn note(&self, key: &str) {
        let mut keys = self.0.borrow_mut();
        let end = key.floor_char_boundary(MAX_KEY_BYTES);
        if keys.len() < MAX_UNKNOWN && !keys.iter().any(|known| known == &key[..end]) {
            keys.push(key[..end].to_owned());
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.borrow().is_empty()
    }

    pub(super) fn into_names(self) -> Vec<String> {
        self.0.into_inner()
    }
}

/// Parses JSON, keeping at most `limit` values of each array.
pub(super) fn json(document: &[u8], limit: usize) -> Result<BatchDocument, BatchError> {
    let mut json = serde_json::Deserializer::from_slice(document);
    let parsed = json.deserialize_map(BatchDocumentVisitor { limit });
    parsed.and_then(|parsed| json.end().map(|()| parsed)).map_err(|error| {
        let pointer = error_pointer(&mut serde_json::Deserializer::from_slice(document), limit);
        BatchError::Malformed { pointer, reason: json::words(&error) }
    })
}

/// Parses MessagePack, keeping at most `limit` values of each array.
pub(super) fn msgpack(document: &[u8], limit: usize) -> Result<BatchDocument, BatchError> {
    let unpack = || {
        let mut unpack = rmp_serde::Deserializer::new(document);
        unpack.set_max_depth(MAX_DEPTH);
        unpack
    };
    let mut whole = unpack();
    let parsed = whole.deserialize_map(BatchDocumentVisitor { limit });
    let trailing = whole.get_ref().len();
    let reason = match parsed {
        Ok(parsed) if trailing == 0 => return Ok(parsed),
        Ok(_) => format!("{trailing} bytes follow the document"),
        Err(error) => msgpack_words(&error),
    };
    let pointer = error_pointer(&mut unpack(), limit);
    Err(BatchError::Malformed { pointer, reason })
}

/// Returns an error of the MessagePack parser in plain words.
fn msgpack_words(error: &rmp_serde::decode::Error) -> String {
    use rmp_serde::decode::Error as E;
    match error {
        E::Syntax(message) | E::Uncategorized(message) => json::mismatch_words(message),
        E::DepthLimitExceeded => "is nested beyond the permitted depth".to_owned(),
        E::InvalidMarkerRead(_) | E::InvalidDataRead(_) => {
            "the MessagePack document ends too early".to_owned()
        }
        E::TypeMismatch(_) | E::LengthMismatch(_) | E::OutOfRange | E::Utf8Error(_) => {
            "is not valid MessagePack, or of the wrong type".to_owned()
        }
    }
}

/// Returns the JSON pointer of the element at which the parser fails. Tracking the path is
/// slow, so it is done in a second pass and only for invalid documents.
fn error_pointer<'de>(document: impl Deserializer<'de>, limit: usize) -> String {
    let mut track = serde_path_to_error::Track::new();
    let tracked = serde_path_to_error::Deserializer::new(document, &mut track);
    match tracked.deserialize_map(BatchDocumentVisitor { limit }) {
        Ok(_) => String::new(),
        Err(_) => pointer(&track.path()),
    }
}

/// A key of a batch or of a row.
#[derive(Clone, Copy)]
enum BatchKey {
    Session,
    Id,
    Samples,
    /// Index in [`FIELDS`].
    Field(usize),
    Unknown,
}

/// Reads the key of a batch or of a row, and notes it if it is unknown.
#[derive(Clone, Copy)]
struct BatchKeySeed<'a> {
    unknown: &'a UnknownKeys,
    /// Whether the key is one of a row.
    is_row: bool,
}

/// Written by hand because a derived implementation would also accept numbers as keys.
impl<'de> DeserializeSeed<'de> for BatchKeySeed<'_> {
    type Value = BatchKey;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<BatchKey, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for BatchKeySeed<'_> {
    type Value = BatchKey;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a field")
    }

    fn visit_str<E>(self, name: &str) -> Result<BatchKey, E> {
        if let Some(field) = FIELDS.iter().position(|field| *field == name) {
            return Ok(BatchKey::Field(field));
        }
        Ok(match name {
            "session" if !self.is_row => BatchKey::Session,
            "id" if !self.is_row => BatchKey::Id,
            "samples" if !self.is_row => BatchKey::Samples,
            _ => {
                self.unknown.note(name);
                BatchKey::Unknown
            }
        })
    }
}

/// The known keys of an object that have been read. Of a repeated key one value would be
/// lost.
#[derive(Default)]
struct SeenKeys {
    bits: u16,
}

impl SeenKeys {
    /// Notes a key; returns its name if it has been read before.
    fn repeats(&mut self, key: BatchKey) -> Option<&'static str> {
        let (bit, name) = match key {
            BatchKey::Session => (0, "session"),
            BatchKey::Id => (1, "id"),
            BatchKey::Samples => (2, "samples"),
            BatchKey::Field(field) => (3 + field, FIELDS[field]),
            BatchKey::Unknown => return None,
        };
        let is_repeated = self.bits & (1 << bit) != 0;
        self.bits |= 1 << bit;
        is_repeated.then_some(name)
    }
}

struct BatchDocumentVisitor {
    limit: usize,
}

impl<'de> Visitor<'de> for BatchDocumentVisitor {
    type Value = BatchDocument;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with `samples`, or with the columns `t_s`, `x_m`, …")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<BatchDocument, A::Error> {
        let mut document = BatchDocument::default();
        let mut seen = SeenKeys::default();
        let unknown = UnknownKeys::default();
        let keys = BatchKeySeed { unknown: &unknown, is_row: false };
        while let Some(key) = map.next_key_seed(keys)? {
            if let Some(name) = seen.repeats(key) {
                return Err(A::Error::duplicate_field(name));
            }
            match key {
                BatchKey::Session => document.session = map.next_value()?,
                BatchKey::Id => document.id = map.next_value::<Option<BatchId>>()?.map(|id| id.0),
                BatchKey::Samples => {
                    let rows = LimitedArrayVisitor::new(self.limit, BatchRowSeed(&unknown));
                    document.samples = Some(map.next_value_seed(rows)?);
                }
                BatchKey::Field(field) => {
                    let cells = LimitedArrayVisitor::new(self.limit, CellSeed);
                    document.columns.0[field] = Some(map.next_value_seed(cells)?);
                }
                BatchKey::Unknown => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        document.unknown = unknown;
        Ok(document)
    }
}

/// The client's id of a batch: a string or a whole number.
struct BatchId(String);

impl<'de> Deserialize<'de> for BatchId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(BatchIdVisitor)
    }
}

struct BatchIdVisitor;

impl Visitor<'_> for BatchIdVisitor {
    type Value = BatchId;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a string or a whole number")
    }

    fn visit_str<E>(self, text: &str) -> Result<BatchId, E> {
        Ok(BatchId(text.to_owned()))
    }
    fn visit_u64<E>(self, number: u64) -> Result<BatchId, E> {
        Ok(BatchId(number.to_string()))
    }
}

/// Deserializes an array, keeping at most `limit` values and counting the rest.
struct LimitedArrayVisitor<S> {
    limit: usize,
    each: S,
}

impl<S> LimitedArrayVisitor<S> {
    const fn new(limit: usize, each: S) -> Self {
        Self { limit, each }
    }
}

impl<'de, S: DeserializeSeed<'de> + Copy> DeserializeSeed<'de> for LimitedArrayVisitor<S> {
    type Value = LimitedArray<S::Value>;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, S: DeserializeSeed<'de> + Copy> Visitor<'de> for LimitedArrayVisitor<S> {
    type Value = LimitedArray<S::Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
        let announced = seq.size_hint().unwrap_or(MAX_RESERVED).min(self.limit).min(MAX_RESERVED);
        let mut array = LimitedArray { values: Vec::with_capacity(announced), n: 0 };
        while array.n < self.limit {
            let Some(value) = seq.next_element_seed(self.each)? else { return Ok(array) };
            array.values.push(value);
            array.n += 1;
        }
        while seq.next_element::<IgnoredAny>()?.is_some() {
            array.n += 1;
        }
        Ok(array)
    }
}

/// The methods for unexpected types that the visitors of a cell and of a row share.
macro_rules! visit_unexpected {
    ($of:expr) => {
        fn visit_bool<E>(self, _: bool) -> Result<Self::Value, E> {
            Ok($of("a boolean"))
        }
        fn visit_str<E>(self, text: &str) -> Result<Self::Value, E> {
            Ok($of(if super::lenient::is_marker(text) {
                super::lenient::NOT_FINITE
            } else {
                "a string"
            }))
        }
        fn visit_bytes<E>(self, _: &[u8]) -> Result<Self::Value, E> {
            Ok($of("bytes"))
        }
        fn visit_newtype_struct<D: Deserializer<'de>>(
            self,
            extension: D,
        ) -> Result<Self::Value, D::Error> {
            extension.deserialize_any(IgnoredAny)?;
            Ok($of("an extension"))
        }
        fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
            while seq.next_element::<IgnoredAny>()?.is_some() {}
            Ok($of("an array"))
        }
    };
}

impl<'de> Deserialize<'de> for Cell {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        CellSeed.deserialize(deserializer)
    }
}

/// Reads a cell.
#[derive(Clone, Copy)]
struct CellSeed;

impl<'de> DeserializeSeed<'de> for CellSeed {
    type Value = Cell;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Cell, D::Error> {
        deserializer.deserialize_any(CellVisitor)
    }
}

struct CellVisitor;

impl<'de> Visitor<'de> for CellVisitor {
    type Value = Cell;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_f64<E>(self, value: f64) -> Result<Cell, E> {
        let finite = value.is_finite();
        Ok(if finite { Cell::Number(value) } else { Cell::Other(super::lenient::NOT_FINITE) })
    }
    fn visit_u64<E>(self, value: u64) -> Result<Cell, E> {
        Ok(Cell::Whole(value))
    }
    fn visit_i64<E>(self, value: i64) -> Result<Cell, E> {
        Ok(Cell::Number(value as f64))
    }
    fn visit_unit<E>(self) -> Result<Cell, E> {
        Ok(Cell::Null)
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Cell, A::Error> {
        while map.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Cell::Other("an object"))
    }
    visit_unexpected!(Cell::Other);
}

/// Reads a row, and notes its unknown keys.
#[derive(Clone, Copy)]
pub(super) struct BatchRowSeed<'a>(pub(super) &'a UnknownKeys);

impl<'de> DeserializeSeed<'de> for BatchRowSeed<'_> {
    type Value = BatchRow;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<BatchRow, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for BatchRowSeed<'_> {
    type Value = BatchRow;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sample")
    }

    fn visit_f64<E>(self, _: f64) -> Result<BatchRow, E> {
        Ok(BatchRow::Other("a number"))
    }
    fn visit_u64<E>(self, _: u64) -> Result<BatchRow, E> {
        Ok(BatchRow::Other("a number"))
    }
    fn visit_i64<E>(self, _: i64) -> Result<BatchRow, E> {
        Ok(BatchRow::Other("a number"))
    }
    fn visit_unit<E>(self) -> Result<BatchRow, E> {
        Ok(BatchRow::Other("null"))
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<BatchRow, A::Error> {
        let mut cells = SampleCells::default();
        let mut repeated = None;
        let keys = BatchKeySeed { unknown: self.0, is_row: true };
        while let Some(key) = map.next_key_seed(keys)? {
            match key {
                BatchKey::Field(field) if cells[field] != Cell::Missing => {
                    repeated = Some(FIELDS[field]);
                    map.next_value::<IgnoredAny>()?;
                }
                BatchKey::Field(field) => cells[field] = map.next_value()?,
                _ => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(repeated.map_or(BatchRow::Object(cells), BatchRow::Repeated))
    }
    visit_unexpected!(BatchRow::Other);
}
