//! The encoding of a text file: UTF-8, UTF-16 or, if it is neither, Windows-1252.

use std::borrow::Cow;
use std::io::{self, BufReader, Read};

use encoding_rs::{CoderResult, Decoder, Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// Bytes that are decoded at a time, and that the caller may read in pieces. Chosen: the buffer
/// of [`BufReader`].
const BLOCK_BYTES: usize = 8 << 10;

/// Longest UTF-8 sequence that the decoder writes, bytes: a smaller buffer makes no progress.
const LONGEST_SEQUENCE: usize = 4;

/// Returns the encoding of a file that begins with `head`, and the length of its byte order mark.
pub(super) fn detect(head: &[u8]) -> (&'static Encoding, usize) {
    if let Some((encoding, mark)) = Encoding::for_bom(head) {
        return (encoding, mark);
    }
    (without_mark(head), 0)
}

fn without_mark(head: &[u8]) -> &'static Encoding {
    // Numbers and separators in UTF-16 have a zero in each of their two bytes that is high.
    let zeros = |from: usize| head.iter().skip(from).step_by(2).filter(|b| **b == 0).count();
    let (even, odd) = (zeros(0), zeros(1));
    if odd > head.len() / 4 && even == 0 {
        return UTF_16LE;
    }
    if even > head.len() / 4 && odd == 0 {
        return UTF_16BE;
    }
    match std::str::from_utf8(head) {
        Err(error) if error.error_len().is_some() => WINDOWS_1252,
        // A character that the end of the head cuts is not an error.
        _ => UTF_8,
    }
}

/// Returns a whole text as UTF-8, without its byte order mark; what is not UTF-8 is left to the parser.
pub(crate) fn decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    let (encoding, mark) = detect(bytes);
    let bytes = &bytes[mark..];
    if encoding == UTF_8 {
        return Cow::Borrowed(bytes);
    }
    let (text, _) = encoding.decode_without_bom_handling(bytes);
    Cow::Owned(text.into_owned().into_bytes())
}

/// Returns `source`, which is in `encoding`, as UTF-8.
pub(super) fn as_utf8<'a>(
    source: impl Read + Send + 'a,
    encoding: &'static Encoding,
) -> Box<dyn Read + Send + 'a> {
    if encoding == UTF_8 {
        // The reader of the cells reports what is not UTF-8 by its line.
        return Box::new(source);
    }
    let decoder = encoding.new_decoder_without_bom_handling();
    let decoded =
        Decoded { source, decoder, input: Vec::new(), next: 0, is_ended: false, is_done: false };
    Box::new(BufReader::with_capacity(BLOCK_BYTES, decoded))
}

/// A text whose lines end with a carriage return alone, as old programs write it, with line feeds.
pub(super) struct WithLines<R>(pub(super) R);

impl<R: Read> Read for WithLines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.0.read(buffer)?;
        buffer[..n].iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
        Ok(n)
    }
}

/// Decodes while it is read.
struct Decoded<R> {
    source: R,
    decoder: Decoder,
    /// Bytes of the source, of which those from `next` on are not decoded yet.
    input: Vec<u8>,
    next: usize,
    is_ended: bool,
    /// Whether the decoder has written its last character; it may not be asked again.
    is_done: bool,
}

impl<R: Read> Decoded<R> {
    fn fill(&mut self) -> io::Result<()> {
        self.input.clear();
        self.next = 0;
        let n = self.source.by_ref().take(BLOCK_BYTES as u64).read_to_end(&mut self.input)?;
        self.is_ended = n == 0;
        Ok(())
    }
}

impl<R: Read> Read for Decoded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.len() < LONGEST_SEQUENCE {
            return Err(io::Error::other("the buffer is too small for a character"));
        }
        while !self.is_done {
            if self.next == self.input.len() && !self.is_ended {
                self.fill()?;
            }
            let rest = &self.input[self.next..];
            let (result, n_read, n_written, _) =
                self.decoder.decode_to_utf8(rest, buffer, self.is_ended);
            self.next += n_read;
            self.is_done = self.is_ended && result == CoderResult::InputEmpty;
            if n_written > 0 {
                return Ok(n_written);
            }
        }
        Ok(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bytes: &[u8]) -> String {
        let (encoding, mark) = detect(&bytes[..bytes.len().min(64)]);
        let mut text = String::new();
        as_utf8(&bytes[mark..], encoding).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn a_text_is_the_same_in_each_encoding() {
        let text = format!("Zeit [µs];Winkel [°]\n{}", "1;2,5\n".repeat(5000));
        assert_eq!(decode(text.as_bytes()), text);
        assert_eq!(decode(format!("\u{feff}{text}").as_bytes()), text);
        // A reader may ask again after the end.
        let mut latin = as_utf8(&b"1;\xb5"[..], WINDOWS_1252);
        let mut text_of = String::new();
        for _ in 0..3 {
            latin.read_to_string(&mut text_of).unwrap();
        }
        assert_eq!(text_of, "1;µ");
        let (latin, ..) = WINDOWS_1252.encode(&text);
        assert_eq!(decode(&latin), text);
        for (mark, bytes) in [
            ([0xff, 0xfe], u16::to_le_bytes as fn(u16) -> [u8; 2]),
            ([0xfe, 0xff], u16::to_be_bytes),
        ] {
            let wide: Vec<u8> = text.encode_utf16().flat_map(bytes).collect();
            assert_eq!(decode(&[&mark[..], &wide].concat()), text);
            assert_eq!(decode(&wide), text, "without a mark");
        }
    }
}
