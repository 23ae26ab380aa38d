//! Recordings in JSON, as other programs write their tables, as the text that a spreadsheet program
//! would save, so that they are read as a text is (`table.rs`):
//!
//! - a list of rows, or one row a line; a row is an object, or a list of values;
//! - an object with a list of values for each column, or an object of values, as pandas writes it;
//! - an object with one list of rows, such as `samples`, and for rows that are lists perhaps a list
//!   of their names.
//!
//! An object or a list within a row has one column for each of its values: `ball.x`, `ball[0]`. The
//! document and its text are in memory.

use std::collections::HashMap;
use std::fmt::{self, Write as _};
use std::io::Read;

use serde::de::{self, DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

use super::line::{LONGEST_CELL, line_of, write_line};
use super::{SessionFileError, SessionFormat, TextKind};
use crate::table::encoding;
use crate::telemetry::lenient::with_quotes;

/// Longest document, bytes. Chosen: a million rows of five numbers with their names.
const MAX_JSON_BYTES: u64 = 128 << 20;

/// Most columns of a document. Chosen: rigs with many sensors have a hundred.
const MAX_COLUMNS: usize = 1000;

/// Longest text of a document, bytes. Chosen: that of the longest document; more is of rows that lack
/// most of their columns.
const MAX_TEXT_BYTES: usize = 128 << 20;

/// Most objects around the list of rows or of columns. Chosen: exports have one or two.
const MAX_DEPTH: usize = 3;

/// Part of the longest list that a list needs to be a column. Chosen: lists of settings are shorter.
const COLUMN_SHARE: usize = 2;

/// A document as a text.
pub(crate) struct JsonTable {
    pub(crate) text: Vec<u8>,
    /// Lines before the first row.
    n_before: u64,
    /// How the document writes its table.
    pub(crate) layout: &'static str,
}

impl JsonTable {
    pub(crate) const fn kind(&self) -> TextKind {
        TextKind::Rows { n_before: self.n_before }
    }
}

/// Reads a document whole.
///
/// # Errors
/// [`SessionFileError`] if the document is damaged, too large, or has no table.
pub(crate) fn table(source: impl Read) -> Result<JsonTable, SessionFileError> {
    let mut bytes = Vec::new();
    source.take(MAX_JSON_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_JSON_BYTES {
        let limit = MAX_JSON_BYTES;
        return Err(SessionFileError::TooLong { what: "the JSON document", limit });
    }
    let bytes = encoding::decoded(&bytes);
    match table_within(&bytes, MAX_TEXT_BYTES) {
        // Python writes `NaN`, which is not JSON.
        Err(SessionFileError::Damaged { reason, format }) => match with_quotes(&bytes) {
            Some(quoted) => table_within(&quoted, MAX_TEXT_BYTES),
            None => Err(SessionFileError::Damaged { reason, format }),
        },
        read => read,
    }
}

fn table_within(bytes: &[u8], max_bytes: usize) -> Result<JsonTable, SessionFileError> {
    let mut table = Table { max_bytes, ..Table::default() };
    // The names of all rows are known before the first is written.
    table.read(bytes)?;
    table.pass = Pass::Text;
    table.columns.clear();
    table.read(bytes)?;
    table.text()
}

/// What is taken of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Pass {
    /// The names of its values.
    #[default]
    Names,
    /// A line of the text.
    Text,
    /// Its cells, which stay until the next row.
    Cells,
}

/// The rows and columns of a document, as they are read.
#[derive(Default)]
struct Table {
    /// Longest text of the rows, bytes.
    max_bytes: usize,
    pass: Pass,
    /// The names of the values of rows that are objects, and their places.
    names: Vec<String>,
    places: HashMap<String, usize>,
    /// Place of the value that is expected next: rows have their values in one order.
    next: usize,
    /// The values of the row that is being read.
    cells: Vec<String>,
    rows: Vec<u8>,
    n_rows: usize,
    /// Most values of a row that is a list; 0 if none is.
    list_width: usize,
    /// The list that has the rows.
    place_of_rows: Option<String>,
    is_by_line: bool,
    columns: Vec<Column>,
}

/// A list of values.
struct Column {
    name: String,
    values: String,
    /// Ends of the values, which are shorter than the document.
    ends: Vec<u32>,
}

impl Column {
    fn new(name: &str) -> Self {
        Self { name: name.to_owned(), values: String::new(), ends: Vec::new() }
    }

    fn get(&self, i: usize) -> &str {
        let start = if i == 0 { 0 } else { self.ends[i - 1] as usize };
        &self.values[start..self.ends[i] as usize]
    }
}

impl Table {
    fn read(&mut self, bytes: &[u8]) -> Result<(), SessionFileError> {
        if is_by_line(bytes) {
            self.is_by_line = true;
            return self.read_lines(bytes);
        }
        self.place_of_rows = None;
        let mut json = serde_json::Deserializer::from_slice(bytes);
        Part { table: self, name: String::new(), depth: 0 }.deserialize(&mut json)?;
        Ok(json.end()?)
    }

    /// Reads a row from each line. A line that is not a row, such as the last one of a program that
    /// was killed, is rejected when its cells are read as numbers.
    fn read_lines(&mut self, bytes: &[u8]) -> Result<(), SessionFileError> {
        let lines = bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
        // A list without its brackets has a comma behind each row.
        let lines = lines.map(|line| line.strip_suffix(b",").unwrap_or(line));
        for line in lines.filter(|line| !line.is_empty()) {
            let mut is_row = self.read_line(line);
            if !is_row && let Some(quoted) = with_quotes(line) {
                is_row = self.read_line(&quoted);
            }
            if !is_row {
                self.cells.clear();
                self.cells.resize(self.names.len(), line_of(&String::from_utf8_lossy(line)));
                self.end_row()?;
            }
        }
        Ok(())
    }

    /// Reads a row; returns whether it is one.
    fn read_line(&mut self, line: &[u8]) -> bool {
        self.cells.iter_mut().for_each(String::clear);
        self.next = 0;
        let mut json = serde_json::Deserializer::from_slice(line);
        Row(self).deserialize(&mut json).and_then(|()| json.end()).is_ok()
    }

    /// Notes a value of a row that is an object.
    fn put<E: de::Error>(&mut self, name: &str, value: impl fmt::Display) -> Result<(), E> {
        let is_next = self.names.get(self.next).is_some_and(|next| next == name);
        let place = if is_next { Some(self.next) } else { self.places.get(name).copied() };
        let place = match place {
            Some(place) => place,
            None if self.names.len() == MAX_COLUMNS => {
                return Err(E::custom(format!("more than {MAX_COLUMNS} columns")));
            }
            None if name.len() > LONGEST_CELL => {
                return Err(E::custom(format!("a name of more than {LONGEST_CELL} bytes")));
            }
            None => {
                self.places.insert(name.to_owned(), self.names.len());
                self.names.push(name.to_owned());
                self.names.len() - 1
            }
        };
        self.next = place + 1;
        self.put_at(place, value);
        Ok(())
    }

    fn put_at(&mut self, place: usize, value: impl fmt::Display) {
        if self.pass != Pass::Names {
            if self.cells.len() <= place {
                self.cells.resize(place + 1, String::new());
            }
            // A key that comes twice makes a cell that is not a number.
            let cell = &mut self.cells[place];
            if !cell.is_empty() {
                cell.push('|');
            }
            let _ = write!(cell, "{value}");
        }
    }

    /// Writes the row.
    fn end_row(&mut self) -> Result<(), SessionFileError> {
        self.next = 0;
        if self.pass == Pass::Cells {
            return Ok(());
        }
        if self.pass == Pass::Text {
            self.n_rows += 1;
            self.cells.resize(self.names.len().max(self.cells.len()), String::new());
            write_line(&mut self.rows, self.cells.iter().map(String::as_str));
            if self.rows.len() > self.max_bytes {
                let limit = self.max_bytes as u64;
                return Err(SessionFileError::Expands { what: "the JSON document", limit });
            }
        }
        self.cells.iter_mut().for_each(String::clear);
        Ok(())
    }

    fn text(mut self) -> Result<JsonTable, SessionFileError> {
        if self.n_rows == 0 {
            return self.text_of_columns();
        }
        if self.names.is_empty() {
            let width = self.list_width;
            // A list of numbers, such as an index, has no names.
            let is_name = |name: &str| name.parse::<f64>().is_err();
            let has_names = |column: &&Column| {
                column.ends.len() == width && (0..width).all(|i| is_name(column.get(i)))
            };
            let names = self.columns.iter().find(has_names);
            self.names = names
                .map_or(Vec::new(), |names| (0..width).map(|i| names.get(i).to_owned()).collect());
        }
        let mut text = Vec::with_capacity(self.rows.len() + 64);
        if !self.names.is_empty() {
            write_line(&mut text, self.names.iter().map(String::as_str));
        }
        text.append(&mut self.rows);
        let layout = match (self.is_by_line, self.list_width) {
            (true, _) => "one row a line",
            (false, 0) => "a list of objects",
            (false, _) => "a list of lists",
        };
        Ok(JsonTable { text, n_before: u64::from(!self.names.is_empty()), layout })
    }

    fn text_of_columns(mut self) -> Result<JsonTable, SessionFileError> {
        let length = |column: &Column| column.ends.len();
        let longest = self.columns.iter().map(length).max().unwrap_or(0);
        self.columns.retain(|column| length(column) * COLUMN_SHARE > longest);
        let Some(first) = self.columns.first() else {
            return Err(unfit("it has neither a list of rows nor lists of values"));
        };
        if let Some(other) = self.columns.iter().find(|other| length(other) != length(first)) {
            let (n, n_other) = (length(first), length(other));
            let (name, other) = (&first.name, &other.name);
            return Err(unfit(format!("`{name}` has {n} values, and `{other}` has {n_other}")));
        }
        let mut text = Vec::new();
        write_line(&mut text, self.columns.iter().map(|column| column.name.as_str()));
        for i in 0..longest {
            write_line(&mut text, self.columns.iter().map(|column| column.get(i)));
        }
        Ok(JsonTable { text, n_before: 1, layout: "a list of values for each column" })
    }
}

/// Rows that are documents, such as the messages of a topic.
pub(super) struct JsonMessages(Table);

impl JsonMessages {
    /// Messages of which the columns `names` are known.
    pub(super) fn new(names: &[&str]) -> Self {
        let mut table = Table { pass: Pass::Cells, ..Table::default() };
        table.names = names.iter().map(|name| (*name).to_owned()).collect();
        table.places = table.names.iter().cloned().zip(0..).collect();
        Self(table)
    }

    /// The names of the values that messages had so far.
    pub(super) fn names(&self) -> &[String] {
        &self.0.names
    }

    /// Reads a message; returns its cells, in the order of the names.
    ///
    /// # Errors
    /// The reason why it is not a row.
    pub(super) fn read(&mut self, message: &[u8]) -> Result<&[String], String> {
        let message = message.trim_ascii();
        self.parse(message).or_else(|error| match with_quotes(message) {
            Some(quoted) => self.parse(&quoted),
            None => Err(error),
        })?;
        Ok(&self.0.cells)
    }

    fn parse(&mut self, message: &[u8]) -> Result<(), String> {
        let Self(table) = self;
        table.cells.iter_mut().for_each(String::clear);
        table.next = 0;
        let mut json = serde_json::Deserializer::from_slice(message);
        let read = Row(table).deserialize(&mut json).and_then(|()| json.end());
        read.map_err(|error| crate::json::words(&error))
    }
}

/// Whether there is a value after the first one, which is an object.
fn is_by_line(bytes: &[u8]) -> bool {
    let bytes = bytes.trim_ascii();
    let mut values = serde_json::Deserializer::from_slice(bytes).into_iter::<IgnoredAny>();
    bytes.first() == Some(&b'{')
        && matches!(values.next(), Some(Ok(_)))
        && values.byte_offset() < bytes.len()
}

fn unfit(reason: impl Into<String>) -> SessionFileError {
    SessionFileError::Json(reason.into())
}

impl From<serde_json::Error> for SessionFileError {
    fn from(error: serde_json::Error) -> Self {
        match error.classify() {
            serde_json::error::Category::Data => unfit(error.to_string()),
            _ => Self::Damaged { format: SessionFormat::Json, reason: error.to_string() },
        }
    }
}

/// Visitors that write what they visit to the table that they borrow.
macro_rules! seeds {
    ($($name:ident),*) => {$(
        impl<'de> DeserializeSeed<'de> for $name<'_> {
            type Value = ();

            fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<(), D::Error> {
                json.deserialize_any(self)
            }
        }
    )*};
}

