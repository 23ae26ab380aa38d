//! The sizes of the pages of a Parquet file.
//!
//! A reader reserves as much memory as the head of a page says that the page has, up to 2 GiB
//! for a file of a few bytes. So the heads are read beforehand. A head is a structure in
//! Thrift's compact protocol, of which only the sizes matter here.

use std::io::{Read, Seek};

use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};

use super::byte_budget::ByteBudget;
use super::shared_source::SharedSource;
use super::{SessionFileError, SessionFormat};

/// Longest page that is read, bytes, before and after its compression. Chosen: most programs
/// write pages of 1 MiB. A longer one is refused.
const MAX_PAGE_BYTES: u64 = 16 << 20;

/// Longest head of a page, bytes. It has statistics of at most a few values.
const MAX_HEAD_BYTES: usize = 64 << 10;

/// Bytes that are read for a head at first.
const USUAL_HEAD_BYTES: usize = 512;

/// Deepest nesting in the head of a page; those of the format have three levels.
const MAX_DEPTH: usize = 8;

/// Checks the pages of the columns `leaves`, each of them and all together.
///
/// # Errors
/// [`SessionFileError::TooLarge`]; [`SessionFileError::Expands`]; [`SessionFileError::Damaged`].
pub(super) fn check<S: Read + Seek>(
    source: &SharedSource<S>,
    metadata: &ParquetMetaData,
    leaves: &[usize],
) -> Result<(), SessionFileError> {
    let mut budget = ByteBudget::of_file(source.n_bytes());
    metadata
        .row_groups()
        .iter()
        .try_for_each(|group| check_group(source, group, leaves, &mut budget))
}

/// Checks the pages of the columns `leaves` in a row group.
///
/// # Errors
/// As of [`check`].
pub(super) fn check_group<S: Read + Seek>(
    source: &SharedSource<S>,
    group: &RowGroupMetaData,
    leaves: &[usize],
    budget: &mut ByteBudget,
) -> Result<(), SessionFileError> {
    for chunk in leaves.iter().filter_map(|&leaf| group.columns().get(leaf)) {
        let (start, length) = (page_start(chunk), chunk.compressed_size());
        let (Ok(start), Ok(length)) = (u64::try_from(start), u64::try_from(length)) else {
            return Err(damaged("a column has a negative position"));
        };
        check_chunk(source, start, start.saturating_add(length), budget)?;
    }
    Ok(())
}

/// The position of the first page of a column.
fn page_start(chunk: &parquet::file::metadata::ColumnChunkMetaData) -> i64 {
    chunk.dictionary_page_offset().unwrap_or_else(|| chunk.data_page_offset())
}

fn check_chunk<S: Read + Seek>(
    source: &SharedSource<S>,
    mut at: u64,
    end: u64,
    budget: &mut ByteBudget,
) -> Result<(), SessionFileError> {
    while at < end {
        let bytes = source.read_at(at, USUAL_HEAD_BYTES)?;
        let head = match PageHead::parse(&bytes) {
            None => PageHead::parse(&source.read_at(at, MAX_HEAD_BYTES)?),
            head => head,
        };
        let head = head.ok_or_else(|| damaged("the head of a page cannot be read"))?;
        for found in [head.compressed, head.uncompressed] {
            if found > MAX_PAGE_BYTES {
                return Err(SessionFileError::TooLarge {
                    what: "a page",
                    found,
                    limit: MAX_PAGE_BYTES,
                });
            }
        }
        let n_bytes = head.n_bytes as u64;
        // Also what is not compressed: the columns of a file may share their pages.
        budget.spend(n_bytes + head.compressed.max(head.uncompressed))?;
        at += n_bytes + head.compressed;
    }
    Ok(())
}

fn damaged(reason: &str) -> SessionFileError {
    SessionFileError::Damaged { format: SessionFormat::Parquet, reason: reason.to_owned() }
}

/// The sizes that the head of a page states, bytes.
#[derive(Debug, PartialEq, Eq)]
struct PageHead {
    uncompressed: u64,
    compressed: u64,
    /// Of the head itself.
    n_bytes: usize,
}

/// The fields of the structure `PageHeader` of the format.
const UNCOMPRESSED_SIZE: u8 = 2;
const COMPRESSED_SIZE: u8 = 3;

impl PageHead {
    /// Parses the head at the start of `bytes`; `None` if it is not complete, or invalid.
    fn parse(bytes: &[u8]) -> Option<Self> {
        let mut thrift = Thrift { bytes, at: 0 };
        let (mut uncompressed, mut compressed) = (None, None);
        let mut field = 0_u8;
        while let Some((delta, kind)) = thrift.field()? {
            field = field.checked_add(delta).filter(|_| delta > 0)?;
            match (field, kind) {
                (UNCOMPRESSED_SIZE, I32) => uncompressed = Some(thrift.size()?),
                (COMPRESSED_SIZE, I32) => compressed = Some(thrift.size()?),
                _ => thrift.skip(kind, MAX_DEPTH)?,
            }
        }
        Some(Self { uncompressed: uncompressed?, compressed: compressed?, n_bytes: thrift.at })
    }
}

