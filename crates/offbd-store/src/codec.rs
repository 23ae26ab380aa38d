//! The format of a chunk: samples as bytes, by column, compressed without loss.
//!
//! A chunk is a format byte, the number of samples, the columns `seq`, `t_s`, the two
//! commands and the two positions, and a checksum. Each column states which samples have a value
//! (none, all, or a bitmap). The values follow as plain little-endian words or, if that
//! is shorter, compressed by `pco`; of numbers that increase by one, only the first is
//! stored. Every bit of a number is kept, also of −0.0, subnormals and NaN.
//!
//! The checksum is a CRC-32 of the key of the chunk (its session and its first index) and
//! of its bytes: damaged data, and data in the wrong place, are never read as samples.

use pco::data_types::Number;
use pco::standalone::{simple_compress, simple_decompress};
use pco::{ChunkConfig, DeltaSpec};

use offbd_core::vocabulary::Sample;

/// Largest number of samples in one chunk. Callers must not exceed it: [`encode`] does
/// not check it, and [`decode`] refuses such a chunk.
pub const MAX_CHUNK_SAMPLES: usize = 65_536;

/// Values from which on compression is worth it; fewer are stored plain.
const MIN_PACKED: usize = 512;

/// Compression level of `pco`, 0 to 12, and its delta encoding: first differences where
/// they help, without a search for other regularities. For quantised commands and
/// positions with the noise of a camera or a touch panel this takes 120 ns per sample,
/// for 5.9 and 3.1 bytes per sample; with the search 160 ns for 5.8 and 3.2, and at the
/// default level of 8 200 to 300 ns for 5.7 and 2.9.
const LEVEL: usize = 4;
const DELTA: DeltaSpec = DeltaSpec::TryConsecutive(1);

/// How the values of a chunk are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// Without compression, which takes most of the time: for a chunk that will soon be
    /// merged.
    Plain,
    /// Compressed where that is shorter: for a chunk that will not change any more.
    Compact,
}

/// The format byte.
const FORMAT: u8 = 2;
/// The format without a checksum, of earlier versions.
const FORMAT_UNCHECKED: u8 = 1;
/// Bytes of the header: format and number of samples.
const HEADER: usize = 5;
/// Bytes of the checksum.
const CHECKSUM: usize = 4;
// Which samples have a value in a column.
const NONE: u8 = 0;
const ALL: u8 = 1;
const SOME: u8 = 2;
// How the values of a column are stored.
const PLAIN: u8 = 0;
const PACKED: u8 = 1;
const COUNTING: u8 = 2;

/// Why bytes are not a valid chunk.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodecError {
    #[error("the chunk ends at byte {at}, within its {what}")]
    Short { at: usize, what: &'static str },
    #[error("the checksum does not match: the data are damaged")]
    Checksum,
    #[error("format {found} is unknown; this version reads formats 1 to {FORMAT}")]
    Format { found: u8 },
    #[error("the chunk has {found} samples; at most {MAX_CHUNK_SAMPLES} are allowed")]
    TooMany { found: usize },
    #[error("unknown tag {found} for the {what} of a column")]
    Tag { what: &'static str, found: u8 },
    #[error("a compressed column cannot be read: {0}")]
    Packed(String),
    #[error("a column has {found} values instead of {expected}")]
    Count { found: usize, expected: usize },
    #[error("a sample has no t_s")]
    NoTime,
    #[error("{0} bytes follow the last column")]
    Trailing(usize),
}

/// A column value of eight bytes.
trait Word: Number + Copy {
    fn word(self) -> [u8; 8];
    fn from_word(word: [u8; 8]) -> Self;
    /// The next integer; `None` for the greatest one and for floating-point numbers.
    fn successor(self) -> Option<Self>;
}

impl Word for u64 {
    fn word(self) -> [u8; 8] {
        self.to_le_bytes()
    }
    fn from_word(word: [u8; 8]) -> Self {
        Self::from_le_bytes(word)
    }
    fn successor(self) -> Option<Self> {
        self.checked_add(1)
    }
}

impl Word for f64 {
    fn word(self) -> [u8; 8] {
        self.to_bits().to_le_bytes()
    }
    fn from_word(word: [u8; 8]) -> Self {
        Self::from_bits(u64::from_le_bytes(word))
    }
    fn successor(self) -> Option<Self> {
        None
    }
}

/// The place of a chunk.
#[derive(Clone, Copy, Debug)]
pub struct ChunkKey<'a> {
    /// Id of the session.
    pub session: &'a str,
    /// Index of the first sample in the session.
    pub first_index: i64,
}