seeds!(Part, Element, Row, Member);

/// The values that are neither lists nor objects, each by its text.
macro_rules! visit_values {
    () => {
        fn visit_unit<E: de::Error>(self) -> Result<(), E> {
            self.value("")
        }

        fn visit_bool<E: de::Error>(self, value: bool) -> Result<(), E> {
            self.value(value)
        }

        fn visit_i64<E: de::Error>(self, value: i64) -> Result<(), E> {
            self.value(value)
        }

        fn visit_u64<E: de::Error>(self, value: u64) -> Result<(), E> {
            self.value(value)
        }

        fn visit_f64<E: de::Error>(self, value: f64) -> Result<(), E> {
            self.value(Value::from(value))
        }

        fn visit_str<E: de::Error>(self, value: &str) -> Result<(), E> {
            self.value(line_of(value))
        }
    };
}

/// The document, or an object within it that may have the rows or the columns.
struct Part<'a> {
    table: &'a mut Table,
    name: String,
    depth: usize,
}

impl Part<'_> {
    /// A setting beside the rows.
    #[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "as in the others")]
    fn value<E>(self, _: impl fmt::Display) -> Result<(), E> {
        Ok(())
    }
}

impl<'de> Visitor<'de> for Part<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("rows or columns")
    }

    visit_values!();

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Self { table, name, .. } = self;
        let mut column = Column::new(&name);
        while list.next_element_seed(Element { table, column: &mut column })?.is_some() {}
        table.columns.extend(Some(column).filter(|column| !column.ends.is_empty()));
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<(), A::Error> {
        let Self { table, name, depth } = self;
        let (mut column, mut is_list) = (Column::new(&name), false);
        while let Some(key) = object.next_key::<String>()? {
            // pandas names the values of a column, and rows, by their numbers.
            is_list |= key == "0";
            if is_list {
                object.next_value_seed(Element { table, column: &mut column })?;
            } else if depth < MAX_DEPTH {
                object.next_value_seed(Part { table, name: key, depth: depth + 1 })?;
            } else {
                object.next_value::<IgnoredAny>()?;
            }
        }
        table.columns.extend(Some(column).filter(|column| !column.ends.is_empty()));
        Ok(())
    }
}

