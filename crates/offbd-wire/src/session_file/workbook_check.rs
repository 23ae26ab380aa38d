//! Checks how much memory the library takes to read a workbook, before it reads it.
//!
//! The library (`calamine`) keeps texts, styles and names of sheets, copies those that are
//! referred to, reserves memory for the number of texts that a workbook states, and holds a tag
//! or a text as a whole. Here its parts are read by the same XML parser, one event at a time.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use zip::ZipArchive;

use super::byte_budget::ByteBudget;
use super::{SessionFileError, SessionFormat};

/// Decompressed bytes that are read of a workbook, over all its parts. Chosen: a million rows of
/// six cells of 60 bytes. A workbook with more is refused.
const MAX_WORKBOOK_BYTES: u64 = 384 << 20;

/// Bytes of the list of a workbook's parts, which is in memory several times. Chosen: ten thousand
/// parts; a workbook has some ten. A workbook with a longer one is refused.
const MAX_DIRECTORY_BYTES: u64 = 1 << 20;

/// Longest tag, comment or text of a cell, bytes; it is in memory as a whole. Chosen: no cell of a
/// spreadsheet has more than 32 767 characters. A workbook with a longer one is refused.
const MAX_TEXT_BYTES: u64 = 1 << 20;

/// What the library keeps of a workbook beside one cell, bytes. Chosen: half a million texts that
/// cells share, or 100 000 styles. A workbook with more is refused.
const MAX_KEPT_BYTES: u64 = 64 << 20;

/// Most digits of the number of texts that a workbook states. Chosen: more texts than
/// [`MAX_KEPT_BYTES`] allows. A workbook with more is refused.
const MAX_COUNT_DIGITS: usize = 7;

/// Deepest nesting of elements, because the names of all open ones are in memory; those of a
/// workbook have some ten levels. A workbook with a deeper one is refused.
const MAX_DEPTH: usize = 64;

/// Memory for a text that cells share, beside its bytes; for its place in a list that grows.
const TEXT_BYTES: u64 = 64;

/// Memory for a style, a sheet or another element that is kept, beside its texts.
const ELEMENT_BYTES: u64 = 512;

/// Checks a workbook from its start on.
///
/// # Errors
/// [`SessionFileError::Expands`]; [`SessionFileError::Damaged`].
pub(super) fn check<S: Read + Seek>(source: &mut S) -> Result<(), SessionFileError> {
    let mut directory = Limited::new(&mut *source, MAX_DIRECTORY_BYTES);
    if let Err(error) = ZipArchive::new(&mut directory) {
        let is_exceeded = directory.is_exceeded;
        let too_long = || expands("the list of its parts", MAX_DIRECTORY_BYTES);
        return Err(if is_exceeded { too_long() } else { damaged(error) });
    }
    let mut archive = ZipArchive::new(source).map_err(damaged)?;
    let mut check = WorkbookCheck {
        total: ByteBudget::new("the file", MAX_WORKBOOK_BYTES),
        kept: ByteBudget::new("the list of its texts and styles", MAX_KEPT_BYTES),
        n_copies: 0,
        longest: 0,
    };
    for i in 0..archive.len() {
        check.part(archive.by_index(i).map_err(damaged)?)?;
    }
    check.kept.spend(2 * check.n_copies * check.longest)
}

pub(super) fn damaged(reason: impl ToString) -> SessionFileError {
    SessionFileError::Damaged { format: SessionFormat::Xlsx, reason: reason.to_string() }
}

fn expands(what: &'static str, limit: u64) -> SessionFileError {
    SessionFileError::Expands { what, limit }
}

struct WorkbookCheck {
    total: ByteBudget,
    kept: ByteBudget,
    /// Elements that get a copy of the texts that they refer to: styles and sheets.
    n_copies: u64,
    /// Bytes of the longest tag with such a text.
    longest: u64,
}

