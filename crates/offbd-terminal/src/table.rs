//! Text tables: columns without lines between them, at most 80 characters wide.

use std::io::IsTerminal;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

/// Width of a table, characters: the default of terminals.
const WIDTH: u16 = 80;

/// A table with this heading. The columns with an index in `right` are aligned to the
/// right.
pub fn table(heading: &[&str], right: &[usize]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
    table.set_header(heading.iter().copied());
    for (i, column) in table.column_iter_mut().enumerate() {
        let padding = (if i == 0 { 0 } else { 1 }, 1);
        column.set_padding(padding);
        if right.contains(&i) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// A table whose first column has file names. If stdout is not a terminal, no cell is
/// wrapped, so that programs find the names.
pub fn table_of_files(heading: &[&str], right: &[usize]) -> Table {
    let mut table = table(heading, right);
    if !std::io::stdout().is_terminal() {
        table.set_content_arrangement(ContentArrangement::Disabled);
    }
    table
}

/// The text for the share (0 to 1) and the seconds of a session that were judged.
pub fn judged(share: f64, seconds: f64) -> String {
    format!("{:.0} % {seconds:.1} s", 100.0 * share)
}

/// The lines of `table` without trailing blanks.
pub fn lines(table: &Table) -> impl Iterator<Item = String> {
    table.lines().map(|line| line.trim_end().to_owned())
}

/// Wraps `text` at blanks, after `lead`. Later lines are indented by the width of `lead`.
pub fn wrapped(lead: &str, text: &str) -> String {
    let indent = lead.chars().count();
    let room = usize::from(WIDTH).saturating_sub(indent);
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        let used = lines[last].chars().count();
        if used > 0 && used + 1 + word.chars().count() > room {
            lines.push(word.to_owned());
        } else {
            let blank = if used > 0 { " " } else { "" };
            lines[last] += &format!("{blank}{word}");
        }
    }
    format!("{lead}{}", lines.join(&format!("\n{}", " ".repeat(indent))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_sentences_break_at_blanks_within_eighty_characters() {
        let text = wrapped("  - ", &"abcdefg ".repeat(30));
        assert!(text.lines().count() > 2);
        assert!(text.lines().all(|l| l.chars().count() <= 80));
        assert!(text.starts_with("  - a"));
        assert!(text.lines().skip(1).all(|l| l.starts_with("    a")));
    }
}