/// An element of a list: a value of a column, or a row.
struct Element<'a> {
    table: &'a mut Table,
    column: &'a mut Column,
}

impl Element<'_> {
    fn value<E: de::Error>(self, value: impl fmt::Display) -> Result<(), E> {
        if self.table.place_of_rows.as_ref() == Some(&self.column.name) {
            return Err(E::custom(format!("`{value}` is not a row")));
        }
        if self.column.ends.is_empty() && self.table.columns.len() == MAX_COLUMNS {
            return Err(E::custom(format!("more than {MAX_COLUMNS} columns")));
        }
        if self.table.pass == Pass::Text {
            let _ = write!(self.column.values, "{value}");
        }
        let end = u32::try_from(self.column.values.len()).map_err(E::custom)?;
        self.column.ends.push(end);
        Ok(())
    }

    /// The table, for a row.
    fn row<E: de::Error>(&mut self) -> Result<Row<'_>, E> {
        let Self { table, column } = self;
        if !column.ends.is_empty() {
            return Err(E::custom("a list has values and rows"));
        }
        match &table.place_of_rows {
            None => table.place_of_rows = Some(column.name.clone()),
            Some(place) if *place == column.name => {}
            Some(place) => {
                let other = &column.name;
                return Err(E::custom(format!("two lists have rows, `{place}` and `{other}`")));
            }
        }
        Ok(Row(table))
    }
}

