//! Rust source as the rules need it: without comments, and as a list of paths.
//!
//! Not a parser: it knows comments, literals, `use` groups and inline modules,
//! which is all that the rules ask about.

/// A source file without its comments.
pub struct Source {
    /// String and character literals are blank.
    pub code: String,
    /// What the string literals say, with the line on which each begins.
    pub strings: Vec<(usize, String)>,
}

/// A path such as `crate::engine::Setup`, groups spelt out.
#[derive(Debug, PartialEq, Eq)]
pub struct Named {
    pub line: usize,
    pub segments: Vec<String>,
    /// Inline modules around it.
    pub inline_depth: usize,
}

impl Source {
    pub fn new(text: &str) -> Self {
        let mut source = Self { code: String::new(), strings: Vec::new() };
        let chars: Vec<char> = text.chars().collect();
        let mut at = 0;
        while at < chars.len() {
            at = source.take(&chars, at);
        }
        source
    }

    /// Takes what begins at `at`; returns where it ends.
    fn take(&mut self, chars: &[char], at: usize) -> usize {
        let rest = &chars[at..];
        let in_word = at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_');
        match rest {
            ['/', '/', ..] => self.blank(chars, at, line_length(rest)),
            ['/', '*', ..] => self.blank(chars, at, block_length(rest)),
            ['r', '#' | '"', ..] if !in_word => match raw_length(&rest[1..]) {
                Some((hashes, length)) => {
                    self.string(chars, at, 1 + length, 2 + hashes, 1 + hashes)
                }
                None => self.keep(rest[0], at),
            },
            ['"', ..] => self.string(chars, at, quoted_length(rest), 1, 1),
            ['\'', '\\', ..] => self.blank(chars, at, 2 + quoted_length_of(&rest[2..], '\'')),
            ['\'', _, '\'', ..] => self.blank(chars, at, 3),
            _ => self.keep(rest[0], at),
        }
    }

    fn keep(&mut self, char: char, at: usize) -> usize {
        self.code.push(char);
        at + 1
    }

    fn blank(&mut self, chars: &[char], at: usize, length: usize) -> usize {
        let end = (at + length).min(chars.len());
        self.code.extend(chars[at..end].iter().map(|&c| if c == '\n' { '\n' } else { ' ' }));
        end
    }

    fn string(
        &mut self,
        chars: &[char],
        at: usize,
        length: usize,
        open: usize,
        close: usize,
    ) -> usize {
        let end = (at + length).min(chars.len());
        let inner = chars.get(at + open..end.saturating_sub(close)).unwrap_or_default();
        self.strings.push((self.line(), inner.iter().collect()));
        self.blank(chars, at, length)
    }

    fn line(&self) -> usize {
        1 + self.code.matches('\n').count()
    }

    /// Every path of two segments or more.
    pub fn paths(&self) -> Vec<Named> {
        let tokens = tokens(&self.code);
        let mut reader = Reader { tokens: &tokens, at: 0, found: Vec::new() };
        reader.read();
        reader.found
    }

    /// Lines on which `word` stands by itself.
    pub fn lines_with(&self, word: &str) -> Vec<usize> {
        let hits = tokens(&self.code).into_iter().filter(|t| t.text == word);
        hits.map(|t| t.line).collect()
    }
}

fn line_length(rest: &[char]) -> usize {
    rest.iter().position(|&c| c == '\n').unwrap_or(rest.len())
}

/// Block comments nest.
fn block_length(rest: &[char]) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        match &rest[at..] {
            ['/', '*', ..] => (depth, at) = (depth + 1, at + 2),
            ['*', '/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at
}

/// Hashes and length of a raw string from its first hash or quote on.
fn raw_length(rest: &[char]) -> Option<(usize, usize)> {
    let hashes = rest.iter().take_while(|&&c| c == '#').count();
    (rest.get(hashes) == Some(&'"')).then_some(())?;
    let end: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
    let body = &rest[hashes + 1..];
    let inner = body.windows(end.len()).position(|w| w == end).unwrap_or(body.len());
    Some((hashes, hashes + 1 + inner + end.len()))
}

fn quoted_length(rest: &[char]) -> usize {
    1 + quoted_length_of(&rest[1..], '"')
}

/// Characters up to and with the closing `quote`.
fn quoted_length_of(rest: &[char], quote: char) -> usize {
    let mut at = 0;
    while at < rest.len() && rest[at] != quote {
        at += if rest[at] == '\\' { 2 } else { 1 };
    }
    at + 1
}

struct Token {
    text: String,
    line: usize,
}

/// Words, `::` and single characters.
fn tokens(code: &str) -> Vec<Token> {
    let mut tokens: Vec<Token> = Vec::new();
    let (mut line, mut in_word) = (1, false);
    for c in code.chars() {
        let is_word = c.is_alphanumeric() || c == '_';
        match tokens.last_mut() {
            Some(last) if is_word && in_word => last.text.push(c),
            Some(last) if c == ':' && last.text == ":" => last.text.push(c),
            _ if c.is_whitespace() => {}
            _ => tokens.push(Token { text: c.to_string(), line }),
        }
        in_word = is_word;
        line += usize::from(c == '\n');
    }
    tokens
}

struct Reader<'a> {
    tokens: &'a [Token],
    at: usize,
    found: Vec<Named>,
}

impl Reader<'_> {
    fn text(&self, ahead: usize) -> &str {
        self.tokens.get(self.at + ahead).map_or("", |t| &t.text)
    }

    fn read(&mut self) {
        // For each open brace, whether it is that of an inline module.
        let mut braces = Vec::new();
        while self.at < self.tokens.len() {
            match self.text(0) {
                "{" => {
                    let is_module = self.at > 1 && self.tokens[self.at - 2].text == "mod";
                    braces.push(is_module);
                    self.at += 1;
                }
                "}" => {
                    braces.pop();
                    self.at += 1;
                }
                _ => {
                    let depth = braces.iter().filter(|&&is_module| is_module).count();
                    self.path(&[], depth);
                }
            }
        }
    }

    /// Reads a path that continues `prefix`, or steps over one token.
    fn path(&mut self, prefix: &[String], inline_depth: usize) {
        let mut segments = prefix.to_vec();
        let line = self.tokens[self.at].line;
        while self.text(0).starts_with(|c: char| c.is_alphabetic() || c == '_') {
            segments.push(self.text(0).to_owned());
            self.at += 1;
            match (self.text(0), self.text(1)) {
                ("::", "{") => {
                    self.at += 2;
                    return self.group(&segments, inline_depth);
                }
                ("::", _) => self.at += 1,
                _ => break,
            }
        }
        if segments.len() > 1 && segments.len() > prefix.len() {
            self.found.push(Named { line, segments, inline_depth });
        } else if segments.len() == prefix.len() {
            self.at += 1;
        }
    }

    fn group(&mut self, prefix: &[String], inline_depth: usize) {
        while self.at < self.tokens.len() && self.text(0) != "}" {
            self.path(prefix, inline_depth);
        }
        self.at += 1;
    }
}
