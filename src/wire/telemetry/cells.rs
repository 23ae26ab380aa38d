//! The syntactic view of a batch in JSON or MessagePack: cells that may be
//! anything.

use std::fmt;

use serde::de::{Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::{BatchError, MAX_SEQ};
use crate::wire::asset::pointer;
use offbd_core::vocabulary::{Brief, Sample};

/// Deepest nesting of a MessagePack document; one beyond is refused. As in
/// `serde_json`.
const MAX_DEPTH: usize = 128;

/// Values for which room is made because an array announces them; for more, once
/// they have come.
const MAX_AHEAD: usize = 128;

/// A value where a number is expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Cell {
    #[default]
    Missing,
    Null,
    Number(f64),
    Whole(u64),
    /// Something else, and what.
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

/// The cells of one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cells {
    seq: Cell,
    t_s: Cell,
    cmd_qx_rad: Cell,
    cmd_qy_rad: Cell,
    x_m: Cell,
    y_m: Cell,
}

impl Cells {
    fn sample(self) -> Result<Sample, String> {
        Ok(Sample {
            seq: self.seq.seq()?,
            t_s: self.t_s.time()?,
            cmd_qx_rad: self.cmd_qx_rad.number("cmd_qx_rad")?,
            cmd_qy_rad: self.cmd_qy_rad.number("cmd_qy_rad")?,
            x_m: self.x_m.number("x_m")?,
            y_m: self.y_m.number("y_m")?,
        })
    }
}

/// A row: an object, or something that is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Row {
    Object(Cells),
    Other(&'static str),
}

impl Row {
    pub(super) fn sample(self) -> Result<Sample, String> {
        match self {
            Self::Object(cells) => cells.sample(),
            Self::Other(what) => Err(format!("the row is {what}, not an object")),
        }
    }
}

/// The rows up to the limit, and how many there were.
#[derive(Debug, Default)]
pub(super) struct Rows<T> {
    pub(super) kept: Vec<T>,
    pub(super) n: usize,
}

/// The columns that the document has.
#[derive(Debug, Default)]
pub(super) struct Columns {
    seq: Option<Rows<Cell>>,
    t_s: Option<Rows<Cell>>,
    cmd_qx_rad: Option<Rows<Cell>>,
    cmd_qy_rad: Option<Rows<Cell>>,
    x_m: Option<Rows<Cell>>,
    y_m: Option<Rows<Cell>>,
}