impl<'de> Visitor<'de> for Element<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value or a row")
    }

    visit_values!();

    fn visit_seq<A: SeqAccess<'de>>(mut self, list: A) -> Result<(), A::Error> {
        self.row()?.visit_seq(list)
    }

    fn visit_map<A: MapAccess<'de>>(mut self, object: A) -> Result<(), A::Error> {
        self.row()?.visit_map(object)
    }
}

/// A row: an object, or a list of values.
struct Row<'a>(&'a mut Table);

impl<'de> Visitor<'de> for Row<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a row, which is an object or a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Self(table) = self;
        let mut name = String::new();
        for place in 0.. {
            let value = Member { table, name: &mut name, place: Some(place) };
            if list.next_element_seed(value)?.is_none() {
                break;
            }
            table.list_width = table.list_width.max(place + 1);
        }
        table.end_row().map_err(de::Error::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<(), A::Error> {
        let Self(table) = self;
        let mut name = String::new();
        while let Some(key) = object.next_key::<String>()? {
            name.clear();
            name.push_str(&key);
            object.next_value_seed(Member { table, name: &mut name, place: None })?;
        }
        table.end_row().map_err(de::Error::custom)
    }
}

/// A value of a row, or an object or a list of values within it.
struct Member<'a> {
    table: &'a mut Table,
    /// The keys that lead to it.
    name: &'a mut String,
    /// Its place, if the row is a list.
    place: Option<usize>,
}

