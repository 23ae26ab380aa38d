//! Text tables: columns without lines between them, at most 80 characters wide.

use std::io::IsTerminal;

use anstream::{AutoStream, ColorChoice};
use clap::builder::styling::{AnsiColor, Style};
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

/// How the text of a cell looks in a terminal with colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    Good,
    Doubtful,
    Bad,
}

impl Look {
    const ALL: [Self; 3] = [Self::Good, Self::Doubtful, Self::Bad];

    /// A character without a width. It begins each word of a cell until the table has its lines:
    /// escape sequences would count as width, and wrapping would break them.
    const fn mark(self) -> char {
        match self {
            Self::Good => '\u{2061}',
            Self::Doubtful => '\u{2062}',
            Self::Bad => '\u{2063}',
        }
    }

    const fn style(self) -> Style {
        match self {
            Self::Good => AnsiColor::Green.on_default(),
            Self::Doubtful => AnsiColor::Yellow.on_default(),
            Self::Bad => AnsiColor::Red.on_default(),
        }
    }
}

/// A text for the last cell of a row, in colour if stdout is a terminal that shows it, `TERM` is
/// not `dumb`, and `NO_COLOR` is not set.
pub fn coloured(text: &str, look: Look) -> String {
    match AutoStream::choice(&std::io::stdout()) {
        ColorChoice::Never => text.to_owned(),
        _ => marked(text, look),
    }
}

fn marked(text: &str, look: Look) -> String {
    let marked = |word: &str| format!("{}{word}", look.mark());
    let line = |line: &str| line.split(' ').map(marked).collect::<Vec<_>>().join(" ");
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// A line with the colour of the marks in it, from the first one on.
fn painted(line: &str) -> String {
    let first = |look: &Look| Some((line.find(look.mark())?, look.style()));
    let Some((begin, style)) = Look::ALL.iter().find_map(first) else { return line.to_owned() };
    let is_mark = |c: char| Look::ALL.iter().any(|look| look.mark() == c);
    format!("{}{style}{}{style:#}", &line[..begin], line[begin..].replace(is_mark, ""))
}

/// The lines of `table` without trailing blanks.
pub fn lines(table: &Table) -> impl Iterator<Item = String> {
    table.lines().map(|line| painted(line.trim_end()))
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
    fn colours_do_not_change_where_a_table_breaks() {
        let text =
            "x_servo (dead) at 20.93 s, later probably slow, 55 % at 40.10 s; not judged: sensor";
        let of = |cell: &str| {
            let mut table = table(&["session", "verdict"], &[]);
            table.add_row(["ラボ3号機.csv", cell]);
            lines(&table).collect::<Vec<_>>()
        };
        let (plain, bad) = (of(text), of(&marked(text, Look::Bad)));
        assert_eq!(plain.len(), 3, "{plain:?}");
        let stripped = bad.iter().map(|l| l.replace("\u{1b}[31m", "").replace("\u{1b}[0m", ""));
        assert_eq!(stripped.collect::<Vec<_>>(), plain);
        assert_eq!(bad[0], plain[0], "the heading has no colour");
        assert!(bad[1].contains(" \u{1b}[31mx_servo (dead)") && bad[1].ends_with("\u{1b}[0m"));
    }

    #[test]
    fn long_sentences_break_at_blanks_within_eighty_characters() {
        let text = wrapped("  - ", &"abcdefg ".repeat(30));
        assert!(text.lines().count() > 2);
        assert!(text.lines().all(|l| l.chars().count() <= 80));
        assert!(text.starts_with("  - a"));
        assert!(text.lines().skip(1).all(|l| l.starts_with("    a")));
    }
}