// Types of the compact protocol.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BYTE: u8 = 3;
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const SET: u8 = 10;
const STRUCT: u8 = 12;

/// A reader of the compact protocol. Its functions return `None` at the end of the bytes and
/// for what no head of a page has.
struct Thrift<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Thrift<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// Reads a size, a signed number that must not be negative.
    fn size(&mut self) -> Option<u64> {
        let zigzag = self.varint()?;
        (zigzag & 1 == 0).then_some(zigzag >> 1)
    }

    /// Reads the head of a field: the difference of its number to the last one, and its type;
    /// the inner `None` is the end of the structure.
    fn field(&mut self) -> Option<Option<(u8, u8)>> {
        let byte = self.byte()?;
        Some((byte != 0).then_some((byte >> 4, byte & 0x0f)))
    }

    fn advance(&mut self, n: u64) -> Option<()> {
        let at = self.at.checked_add(usize::try_from(n).ok()?)?;
        self.at = at;
        (at <= self.bytes.len()).then_some(())
    }

    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match kind {
            TRUE | FALSE => Some(()),
            BYTE => self.advance(1),
            I16 | I32 | I64 => self.varint().map(drop),
            DOUBLE => self.advance(8),
            BINARY => {
                let n = self.varint()?;
                self.advance(n)
            }
            LIST | SET => self.skip_list(depth),
            STRUCT => {
                while let Some((delta, kind)) = self.field()? {
                    if delta == 0 {
                        self.varint()?;
                    }
                    self.skip(kind, depth)?;
                }
                Some(())
            }
            _ => None,
        }
    }

    fn skip_list(&mut self, depth: usize) -> Option<()> {
        let head = self.byte()?;
        let n = match head >> 4 {
            15 => self.varint()?,
            n => u64::from(n),
        };
        // Each element has a byte at least, also a truth value.
        for _ in 0..n {
            match head & 0x0f {
                TRUE | FALSE => self.advance(1)?,
                kind => self.skip(kind, depth)?,
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The head of a data page of 100 bytes, 60 compressed: type 0, sizes, a CRC, and a
    /// structure with a number, encodings and statistics.
    const HEAD: &[u8] = &[
        0x15, 0x00, 0x15, 0xc8, 0x01, 0x15, 0x78, 0x15, 0x02, 0x1c, 0x15, 0x14, 0x15, 0x00, 0x15,
        0x06, 0x15, 0x06, 0x1c, 0x18, 0x02, 0xaa, 0xbb, 0x00, 0x00, 0x00, 0xff,
    ];

    #[test]
    fn a_head_gives_the_sizes_of_its_page_and_its_own() {
        let expected = PageHead { uncompressed: 100, compressed: 60, n_bytes: HEAD.len() - 1 };
        assert_eq!(PageHead::parse(HEAD), Some(expected));
    }

    #[test]
    fn no_part_of_a_head_is_a_head() {
        for n in 0..HEAD.len() - 1 {
            assert_eq!(PageHead::parse(&HEAD[..n]), None, "{n} bytes");
        }
    }

    #[test]
    fn a_page_that_claims_to_be_larger_than_the_limit_is_refused() {
        // 2 GiB less one byte, in a file of 15.
        let head = |uncompressed: &[u8], compressed: &[u8]| {
            [&[0x15, 0, 0x15], uncompressed, &[0x15], compressed, &[0]].concat()
        };
        let (small, large) = (&[0x78][..], &[0xfe, 0xff, 0xff, 0xff, 0x0f][..]);
        for (bytes, is_refused) in
            [(head(small, large), true), (head(large, small), true), (head(small, &[0]), false)]
        {
            let end = bytes.len() as u64;
            let source = SharedSource::new(std::io::Cursor::new(bytes)).unwrap();
            let found = check_chunk(&source, 0, end, &mut ByteBudget::new("", 1 << 30));
            let too_large = matches!(found, Err(SessionFileError::TooLarge { .. }));
            assert_eq!(too_large, is_refused, "{found:?}");
        }
    }

    #[test]
    fn the_pages_of_all_columns_count_together() {
        // Four pages of 100 bytes, none of which are in the file.
        let bytes = [0x15, 0, 0x15, 0xc8, 0x01, 0x15, 0, 0].repeat(4);
        let end = bytes.len() as u64;
        let source = SharedSource::new(std::io::Cursor::new(bytes)).unwrap();
        let mut budget = ByteBudget::new("", 8 * 108);
        assert!(check_chunk(&source, 0, end, &mut budget).is_ok());
        assert!(check_chunk(&source, 0, end, &mut budget).is_ok());
        let found = check_chunk(&source, 0, end, &mut budget);
        assert!(matches!(found, Err(SessionFileError::Expands { limit: 864, .. })), "{found:?}");
    }

    #[test]
    fn negative_sizes_deep_nesting_and_endless_lists_are_refused() {
        assert_eq!(PageHead::parse(&[0x15, 0, 0x15, 0x01, 0x15, 0x78, 0]), None);
        assert_eq!(PageHead::parse(&[[0x1c; 100].as_slice(), &[0; 100]].concat()), None);
        let list = [0x19, 0xf0 | STRUCT, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f];
        assert_eq!(PageHead::parse(&list), None);
    }
}