impl Columns {
    fn named(&self) -> [(&'static str, Option<&Rows<Cell>>); 6] {
        [
            ("t_s", self.t_s.as_ref()),
            ("seq", self.seq.as_ref()),
            ("cmd_qx_rad", self.cmd_qx_rad.as_ref()),
            ("cmd_qy_rad", self.cmd_qy_rad.as_ref()),
            ("x_m", self.x_m.as_ref()),
            ("y_m", self.y_m.as_ref()),
        ]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.named().iter().all(|(_, column)| column.is_none())
    }

    /// Length of the longest column.
    pub(super) fn n(&self) -> usize {
        self.named().iter().filter_map(|(_, column)| column.map(|c| c.n)).max().unwrap_or(0)
    }

    /// The samples, or the column that cannot be and why.
    pub(super) fn samples(self) -> Result<Vec<Result<Sample, String>>, (&'static str, String)> {
        let Some(t_s) = &self.t_s else {
            return Err(("t_s", "the batch has neither `samples` nor a column `t_s`".to_owned()));
        };
        for (name, column) in self.named() {
            if let Some(column) = column
                && column.n != t_s.n
            {
                return Err((name, format!("has {} values where `t_s` has {}", column.n, t_s.n)));
            }
        }
        let cell = |column: &Option<Rows<Cell>>, i: usize| {
            column.as_ref().and_then(|c| c.kept.get(i)).copied().unwrap_or_default()
        };
        let row = |i: usize| Cells {
            seq: cell(&self.seq, i),
            t_s: cell(&self.t_s, i),
            cmd_qx_rad: cell(&self.cmd_qx_rad, i),
            cmd_qy_rad: cell(&self.cmd_qy_rad, i),
            x_m: cell(&self.x_m, i),
            y_m: cell(&self.y_m, i),
        };
        Ok((0..t_s.n).map(|i| row(i).sample()).collect())
    }
}

/// A batch.
#[derive(Debug, Default)]
pub(super) struct Document {
    pub(super) session: Option<String>,
    pub(super) id: Option<String>,
    pub(super) samples: Option<Rows<Row>>,
    pub(super) columns: Columns,
}

/// Parses JSON, keeping at most `limit` values of each array.
pub(super) fn json(document: &[u8], limit: usize) -> Result<Document, BatchError> {
    let mut json = serde_json::Deserializer::from_slice(document);
    let parsed = json.deserialize_map(DocumentVisitor { limit });
    parsed.and_then(|parsed| json.end().map(|()| parsed)).map_err(|error| {
        let pointer = place(&mut serde_json::Deserializer::from_slice(document), limit);
        BatchError::Malformed { pointer, reason: error.to_string() }
    })
}

/// Parses MessagePack, keeping at most `limit` values of each array.
pub(super) fn msgpack(document: &[u8], limit: usize) -> Result<Document, BatchError> {
    let unpack = || {
        let mut unpack = rmp_serde::Deserializer::new(document);
        unpack.set_max_depth(MAX_DEPTH);
        unpack
    };
    let mut whole = unpack();
    let parsed = whole.deserialize_map(DocumentVisitor { limit });
    let trailing = whole.get_ref().len();
    let error = match parsed {
        Ok(parsed) if trailing == 0 => return Ok(parsed),
        Ok(_) => rmp_serde::decode::Error::custom(format!("{trailing} bytes follow the document")),
        Err(error) => error,
    };
    let pointer = place(&mut unpack(), limit);
    Err(BatchError::Malformed { pointer, reason: error.to_string() })
}

/// The pointer of the element at which the parser stops. Keeping track of it
/// takes time, so a document is read so only once it has failed.
fn place<'de>(document: impl Deserializer<'de>, limit: usize) -> String {
    let mut track = serde_path_to_error::Track::new();
    let tracked = serde_path_to_error::Deserializer::new(document, &mut track);
    match tracked.deserialize_map(DocumentVisitor { limit }) {
        Ok(_) => String::new(),
        Err(_) => pointer(&track.path()),
    }
}

#[derive(Clone, Copy)]
enum Key {
    Session,
    Id,
    Samples,
    Seq,
    TS,
    CmdQxRad,
    CmdQyRad,
    XM,
    YM,
    Unknown,
}

/// By name alone: what serde derives would also take numbers.
impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_str(KeyVisitor)
    }
}

struct KeyVisitor;

impl Visitor<'_> for KeyVisitor {
    type Value = Key;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a field")
    }

    fn visit_str<E>(self, name: &str) -> Result<Key, E> {
        Ok(match name {
            "session" => Key::Session,
            "id" => Key::Id,
            "samples" => Key::Samples,
            "seq" => Key::Seq,
            "t_s" => Key::TS,
            "cmd_qx_rad" => Key::CmdQxRad,
            "cmd_qy_rad" => Key::CmdQyRad,
            "x_m" => Key::XM,
            "y_m" => Key::YM,
            _ => Key::Unknown,
        })
    }
}

struct DocumentVisitor {
    limit: usize,
}