impl Member<'_> {
    fn value<E: de::Error>(self, value: impl fmt::Display) -> Result<(), E> {
        match self.place {
            Some(MAX_COLUMNS..) => Err(E::custom(format!("more than {MAX_COLUMNS} columns"))),
            Some(place) => {
                self.table.put_at(place, value);
                Ok(())
            }
            None => self.table.put(self.name, value),
        }
    }

    /// A value within this one, whose keys are longer by `key`.
    fn within(&mut self, key: fmt::Arguments<'_>) -> Member<'_> {
        let _ = self.name.write_fmt(key);
        Member { table: self.table, name: self.name, place: self.place }
    }
}

impl<'de> Visitor<'de> for Member<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value of a row")
    }

    visit_values!();

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<(), A::Error> {
        let length = self.name.len();
        for i in 0.. {
            if list.next_element_seed(self.within(format_args!("[{i}]")))?.is_none() {
                break;
            }
            self.name.truncate(length);
        }
        self.name.truncate(length);
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut object: A) -> Result<(), A::Error> {
        let length = self.name.len();
        while let Some(key) = object.next_key::<String>()? {
            object.next_value_seed(self.within(format_args!(".{key}")))?;
            self.name.truncate(length);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(document: &str) -> String {
        let table = table(document.as_bytes()).unwrap();
        String::from_utf8(table.text).unwrap()
    }

    fn error(document: &str) -> String {
        table(document.as_bytes()).map(|_| ()).unwrap_err().to_string()
    }

    #[test]
    fn each_way_of_writing_a_table_gives_the_same_text() {
        let expected = "t,x\n0,\n0.1,0.02\n";
        for document in [
            r#"[{"t":0},{"x":0.02,"t":0.1}]"#,
            "\u{feff} [ {\"t\": 0, \"x\": null}, {\"t\": 0.1, \"x\": 0.02} ]\n",
            "{\"t\":0}\n\n{\"t\":0.1,\"x\":0.02}\r\n",
            r#"{"rig":"a","samples":[{"t":0},{"t":0.1,"x":2e-2}]}"#,
            r#"{"data":{"rows":[{"t":0},{"t":0.1,"x":0.02}]},"size":[0.2,0.2]}"#,
            r#"{"t":[0,0.1],"x":[null,0.02]}"#,
            r#"{"samples":{"t":[0,0.1],"x":[null,0.02]},"n":2}"#,
            r#"{"t":{"0":0,"1":0.1},"x":{"0":null,"1":0.02}}"#,
            r#"{"0":{"t":0},"1":{"t":0.1,"x":0.02}}"#,
            r#"{"columns":["t","x"],"index":[0,1],"data":[[0,null],[0.1,0.02]]}"#,
            r#"{"data":[[0,null],[0.1,0.02]],"columns":["t","x"]}"#,
            r#"[["t","x"],[0,null],[0.1,0.02]]"#,
        ] {
            assert_eq!(text(document), expected, "{document}");
        }
        assert_eq!(text("[[0,1],[0.1,2]]"), "0,1\n0.1,2\n");
        let indexed = r#"{"size":[0.2,0.2],"index":[0,1],"data":[[0,1],[0.1,2]]}"#;
        assert_eq!(text(indexed), "0,1\n0.1,2\n", "numbers are not names");
    }

    #[test]
    fn values_within_values_have_their_own_columns() {
        let document = r#"[{"t":1767225600000000001,"ball":{"x":-0.0,"seen":true},"q":[1,[2,3]]}]"#;
        let expected =
            "t,ball.x,ball.seen,q[0],q[1][0],q[1][1]\n1767225600000000001,-0.0,true,1,2,3\n";
        assert_eq!(text(document), expected);
        assert_eq!(text(r##"[{"#1":"a,\"b\"\n","t":0}]"##), "\"#1\",t\n\"a,\"\"b\"\" \",0\n");
    }

    #[test]
    fn what_is_not_a_table_is_named() {
        for (document, reason) in [
            (r#"{"name":"a","size":0.2}"#, "it has neither a list of rows nor lists of values"),
            (r#"[{"t":0},3]"#, "`3` is not a row at line 1 column 10"),
            (r#"[3,{"t":0}]"#, "a list has values and rows at line 1 column 4"),
            (
                r#"{"a":[{"t":0}],"b":[{"t":0}]}"#,
                "two lists have rows, `a` and `b` at line 1 column 21",
            ),
            (r#"{"t":[0,1,2],"x":[0,1]}"#, "`t` has 3 values, and `x` has 2"),
        ] {
            let expected = format!("the JSON document is not a recording: {reason}");
            assert_eq!(error(document), expected, "{document}");
        }
        let cut = error(r#"[{"t":0},{"t":0."#);
        assert!(
            cut.starts_with("the JSON file is damaged, or was not written to its end"),
            "{cut}"
        );
        let many: Vec<String> = (0..=MAX_COLUMNS).map(|i| format!("\"c{i}\":0")).collect();
        let many = error(&format!("[{{{}}}]", many.join(",")));
        assert!(many.contains("more than 1000 columns"), "{many}");
        let deep = error(&"[".repeat(10_000));
        assert!(deep.contains("recursion limit"), "{deep}");
    }

    #[test]
    fn a_line_that_is_cut_is_a_row_that_is_rejected() {
        assert_eq!(text("{\"t\":0,\"x\":1},\n{\"t\":0.1,\"x\":2},\n"), "t,x\n0,1\n0.1,2\n");
        let cut = text("{\"t\":0,\"x\":1}\n{\"t\":0.1,\"x\n");
        assert_eq!(cut, "t,x\n0,1\n\"{\"\"t\"\":0.1,\"\"x\",\"{\"\"t\"\":0.1,\"\"x\"\n");
    }

    #[test]
    fn rows_that_lack_most_columns_take_no_more_memory_than_the_limit() {
        let names: Vec<String> = (0..MAX_COLUMNS).map(|i| format!("\"c{i}\":0")).collect();
        let document = format!("[{}{{{}}}]", "{},".repeat(200), names.join(","));
        let error = table_within(document.as_bytes(), 100 * MAX_COLUMNS).map(drop).unwrap_err();
        assert!(error.to_string().contains("expands to more than"), "{error}");
    }
}
