//! The mapping of the columns of a table to the quantities of a sample, as one writes it:
//!
//! ```text
//! t_s=time/ms, cmd_qx_rad=MV_x/deg, x_m=ball_x*0.000235-0.079, y_m=-'ball y'/cm
//! ```
//!
//! A mapping is a list of `QUANTITY=EXPRESSION`. An expression is a sum of columns and constants,
//! each with any number of factors: `*NUMBER`, `/NUMBER` or `/UNIT`, or `NUMBER*` before it. A
//! column is written by its name, in quotes if the name has blanks or one of `+-*/,='"(`, or by
//! its number: `#1` is the first. The time may be a date, or a date and a time of day:
//! `t_s=date+clock`. `y_m=none` leaves a quantity out.

use std::fmt;

use crate::session_csv::COLUMNS;

/// Longest mapping, bytes. Chosen: a mapping has a hundred.
const MAX_BYTES: usize = 4096;

/// Why a mapping is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("in the mapping of columns, {place}: {reason}")]
pub struct MappingError {
    /// The part of the mapping that is wrong.
    pub place: String,
    pub reason: String,
}

impl MappingError {
    pub(super) fn new(place: impl fmt::Display, reason: impl Into<String>) -> Self {
        Self { place: format!("`{place}`"), reason: reason.into() }
    }
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ColumnName {
    Name(String),
    /// Number of the column, from 1.
    Number(usize),
}

impl fmt::Display for ColumnName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(n) => write!(f, "#{n}"),
            Self::Name(name) if is_plain(name) => f.write_str(name),
            Self::Name(name) if name.contains('\'') => write!(f, "\"{name}\""),
            Self::Name(name) => write!(f, "'{name}'"),
        }
    }
}

/// Longest name of a column that a mapping is proposed with, bytes. Chosen: a mapping has at most
/// [`MAX_BYTES`]; a longer name is given by its number.
const LONGEST_NAME: usize = 200;

/// Returns the name of a column, if it has one that no other column has, that can be put in quotes
/// and is not too long.
pub(super) fn own_name(names: &[String], column: usize) -> Option<&str> {
    let has_both_quotes = |name: &String| name.contains('\'') && name.contains('"');
    let is_usable =
        |name: &&String| (1..=LONGEST_NAME).contains(&name.len()) && !has_both_quotes(name);
    let name = names.get(column).filter(is_usable)?;
    let is_same = |other: &&String| other.eq_ignore_ascii_case(name);
    (names.iter().filter(is_same).count() == 1).then_some(name)
}

/// Whether a column's name needs no quotes.
fn is_plain(name: &str) -> bool {
    let starts_as_number = name.starts_with(|c: char| c.is_ascii_digit() || c == '.' || c == '#');
    !name.is_empty() && !starts_as_number && !name.contains(|c| ends_name(c) || c == '(')
}

fn ends_name(c: char) -> bool {
    c.is_whitespace() || "+-*/,='\"".contains(c)
}

/// A part of a sum: a column or, without one, a constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    pub column: Option<ColumnName>,
    pub factor: f64,
}

/// What leaves a quantity out.
const NONE: &str = "none";

/// A sum of columns and constants; without terms, the quantity is left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expression {
    pub terms: Vec<Term>,
}

/// The expression of each quantity, in the order of [`COLUMNS`]; `None` where the mapping says
/// nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnMapping {
    pub expressions: [Option<Expression>; COLUMNS.len()],
}

impl ColumnMapping {
    /// Whether nothing is mapped.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.expressions.iter().all(Option::is_none)
    }

    /// Returns the mapping with names instead of the numbers of columns that have one.
    #[must_use]
    pub(crate) fn with_names(&self, names: &[String]) -> Self {
        let named = |e: &Option<Expression>| e.as_ref().map(|e| e.with_names(names));
        Self { expressions: self.expressions.each_ref().map(named) }
    }
}