impl ChunkKey<'_> {
    fn checksum(&self, bytes: &[u8]) -> [u8; CHECKSUM] {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(self.session.as_bytes());
        hasher.update(&self.first_index.to_le_bytes());
        hasher.update(bytes);
        hasher.finalize().to_le_bytes()
    }
}

/// Encodes `samples`, at most [`MAX_CHUNK_SAMPLES`], as the chunk `key`.
#[must_use]
pub fn encode(samples: &[Sample], packing: Packing, key: ChunkKey<'_>) -> Vec<u8> {
    let columns = samples.len() * size_of::<[u64; 6]>() + 12;
    let mut bytes = Vec::with_capacity(HEADER + columns + CHECKSUM);
    bytes.push(FORMAT);
    let n = u32::try_from(samples.len()).unwrap_or(u32::MAX);
    bytes.extend_from_slice(&n.to_le_bytes());
    put_column(&mut bytes, samples, packing, |s| s.seq);
    put_column(&mut bytes, samples, packing, |s| Some(s.t_s));
    put_column(&mut bytes, samples, packing, |s| s.cmd_qx_rad);
    put_column(&mut bytes, samples, packing, |s| s.cmd_qy_rad);
    put_column(&mut bytes, samples, packing, |s| s.x_m);
    put_column(&mut bytes, samples, packing, |s| s.y_m);
    let checksum = key.checksum(&bytes);
    bytes.extend_from_slice(&checksum);
    bytes
}

/// Decodes the chunk `key`.
///
/// # Errors
/// [`CodecError`] if `bytes` is not a result of [`encode`] with this key.
pub fn decode(bytes: &[u8], key: ChunkKey<'_>) -> Result<Vec<Sample>, CodecError> {
    let bytes = checked(bytes, key)?;
    let mut reader = ByteReader { bytes, at: 0 };
    let n = header(&mut reader)?;
    let seq = column::<u64>(&mut reader, n)?;
    let t_s = column::<f64>(&mut reader, n)?;
    let cmd_qx_rad = column::<f64>(&mut reader, n)?;
    let cmd_qy_rad = column::<f64>(&mut reader, n)?;
    let x_m = column::<f64>(&mut reader, n)?;
    let y_m = column::<f64>(&mut reader, n)?;
    if reader.at != bytes.len() {
        return Err(CodecError::Trailing(bytes.len() - reader.at));
    }
    let sample = |i: usize| {
        Some(Sample {
            seq: seq[i],
            t_s: t_s[i]?,
            cmd_qx_rad: cmd_qx_rad[i],
            cmd_qy_rad: cmd_qy_rad[i],
            x_m: x_m[i],
            y_m: y_m[i],
        })
    };
    (0..n).map(|i| sample(i).ok_or(CodecError::NoTime)).collect()
}

/// Returns the number of samples of the chunk `key` after checking its checksum.
pub(super) fn n_samples(bytes: &[u8], key: ChunkKey<'_>) -> Result<usize, CodecError> {
    header(&mut ByteReader { bytes: checked(bytes, key)?, at: 0 })
}

/// Checks the checksum. Returns the bytes before it.
fn checked<'b>(bytes: &'b [u8], key: ChunkKey<'_>) -> Result<&'b [u8], CodecError> {
    if bytes.first() != Some(&FORMAT) {
        return Ok(bytes);
    }
    match bytes.split_last_chunk::<CHECKSUM>() {
        Some((data, found)) if key.checksum(data) == *found => Ok(data),
        _ => Err(CodecError::Checksum),
    }
}

fn header(reader: &mut ByteReader<'_>) -> Result<usize, CodecError> {
    let header = reader.take(HEADER, "header")?;
    if ![FORMAT, FORMAT_UNCHECKED].contains(&header[0]) {
        return Err(CodecError::Format { found: header[0] });
    }
    let n = u32::from_le_bytes([header[1], header[2], header[3], header[4]]) as usize;
    if n > MAX_CHUNK_SAMPLES {
        return Err(CodecError::TooMany { found: n });
    }
    Ok(n)
}

fn put_column<T: Word>(
    bytes: &mut Vec<u8>,
    samples: &[Sample],
    packing: Packing,
    get: impl Fn(&Sample) -> Option<T>,
) {
    let mut values: Vec<T> = Vec::with_capacity(samples.len());
    values.extend(samples.iter().filter_map(&get));
    if values.is_empty() {
        bytes.push(NONE);
        return;
    }
    if values.len() == samples.len() {
        bytes.push(ALL);
    } else {
        bytes.push(SOME);
        put_bitmap(bytes, samples.iter().map(|s| get(s).is_some()));
    }
    put_values(bytes, &values, packing);
}

