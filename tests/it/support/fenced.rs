//! The fenced blocks of a document.

use std::path::Path;

/// A block, without the indentation of its list item.
pub struct FencedBlock {
    pub language: String,
    pub text: String,
    /// The line of its fence, from 1.
    pub line: usize,
}

/// Reads a file of the project; `path` is relative to its root.
pub fn document(path: &str) -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Returns the blocks of `document` in order.
pub fn blocks(document: &str) -> Vec<FencedBlock> {
    let mut blocks = Vec::new();
    let mut open: Option<(FencedBlock, usize)> = None;
    for (i, line) in document.lines().enumerate() {
        let indented = line.len() - line.trim_start().len();
        let fence = line.trim_start().strip_prefix("```");
        match (open.take(), fence) {
            (None, Some(language)) => {
                let block =
                    FencedBlock { language: language.to_owned(), text: String::new(), line: i + 1 };
                open = Some((block, indented));
            }
            (Some((block, _)), Some(_)) => blocks.push(block),
            (Some((mut block, indented_by)), None) => {
                block.text += line.get(indented_by..).unwrap_or_default();
                block.text.push('\n');
                open = Some((block, indented_by));
            }
            (None, None) => {}
        }
    }
    blocks
}