impl std::str::FromStr for ColumnMapping {
    type Err = MappingError;

    fn from_str(text: &str) -> Result<Self, MappingError> {
        if text.len() > MAX_BYTES {
            let reason = format!("has {} bytes; at most {MAX_BYTES} are read", text.len());
            return Err(MappingError::new("…", reason));
        }
        let mut parser = Parser { rest: text.trim() };
        let mut mapping = Self::default();
        while !parser.rest.is_empty() {
            let (quantity, expression) = parser.entry()?;
            if mapping.expressions[quantity].replace(expression).is_some() {
                return Err(MappingError::new(COLUMNS[quantity], "is mapped twice"));
            }
        }
        Ok(mapping)
    }
}

impl fmt::Display for ColumnMapping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for (quantity, expression) in self.expressions.iter().enumerate() {
            if let Some(expression) = expression {
                write!(f, "{separator}{}=", COLUMNS[quantity])?;
                expression.write(f, Dimension::of(quantity))?;
                separator = ", ";
            }
        }
        Ok(())
    }
}

impl Expression {
    /// Returns the expression with names instead of the numbers of columns that have one.
    #[must_use]
    pub(crate) fn with_names(&self, names: &[String]) -> Self {
        let mut named = self.clone();
        for term in &mut named.terms {
            if let Some(ColumnName::Number(n)) = &term.column
                && let Some(name) = own_name(names, n - 1)
            {
                term.column = Some(ColumnName::Name(name.to_owned()));
            }
        }
        named
    }

    /// Returns the expression of the quantity with this index in [`COLUMNS`] as it is parsed.
    #[must_use]
    pub(crate) fn text(&self, quantity: usize) -> String {
        struct Written<'a>(&'a Expression, Dimension);
        impl fmt::Display for Written<'_> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.write(f, self.1)
            }
        }
        Written(self, Dimension::of(quantity)).to_string()
    }

    /// Writes the expression of a quantity of `dimension` as it is parsed.
    fn write(&self, f: &mut fmt::Formatter<'_>, dimension: Dimension) -> fmt::Result {
        if self.terms.is_empty() {
            return f.write_str(NONE);
        }
        for (i, Term { column, factor }) in self.terms.iter().enumerate() {
            let plus = if i > 0 { "+" } else { "" };
            f.write_str(if factor.is_sign_negative() { "-" } else { plus })?;
            let size = factor.abs();
            let Some(column) = column else {
                write!(f, "{size}")?;
                continue;
            };
            match dimension.units().iter().find(|(_, factor)| *factor == size) {
                Some((word, _)) => write!(f, "{column}/{word}")?,
                None => write!(f, "{column}*{size}")?,
            }
        }
        Ok(())
    }
}

/// The units that a factor may name, each with the SI units that it is.
const TIMES: &[(&str, f64)] =
    &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0), ("h", 3600.0)];
const LENGTHS: &[(&str, f64)] =
    &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("um", 1e-6), ("in", 0.0254)];
const ANGLES: &[(&str, f64)] = &[
    ("rad", 1.0),
    ("mrad", 1e-3),
    ("deg", std::f64::consts::PI / 180.0),
    ("turn", std::f64::consts::TAU),
];

/// What a quantity is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dimension {
    Time,
    Angle,
    Length,
}

impl Dimension {
    /// The dimension of the quantity with this index in [`COLUMNS`].
    #[must_use]
    pub(crate) const fn of(quantity: usize) -> Self {
        match quantity {
            0 => Self::Time,
            1 | 2 => Self::Angle,
            _ => Self::Length,
        }
    }

    /// The units of this dimension.
    #[must_use]
    pub(crate) const fn units(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Time => TIMES,
            Self::Length => LENGTHS,
            Self::Angle => ANGLES,
        }
    }
}

struct Parser<'a> {
    rest: &'a str,
}