fn put_bitmap(bytes: &mut Vec<u8>, present: impl Iterator<Item = bool>) {
    let first = bytes.len();
    for (i, present) in present.enumerate() {
        if i % 8 == 0 {
            bytes.push(0);
        }
        bytes[first + i / 8] |= u8::from(present) << (i % 8);
    }
}

fn put_values<T: Word>(bytes: &mut Vec<u8>, values: &[T], packing: Packing) {
    let follows = |a: &T, b: &T| a.successor().is_some_and(|next| next.word() == b.word());
    if let Some(first) = values.first().filter(|_| values.is_sorted_by(follows)) {
        bytes.push(COUNTING);
        bytes.extend_from_slice(&first.word());
        return;
    }
    let plain = values.len() * 8;
    if let Some(packed) = pack(values, packing).filter(|packed| packed.len() + 4 < plain) {
        bytes.push(PACKED);
        let length = u32::try_from(packed.len()).unwrap_or(u32::MAX);
        bytes.extend_from_slice(&length.to_le_bytes());
        bytes.extend_from_slice(&packed);
        return;
    }
    bytes.push(PLAIN);
    values.iter().for_each(|v| bytes.extend_from_slice(&v.word()));
}

/// Compresses `values`; returns `None` if `packing` is plain or there are too few values.
fn pack<T: Word>(values: &[T], packing: Packing) -> Option<Vec<u8>> {
    if packing == Packing::Plain || values.len() < MIN_PACKED {
        return None;
    }
    let config = ChunkConfig::default().with_compression_level(LEVEL).with_delta_spec(DELTA);
    simple_compress(values, &config).ok()
}

fn column<T: Word>(reader: &mut ByteReader<'_>, n: usize) -> Result<Vec<Option<T>>, CodecError> {
    match reader.take(1, "column")?[0] {
        NONE => Ok(vec![None; n]),
        ALL => Ok(values(reader, n)?.into_iter().map(Some).collect()),
        SOME => {
            let bitmap = reader.take(n.div_ceil(8), "bitmap")?;
            let present: Vec<bool> = (0..n).map(|i| bitmap[i / 8] >> (i % 8) & 1 == 1).collect();
            let n_present = present.iter().filter(|p| **p).count();
            let mut values = values::<T>(reader, n_present)?.into_iter();
            Ok(present.into_iter().map(|p| if p { values.next() } else { None }).collect())
        }
        found => Err(CodecError::Tag { what: "presence", found }),
    }
}

fn values<T: Word>(reader: &mut ByteReader<'_>, expected: usize) -> Result<Vec<T>, CodecError> {
    match reader.take(1, "column")?[0] {
        PLAIN => {
            let words = reader.take(expected * 8, "values")?.as_chunks::<8>().0;
            Ok(words.iter().map(|word| T::from_word(*word)).collect())
        }
        PACKED => {
            let length = reader.take(4, "length")?;
            let length = u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize;
            let packed = reader.take(length, "values")?;
            let values: Vec<T> =
                simple_decompress(packed).map_err(|e| CodecError::Packed(e.to_string()))?;
            if values.len() != expected {
                return Err(CodecError::Count { found: values.len(), expected });
            }
            Ok(values)
        }
        COUNTING => {
            let first = reader.take(8, "values")?.as_chunks::<8>().0;
            let count =
                std::iter::successors(first.first().map(|w| T::from_word(*w)), |v| v.successor());
            let values: Vec<T> = count.take(expected).collect();
            if values.len() != expected {
                return Err(CodecError::Count { found: values.len(), expected });
            }
            Ok(values)
        }
        found => Err(CodecError::Tag { what: "values", found }),
    }
}

