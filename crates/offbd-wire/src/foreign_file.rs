//! Files of other programs that are not recordings: what they begin with, and what to do with them.

/// A file of another program.
#[derive(Debug, thiserror::Error)]
#[error("this is {what}, not a recording; {advice}")]
pub struct ForeignFileError {
    /// What the file is.
    pub what: &'static str,
    /// What to do with it.
    pub advice: &'static str,
}

/// Bytes that show the format of a file.
pub(crate) const HEAD_BYTES: u64 = 128;

/// What files begin with that are not recordings, what they are, and what to do with them.
const FOREIGN: [(&[u8], &str, &str); 9] = [
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook", AS_XLSX),
    (b"MATLAB 5.0 MAT-file", "a MATLAB file", AS_CSV),
    (b"\x89HDF\r\n", "an HDF5 or MATLAB file", AS_CSV),
    (b"\x1f\x8b", "a gzip file", "unpack it first"),
    (b"7z\xbc\xaf", "a 7-Zip file", "unpack it first"),
    (b"SQLite format 3\0", "an SQLite database", "restore it with `offbd restore`, or export CSV"),
    (b"\x89PNG\r\n", "a picture", AS_RECORDING),
    (b"\xff\xd8\xff", "a picture", AS_RECORDING),
    (b"%PDF-", "a PDF document", AS_RECORDING),
];

/// What an OpenDocument file has within its first bytes.
const OPEN_DOCUMENT: &[u8] = b"mimetypeapplication/vnd.oasis.opendocument";

const AS_XLSX: &str = "save it as .xlsx or as CSV in the spreadsheet program";
const AS_CSV: &str = "write it as CSV, with the columns t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m";
const AS_RECORDING: &str = "a recording is a table of times, commands and positions";

/// How the entries of a workbook begin. Any may be the first.
const OF_WORKBOOKS: [&[u8]; 5] = [b"[Content_Types]", b"_rels", b"xl/", b"docProps", b"customXml"];

/// Whether a file that begins with `head` is a zip file and not a workbook.
fn is_other_zip(head: &[u8]) -> bool {
    // The name of the first entry (APPNOTE.TXT of PKWARE, 4.3.7).
    let name = head.strip_prefix(b"PK\x03\x04").and_then(|rest| rest.get(26..));
    name.is_some_and(|name| !OF_WORKBOOKS.iter().any(|start| name.starts_with(start)))
}

/// Checks that a file that begins with `head` is not one of another program.
///
/// # Errors
/// [`ForeignFileError`].
pub(crate) fn check_own(head: &[u8]) -> Result<(), ForeignFileError> {
    let open_document = || {
        let is_here = head.windows(OPEN_DOCUMENT.len()).any(|bytes| bytes == OPEN_DOCUMENT);
        is_here.then_some(("an OpenDocument file", AS_XLSX))
    };
    let found = FOREIGN.iter().find(|(signature, ..)| head.starts_with(signature));
    let zip = || is_other_zip(head).then_some(("a zip file", "unpack it first"));
    let known = found.map(|(_, what, advice)| (*what, *advice));
    match known.or_else(open_document).or_else(zip) {
        Some((what, advice)) => Err(ForeignFileError { what, advice }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_programs_are_named() {
        let open_document =
            [&b"PK\x03\x04\x14"[..], &[0; 25], OPEN_DOCUMENT, b".spreadsheet"].concat();
        for (head, what) in [
            (
                &b"\xd0\xcf\x11\xe0\xa1\xb1"[..],
                "an old Excel workbook, not a recording; save it as",
            ),
            (&open_document, "an OpenDocument file"),
            (b"\x89HDF\r\n\x1a\n", "an HDF5 or MATLAB file, not a recording; write it as CSV"),
            (b"MATLAB 5.0 MAT-file, Platform", "a MATLAB file"),
            (b"\x1f\x8b\x08", "a gzip file, not a recording; unpack it first"),
            (b"\x89PNG\r\n\x1a\n", "a picture"),
        ] {
            let error = check_own(head).unwrap_err().to_string();
            assert!(error.starts_with(&format!("this is {what}")), "{error}");
        }
        for own in
            [&b"t_s,x_m\n"[..], b"", b"PK\x03\x04", b"PAR1", b"\x89MCAP0\r\n", b"\xff\xfet\0"]
        {
            assert!(check_own(own).is_ok(), "{own:?}");
        }
    }
}