impl WorkbookCheck {
    fn part(&mut self, part: impl Read) -> Result<(), SessionFileError> {
        let mut xml = Reader::from_reader(BufReader::new(Limited::new(part, MAX_TEXT_BYTES)));
        // As in the library.
        xml.config_mut().check_end_names = false;
        xml.config_mut().expand_empty_elements = true;
        let (mut buffer, mut state) = (Vec::new(), PartState::default());
        loop {
            buffer.clear();
            let event = xml.read_event_into(&mut buffer);
            let part = xml.get_mut().get_mut();
            self.total.spend(std::mem::take(&mut part.n_read))?;
            match event {
                Ok(Event::Eof) => return Ok(()),
                Ok(event) => self.event(&event, &mut state)?,
                Err(_) if part.is_exceeded => {
                    return Err(expands("a tag or a text of the file", MAX_TEXT_BYTES));
                }
                // A picture, for example. Here the library could not read on, either.
                Err(_) => return Ok(()),
            }
            if state.whole.is_none() {
                part.left = MAX_TEXT_BYTES;
            }
        }
    }

    fn event(&mut self, event: &Event<'_>, state: &mut PartState) -> Result<(), SessionFileError> {
        match event {
            Event::Start(tag) => {
                state.depth += 1;
                if state.depth > MAX_DEPTH {
                    return Err(damaged(format!(
                        "its elements are nested deeper than {MAX_DEPTH}"
                    )));
                }
                self.start(tag, state)
            }
            Event::End(tag) => {
                state.depth = state.depth.saturating_sub(1);
                state.whole.take_if(|name| *name == tag.name().into_inner());
                Ok(())
            }
            Event::Text(_) | Event::CData(_) | Event::GeneralRef(_) if state.keeps_texts => {
                self.kept.spend(event.len() as u64)
            }
            _ => Ok(()),
        }
    }

    fn start(
        &mut self,
        tag: &BytesStart<'_>,
        state: &mut PartState,
    ) -> Result<(), SessionFileError> {
        let n_bytes = tag.len() as u64;
        let name = tag.local_name().into_inner();
        match name {
            "sst" => {
                let stated = tag.split_once("uniqueCount").map_or("", |(_, stated)| stated);
                let mut numbers = stated.split(|c: char| !c.is_ascii_digit());
                if numbers.any(|digits| digits.len() > MAX_COUNT_DIGITS) {
                    return Err(damaged("it states a number of texts that it cannot have"));
                }
                state.keeps_texts = true;
            }
            "definedName" => state.keeps_texts = true,
            "xf" | "sheet" => self.n_copies += 1,
            "numFmt" | "name" | "Relationship" => self.longest = self.longest.max(n_bytes),
            _ => {}
        }
        match name {
            "si" => self.kept.spend(TEXT_BYTES)?,
            "sheet" | "definedName" | "Relationship" | "numFmt" | "font" | "fill" | "border"
            | "xf" => {
                self.kept.spend(ELEMENT_BYTES + 2 * n_bytes)?;
            }
            _ => {}
        }
        if state.whole.is_none() && ["si", "is", "t", "v", "f", "definedName"].contains(&name) {
            state.whole = Some(tag.name().into_inner().to_owned());
        }
        Ok(())
    }
}

#[derive(Default)]
struct PartState {
    /// Elements that are open.
    depth: usize,
    /// The open element whose content is in memory as a whole, by its name.
    whole: Option<String>,
    /// Whether texts may be kept from here on.
    keeps_texts: bool,
}

/// A source of which only so much is read.
struct Limited<S> {
    source: S,
    left: u64,
    n_read: u64,
    is_exceeded: bool,
}

impl<S> Limited<S> {
    const fn new(source: S, left: u64) -> Self {
        Self { source, left, n_read: 0, is_exceeded: false }
    }
}

impl<S: Read> Read for Limited<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.source.read(buffer)?;
        self.n_read += n as u64;
        let Some(left) = self.left.checked_sub(n as u64) else {
            self.is_exceeded = true;
            return Err(io::ErrorKind::FileTooLarge.into());
        };
        self.left = left;
        Ok(n)
    }
}

impl<S: Seek> Seek for Limited<S> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.source.seek(to)
    }
}