struct ByteReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> ByteReader<'a> {
    fn take(&mut self, n: usize, what: &'static str) -> Result<&'a [u8], CodecError> {
        let short = CodecError::Short { at: self.bytes.len(), what };
        let end = self.at.checked_add(n).ok_or(short.clone())?;
        let taken = self.bytes.get(self.at..end).ok_or(short)?;
        self.at = end;
        Ok(taken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::vocabulary::any_sample;
    use proptest::prelude::*;

    const KEY: ChunkKey<'_> = ChunkKey { session: "s", first_index: 8192 };

    /// A chunk as the versions without a checksum wrote it.
    fn unchecked(samples: &[Sample]) -> Vec<u8> {
        let mut bytes = encode(samples, Packing::Compact, KEY);
        bytes.truncate(bytes.len() - CHECKSUM);
        bytes[0] = FORMAT_UNCHECKED;
        bytes
    }

    fn edge_case() -> impl Strategy<Value = f64> {
        prop_oneof![
            any::<u64>().prop_map(f64::from_bits),
            Just(-0.0),
            Just(f64::MIN_POSITIVE / 8.0),
            Just(f64::MAX),
            (-1000i32..1000).prop_map(|i| f64::from(i) * 0.01),
        ]
    }

    fn sample() -> impl Strategy<Value = Sample> {
        any_sample(any::<u64>(), edge_case)
    }

    type Bits = (Option<u64>, u64, [Option<u64>; 4]);

    fn bits(samples: &[Sample]) -> Vec<Bits> {
        let reading = |v: Option<f64>| v.map(f64::to_bits);
        let of = |s: &Sample| {
            let readings = [s.cmd_qx_rad, s.cmd_qy_rad, s.x_m, s.y_m].map(reading);
            (s.seq, s.t_s.to_bits(), readings)
        };
        samples.iter().map(of).collect()
    }

    proptest! {
        #[test]
        fn every_bit_survives(samples in proptest::collection::vec(sample(), 0..1200)) {
            for packing in [Packing::Plain, Packing::Compact] {
                let back = decode(&encode(&samples, packing, KEY), KEY).expect("own bytes");
                prop_assert_eq!(bits(&back), bits(&samples));
            }
        }

        /// Consecutive sequence numbers up to the greatest integer, with or without a gap.
        #[test]
        fn a_count_survives_and_is_short(n in 2..300u64, after in 0..500u64, gap in 0..600u64) {
            let first = u64::MAX - n - after;
            let seq = |i| Some(first + i + u64::from(i >= gap));
            let sample = |i| Sample { seq: seq(i), t_s: i as f64, ..Sample::default() };
            let samples: Vec<_> = (0..n).map(sample).collect();
            let bytes = encode(&samples, Packing::Plain, KEY);
            prop_assert_eq!(bits(&decode(&bytes, KEY).expect("own bytes")), bits(&samples));
            let nameless: Vec<_> = samples.iter().map(|s| Sample { seq: None, ..*s }).collect();
            let extra = bytes.len() - encode(&nameless, Packing::Plain, KEY).len();
            prop_assert_eq!(extra == 9, gap == 0 || gap >= n, "{} bytes", extra);
        }

        #[test]
        fn one_changed_bit_or_another_key_is_noticed(
            samples in proptest::collection::vec(sample(), 0..700),
            bit in any::<proptest::sample::Index>(),
        ) {
            let mut bytes = encode(&samples, Packing::Compact, KEY);
            let bit = bit.index(8 * bytes.len());
            let next = ChunkKey { first_index: 8193, ..KEY };
            prop_assert_eq!(decode(&bytes, next), Err(CodecError::Checksum));
            let other = ChunkKey { session: "t", ..KEY };
            prop_assert_eq!(decode(&bytes, other), Err(CodecError::Checksum));
            bytes[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(decode(&bytes, KEY).is_err());
            prop_assert!(n_samples(&bytes, KEY).is_err());
        }

        #[test]
        fn chunks_of_earlier_versions_are_read(samples in proptest::collection::vec(sample(), 0..700)) {
            let back = decode(&unchecked(&samples), KEY).expect("the former format");
            prop_assert_eq!(bits(&back), bits(&samples));
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = decode(&bytes, KEY);
        }

        #[test]
        fn a_cut_chunk_is_refused(
            samples in proptest::collection::vec(sample(), 1..40),
            cut in 0.0..1.0f64,
        ) {
            let bytes = encode(&samples, Packing::Compact, KEY);
            let keep = (bytes.len() as f64 * cut) as usize;
            prop_assert!(decode(&bytes[..keep], KEY).is_err());
        }
    }

    #[test]
    fn a_usual_recording_shrinks_to_a_third() {
        let samples: Vec<Sample> = (0..4096u32)
            .map(|i| {
                let t = f64::from(i) * 0.01;
                let round = |v: f64| (v * 1e4).round() / 1e4;
                Sample {
                    seq: Some(u64::from(i)),
                    t_s: t,
                    cmd_qx_rad: Some(round(0.05 * (t * 0.7).sin())),
                    cmd_qy_rad: Some(round(0.05 * (t * 0.9).cos())),
                    x_m: (i % 97 != 0).then(|| round(0.1 * t.sin())),
                    y_m: (i % 97 != 0).then(|| round(0.1 * t.cos())),
                }
            })
            .collect();
        let bytes = encode(&samples, Packing::Compact, KEY);
        assert!(bytes.len() * 3 < samples.len() * 48, "{} bytes", bytes.len());
    }
}