impl<'a> Parser<'a> {
    /// Parses `QUANTITY=EXPRESSION` and the comma after it.
    fn entry(&mut self) -> Result<(usize, Expression), MappingError> {
        let whole = self.rest;
        let Some((name, rest)) = whole.split_once('=') else {
            return Err(MappingError::new(whole, "must be QUANTITY=EXPRESSION"));
        };
        let name = name.trim();
        let Some(quantity) = COLUMNS.iter().position(|column| column.eq_ignore_ascii_case(name))
        else {
            let reason = format!("is not a quantity; there are {}", COLUMNS.join(", "));
            return Err(MappingError::new(name, reason));
        };
        self.rest = rest;
        let expression = self.expression(Dimension::of(quantity), COLUMNS[quantity])?;
        if !self.rest.is_empty() {
            self.rest = self.rest[1..].trim_start();
        }
        Ok((quantity, expression))
    }

    /// Parses up to a comma or the end.
    fn expression(
        &mut self,
        dimension: Dimension,
        quantity: &str,
    ) -> Result<Expression, MappingError> {
        let mut terms = Vec::new();
        if let Some(rest) = self.rest.trim_start().strip_prefix(NONE).map(str::trim_start)
            && (rest.is_empty() || rest.starts_with(','))
        {
            self.rest = rest;
            return Ok(Expression::default());
        }
        loop {
            self.rest = self.rest.trim_start();
            let is_negative = match self.rest.chars().next() {
                Some(sign @ ('+' | '-')) => {
                    self.rest = self.rest[1..].trim_start();
                    sign == '-'
                }
                _ if terms.is_empty() => false,
                None | Some(',') => break,
                Some(_) => {
                    let reason = "is left over; a term is a column or a number, with *NUMBER, \
                        /NUMBER or /UNIT, and terms are joined by + or -";
                    return Err(MappingError::new(self.piece(), reason));
                }
            };
            let mut term = self.term(dimension, quantity)?;
            if is_negative {
                term.factor = -term.factor;
            }
            terms.push(term);
        }
        if terms.iter().all(|term| term.column.is_none()) {
            return Err(MappingError::new(quantity, "is mapped to no column"));
        }
        Ok(Expression { terms })
    }

    fn term(&mut self, dimension: Dimension, quantity: &str) -> Result<Term, MappingError> {
        let mut term = match self.number() {
            Some(constant) => Term { column: None, factor: constant },
            None => Term { column: Some(self.column(quantity)?), factor: 1.0 },
        };
        loop {
            self.rest = self.rest.trim_start();
            let Some(operator @ ('*' | '/')) = self.rest.chars().next() else { break };
            self.rest = self.rest[1..].trim_start();
            // The column may follow its factor.
            if term.column.is_none() && operator == '*' && !self.starts_as_number() {
                term.column = Some(self.column(quantity)?);
            } else {
                term.factor *= self.factor(operator, dimension)?;
            }
        }
        if term.factor == 0.0 || !term.factor.is_finite() {
            let what = term.column.map_or_else(|| "0".to_owned(), |column| column.to_string());
            return Err(MappingError::new(what, "has a factor that is zero or not finite"));
        }
        Ok(term)
    }

    fn factor(&mut self, operator: char, dimension: Dimension) -> Result<f64, MappingError> {
        let sign = match self.rest.strip_prefix('-') {
            Some(rest)
                if operator == '*'
                    && rest.starts_with(|c: char| c.is_ascii_digit() || c == '.') =>
            {
                self.rest = rest;
                -1.0
            }
            _ => 1.0,
        };
        if let Some(number) = self.number() {
            return Ok(sign * if operator == '*' { number } else { 1.0 / number });
        }
        let word = self.piece().to_owned();
        let units = dimension.units();
        let unit = units.iter().find(|(unit, _)| *unit == word);
        let Some((_, si)) = unit.filter(|_| operator == '/') else {
            let words: Vec<&str> = units.iter().map(|(word, _)| *word).collect();
            let reason = match operator {
                '*' => "is not a number; `*` is followed by a number".to_owned(),
                _ => format!("is neither a number nor a unit; units here are {}", words.join(", ")),
            };
            return Err(MappingError::new(word, reason));
        };
        self.rest = &self.rest[word.len()..];
        Ok(*si)
    }