impl<'de> Visitor<'de> for DocumentVisitor {
    type Value = Document;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with `samples`, or with the columns `t_s`, `x_m`, …")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Document, A::Error> {
        let mut document = Document::default();
        let cells = || Capped::<Cell>::new(self.limit);
        while let Some(key) = map.next_key()? {
            let columns = &mut document.columns;
            match key {
                Key::Session => document.session = map.next_value()?,
                Key::Id => document.id = map.next_value::<Option<Mark>>()?.map(|m| m.0),
                Key::Samples => {
                    document.samples = Some(map.next_value_seed(Capped::<Row>::new(self.limit))?);
                }
                Key::Seq => columns.seq = Some(map.next_value_seed(cells())?),
                Key::TS => columns.t_s = Some(map.next_value_seed(cells())?),
                Key::CmdQxRad => columns.cmd_qx_rad = Some(map.next_value_seed(cells())?),
                Key::CmdQyRad => columns.cmd_qy_rad = Some(map.next_value_seed(cells())?),
                Key::XM => columns.x_m = Some(map.next_value_seed(cells())?),
                Key::YM => columns.y_m = Some(map.next_value_seed(cells())?),
                Key::Unknown => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(document)
    }
}

/// A client's mark: a string or a whole number.
struct Mark(String);

impl<'de> Deserialize<'de> for Mark {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(MarkVisitor)
    }
}

struct MarkVisitor;

impl Visitor<'_> for MarkVisitor {
    type Value = Mark;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a string or a whole number")
    }

    fn visit_str<E>(self, text: &str) -> Result<Mark, E> {
        Ok(Mark(text.to_owned()))
    }
    fn visit_u64<E>(self, number: u64) -> Result<Mark, E> {
        Ok(Mark(number.to_string()))
    }
}

/// An array of which at most `limit` values are kept; the others are counted.
struct Capped<T> {
    limit: usize,
    of: std::marker::PhantomData<T>,
}

impl<T> Capped<T> {
    const fn new(limit: usize) -> Self {
        Self { limit, of: std::marker::PhantomData }
    }
}

impl<'de, T: Deserialize<'de>> serde::de::DeserializeSeed<'de> for Capped<T> {
    type Value = Rows<T>;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Rows<T>, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for Capped<T> {
    type Value = Rows<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an array")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Rows<T>, A::Error> {
        let announced = seq.size_hint().unwrap_or_default().min(self.limit).min(MAX_AHEAD);
        let mut rows = Rows { kept: Vec::with_capacity(announced), n: 0 };
        while rows.n < self.limit {
            let Some(value) = seq.next_element()? else { return Ok(rows) };
            rows.kept.push(value);
            rows.n += 1;
        }
        while seq.next_element::<IgnoredAny>()?.is_some() {
            rows.n += 1;
        }
        Ok(rows)
    }
}

/// The visits that a cell and a row have in common: what is not wanted.
macro_rules! otherwise {
    ($of:expr) => {
        fn visit_bool<E>(self, _: bool) -> Result<Self::Value, E> {
            Ok($of("a boolean"))
        }
        fn visit_str<E>(self, text: &str) -> Result<Self::Value, E> {
            Ok($of(if super::lenient::is_mark(text) {
                super::lenient::MEANING
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
        Ok(if finite { Cell::Number(value) } else { Cell::Other(super::lenient::MEANING) })
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
    otherwise!(Cell::Other);
}

impl<'de> Deserialize<'de> for Row {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RowVisitor)
    }
}

struct RowVisitor;

impl<'de> Visitor<'de> for RowVisitor {
    type Value = Row;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sample")
    }

    fn visit_f64<E>(self, _: f64) -> Result<Row, E> {
        Ok(Row::Other("a number"))
    }
    fn visit_u64<E>(self, _: u64) -> Result<Row, E> {
        Ok(Row::Other("a number"))
    }
    fn visit_i64<E>(self, _: i64) -> Result<Row, E> {
        Ok(Row::Other("a number"))
    }
    fn visit_unit<E>(self) -> Result<Row, E> {
        Ok(Row::Other("null"))
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Row, A::Error> {
        let mut cells = Cells::default();
        while let Some(key) = map.next_key()? {
            match key {
                Key::Seq => cells.seq = map.next_value()?,
                Key::TS => cells.t_s = map.next_value()?,
                Key::CmdQxRad => cells.cmd_qx_rad = map.next_value()?,
                Key::CmdQyRad => cells.cmd_qy_rad = map.next_value()?,
                Key::XM => cells.x_m = map.next_value()?,
                Key::YM => cells.y_m = map.next_value()?,
                _ => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(Row::Object(cells))
    }
    otherwise!(Row::Other);
}
