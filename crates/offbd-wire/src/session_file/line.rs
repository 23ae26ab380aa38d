//! Lines of the text as which a sheet or a JSON document is read.

/// Bytes of a cell of a sheet or a JSON document that are read. Chosen: names and numbers are
/// shorter, and many cells may have one long text.
pub(super) const LONGEST_CELL: usize = 200;

/// Returns a text as one line, as a row is one; of a long text the beginning and a sign of that.
pub(super) fn line_of(text: &str) -> String {
    let mut chars = text.chars();
    let line = chars.by_ref().take(LONGEST_CELL).map(|c| if c.is_control() { ' ' } else { c });
    let mut line: String = line.collect();
    line.extend(chars.next().map(|_| '…'));
    line
}

/// Writes a line of a CSV text. A cell is one line.
pub(super) fn write_line<'a>(text: &mut Vec<u8>, cells: impl Iterator<Item = &'a str>) {
    for (i, cell) in cells.enumerate() {
        text.extend((i > 0).then_some(b','));
        // A line that begins with one of these signs may be a comment.
        if cell.contains([',', '"']) || cell.starts_with(['#', '%']) {
            text.push(b'"');
            text.extend_from_slice(cell.replace('"', "\"\"").as_bytes());
            text.push(b'"');
        } else {
            text.extend_from_slice(cell.as_bytes());
        }
    }
    text.push(b'\n');
}