    /// The text up to the next character that ends a name.
    fn piece(&self) -> &'a str {
        let end = self.rest.find(ends_name).unwrap_or(self.rest.len());
        let first = self.rest.chars().next().map_or(0, char::len_utf8);
        &self.rest[..end.max(first)]
    }

    /// Takes a number without a sign; `None` if there is none.
    fn number(&mut self) -> Option<f64> {
        let bytes = self.rest.as_bytes();
        let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
        let mut end = digits(0);
        let mut n_digits = end;
        if bytes.get(end) == Some(&b'.') {
            let decimals = digits(end + 1);
            n_digits += decimals;
            end += 1 + decimals;
        }
        if n_digits == 0 {
            return None;
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let exponent = digits(end + 1 + sign);
            if exponent > 0 {
                end += 1 + sign + exponent;
            }
        }
        let (number, rest) = self.rest.split_at(end);
        if rest.chars().next().is_some_and(|c| !ends_name(c)) {
            // A name that begins with a digit.
            return None;
        }
        self.rest = rest;
        number.parse().ok()
    }

    fn starts_as_number(&self) -> bool {
        self.rest.starts_with(|c: char| c.is_ascii_digit() || c == '.' || c == '-')
    }

    fn column(&mut self, quantity: &str) -> Result<ColumnName, MappingError> {
        if let Some(quote @ ('\'' | '"')) = self.rest.chars().next() {
            let Some((name, rest)) = self.rest[1..].split_once(quote) else {
                return Err(MappingError::new(self.rest, "has a quote that is never closed"));
            };
            self.rest = rest;
            return Ok(ColumnName::Name(name.to_owned()));
        }
        let piece = self.piece();
        if piece.is_empty() || piece.starts_with(ends_name) {
            return Err(MappingError::new(quantity, "lacks a column"));
        }
        if piece.contains('(') {
            let reason = "is not a name; an expression is a sum of columns with factors, without \
                functions; put a column's name with such characters in quotes";
            return Err(MappingError::new(piece, reason));
        }
        self.rest = &self.rest[piece.len()..];
        match piece.strip_prefix('#') {
            None => Ok(ColumnName::Name(piece.to_owned())),
            Some(number) => match number.parse() {
                Ok(n) if n > 0 => Ok(ColumnName::Number(n)),
                _ => Err(MappingError::new(piece, "is not the number of a column, from #1")),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<ColumnMapping, String> {
        text.parse::<ColumnMapping>().map_err(|error| error.to_string())
    }

    #[test]
    fn a_mapping_has_units_factors_offsets_and_signs() {
        let mapping = parse(
            "t_s = time/ms, cmd_qx_rad=-MV_x/deg,x_m=ball_x_px*0.000235-0.079, y_m='ball y [cm]'/cm+#3/mm*2",
        )
        .unwrap();
        let [t, qx, qy, x, y] = &mapping.expressions;
        let column =
            |name: &str, factor| Term { column: Some(ColumnName::Name(name.into())), factor };
        assert_eq!(t.as_ref().unwrap().terms, [column("time", 1e-3)]);
        assert_eq!(qx.as_ref().unwrap().terms, [column("MV_x", -std::f64::consts::PI / 180.0)]);
        assert_eq!(*qy, None);
        let constant = Term { column: None, factor: -0.079 };
        assert_eq!(x.as_ref().unwrap().terms, [column("ball_x_px", 0.000235), constant]);
        let third = Term { column: Some(ColumnName::Number(3)), factor: 1e-3 * 2.0 };
        assert_eq!(y.as_ref().unwrap().terms, [column("ball y [cm]", 1e-2), third]);
        for text in ["x_m=a*-0.5+1", "x_m=-0.5*a+1", "x_m=1-a*0.5", "x_m=-a/2+1"] {
            let mapping = parse(text).unwrap();
            let terms = &mapping.expressions[3].as_ref().unwrap().terms;
            assert!(terms.contains(&column("a", -0.5)), "{text}: {terms:?}");
            assert!(terms.contains(&Term { column: None, factor: 1.0 }), "{text}: {terms:?}");
        }
        let mapping = parse("cmd_qx_rad=none , x_m=none/mm, y_m= none").unwrap();
        let [_, qx, _, x, y] = &mapping.expressions;
        assert_eq!((qx, y), (&Some(Expression::default()), &Some(Expression::default())));
        assert_eq!(x.as_ref().unwrap().terms, [column("none", 1e-3)]);
        assert_eq!(mapping.to_string(), "cmd_qx_rad=none, x_m=none/mm, y_m=none");
    }

    #[test]
    fn a_name_with_a_bracket_is_written_in_quotes() {
        let mapping = parse("x_m='x (m)'/mm+#2*2+y[0]*2").unwrap();
        assert_eq!(parse(&mapping.to_string()), Ok(mapping.clone()));
        let names = ["y(m".to_owned(), "both ' and \"".to_owned(), "x".repeat(201)];
        assert_eq!([own_name(&names, 1), own_name(&names, 2)], [None, None]);
        let named = parse("x_m=#1/mm, y_m=#2/mm").unwrap().with_names(&names).to_string();
        assert_eq!(named, "x_m='y(m'/mm, y_m=#2/mm");
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, place, reason) in [
            ("x=ball", "`x`", "is not a quantity; there are t_s, cmd_qx_rad"),
            ("t_s", "`t_s`", "must be QUANTITY=EXPRESSION"),
            ("t_s=", "`t_s`", "lacks a column"),
            ("t_s=5", "`t_s`", "is mapped to no column"),
            ("t_s=a,t_s=b", "`t_s`", "is mapped twice"),
            ("x_m=a/furlong", "`furlong`", "units here are m, cm, mm, um, in"),
            ("x_m=a/ms", "`ms`", "units here are m"),
            ("x_m=a*0", "`a`", "factor that is zero"),
            ("x_m=a/0", "`a`", "factor that is zero or not finite"),
            ("x_m=a*b", "`b`", "`*` is followed by a number"),
            ("x_m='a", "`'a`", "never closed"),
            ("x_m=a b", "`b`", "is left over"),
            ("x_m=#0", "`#0`", "from #1"),
            ("x_m=sin(a)", "`sin(a)`", "without functions"),
            ("x_m=__import__('os').system('x')", "`__import__(`", "without functions"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(place) && error.contains(reason), "{text}: {error}");
        }
        assert!(parse(&"x".repeat(5000)).unwrap_err().contains("at most 4096"));
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in "[ -~µ°]{0,60}") {
            let _ = parse(&text);
        }

        #[test]
        fn a_written_mapping_is_read_back(
            terms in proptest::collection::vec(("[a-z][a-z 0-9_.-]{0,8}", -1e3..1e3f64), 1..4),
            offset in proptest::option::of(-10.0..10.0f64),
        ) {
            let mut terms: Vec<Term> = terms
                .into_iter()
                .map(|(name, factor)| Term { column: Some(ColumnName::Name(name)), factor })
                .filter(|term| term.factor != 0.0)
                .collect();
            prop_assume!(!terms.is_empty());
            terms.extend(offset.filter(|o| *o != 0.0).map(|factor| Term { column: None, factor }));
            let mut mapping = ColumnMapping::default();
            mapping.expressions[3] = Some(Expression { terms });
            prop_assert_eq!(parse(&mapping.to_string()).unwrap(), mapping);
        }
    }
}
