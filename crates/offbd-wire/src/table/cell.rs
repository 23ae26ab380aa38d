//! The values of cells: numbers, missing numbers, dates and times of day.

use jiff::civil::{Date, Time};

/// Words for a missing number, as programs write them: C libraries have several for one that is not
/// defined, with the sign that the division gave it.
const MISSING: [&str; 22] = [
    "nan",
    "-nan",
    "+nan",
    "na",
    "n/a",
    "#n/a",
    "#nv",
    "<na>",
    "nat",
    "none",
    "null",
    "nil",
    "missing",
    "-",
    "--",
    "?",
    "nan(ind)",
    "-nan(ind)",
    "1.#ind",
    "-1.#ind",
    "1.#qnan",
    "-1.#qnan",
];

/// What separates the fraction of a number from the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DecimalSign {
    Point,
    Comma,
    /// Each number may have the one or the other.
    Either,
}

impl DecimalSign {
    /// Parses a number; the comma of `1,000` is not a decimal sign unless all are.
    fn parse(self, text: &str) -> Option<f64> {
        if self == Self::Point || !text.contains(',') {
            let has_other = self == Self::Comma && text.contains('.');
            return if has_other { None } else { text.parse().ok() };
        }
        if self == Self::Either && is_grouped(text, ',') {
            return None;
        }
        text.replacen(',', ".", 1).parse().ok().filter(|_| !text.contains('.'))
    }
}

/// Whether a text is a number with `sign` between thousands, such as `12,345` or `1,000.5`.
pub(super) fn is_grouped(text: &str, sign: char) -> bool {
    let text = text.strip_prefix(['+', '-']).unwrap_or(text);
    let other = if sign == ',' { '.' } else { ',' };
    let (whole, fraction) = text.split_once(other).unwrap_or((text, ""));
    let mut groups = whole.split(sign);
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().unwrap_or_default();
    let starts = (1..=3).contains(&first.len()) && !first.starts_with('0') && is_digits(first);
    let mut others = groups.peekable();
    starts
        && is_digits(fraction)
        && others.peek().is_some()
        && others.all(|group| group.len() == 3 && is_digits(group))
}

/// Characters around a value that are not a part of it.
fn is_margin(byte: u8) -> bool {
    byte == 0 || byte.is_ascii_whitespace()
}

/// Returns a cell without the blanks and zeros around it.
pub(super) fn bare(mut cell: &[u8]) -> &[u8] {
    while let [first, rest @ ..] = cell
        && is_margin(*first)
    {
        cell = rest;
    }
    while let [rest @ .., last] = cell
        && is_margin(*last)
    {
        cell = rest;
    }
    cell
}

/// Whether a bare cell is a missing number.
pub(super) fn is_missing(text: &str) -> bool {
    text.is_empty() || text.len() <= 9 && MISSING.iter().any(|word| text.eq_ignore_ascii_case(word))
}

/// Returns the finite number in a cell with a decimal point.
pub(super) fn number(text: &str) -> Option<f64> {
    let starts = |c: char| c.is_ascii_digit() || "+-.".contains(c);
    text.parse().ok().filter(|value: &f64| value.is_finite() && text.starts_with(starts))
}

/// Whether a cell is a number or a missing one, so that it is not a name.
pub(super) fn is_value(cell: &str, sign: DecimalSign) -> bool {
    is_missing(cell)
        || cell.starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c))
            && sign.parse(cell).is_some_and(f64::is_finite)
}

/// Splits a cell such as `x:0.1` or `x = 0.1` into the name of its column and its value.
pub(super) fn labelled(cell: &str) -> Option<(&str, &str)> {
    let (label, value) = cell.split_once([':', '='])?;
    let (label, value) = (label.trim(), value.trim_start());
    let is_name = label.starts_with(char::is_alphabetic);
    (is_name && is_value(value.trim_end(), DecimalSign::Either)).then_some((label, value))
}

/// Parses a number; `None` if it is missing.
///
/// # Errors
/// The reason, which quotes the cell.
pub(super) fn parse(cell: &[u8], sign: DecimalSign) -> Result<Option<f64>, String> {
    let text = std::str::from_utf8(bare(cell)).map_err(|_| "not UTF-8".to_owned())?;
    // The usual case first: a finite number.
    match sign.parse(text) {
        Some(value) if value.is_finite() => Ok(Some(value)),
        _ if is_missing(text) => Ok(None),
        Some(_) => Err(format!("`{text}` is not finite")),
        // Typesetters have their own minus.
        None if text.starts_with('\u{2212}') => {
            parse(text.replacen('\u{2212}', "-", 1).as_bytes(), sign)
        }
        None => Err(not_a_number(text)),
    }
}

fn not_a_number(text: &str) -> String {
    if is_grouped(text, ',') || is_grouped(text, '.') {
        let plain: String = text.chars().filter(|c| !".,".contains(*c)).collect();
        return format!(
            "`{text}` may have a thousands separator: write {plain}, or more or fewer decimals"
        );
    }
    if is_ambiguous_date(text) {
        return format!(
            "`{text}` is a date whose day and month cannot be told apart; write 2026-02-20"
        );
    }
    format!("`{text}` is not a number")
}

/// Whether a text begins with a date such as `02/03/2026`.
fn is_ambiguous_date(text: &str) -> bool {
    let date = text.split([' ', 'T']).next().unwrap_or_default();
    let parts: Vec<&str> = date.split(['/', '-']).collect();
    let is_number = |part: &&str, longest: usize| {
        (1..=longest).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit())
    };
    matches!(&parts[..], [a, b, year] if is_number(a, 2) && is_number(b, 2) && is_number(year, 4))
}

/// Whether a cell is a date, a time of day, both, or a duration.
pub(super) fn is_moment(cell: &str) -> bool {
    moment(cell).is_some()
}

/// Whether a cell is a date without a time of day.
pub(super) fn is_day(cell: &str) -> bool {
    !cell.contains(':') && is_moment(cell) && number(cell).is_none() && !is_duration(cell)
}

/// Whether a cell is a duration.
pub(super) fn is_duration(cell: &str) -> bool {
    duration(cell.trim()).is_some()
}

/// How a time of day is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ClockStyle {
    /// Hours and minutes.
    WithoutSeconds,
    /// Minutes and seconds with a fraction.
    WithoutHours,
    Full,
}

/// Returns how a cell writes the time of day.
pub(super) fn clock_style(cell: &str) -> ClockStyle {
    match cell.split_once(':') {
        Some((_, rest)) if rest.contains(':') => ClockStyle::Full,
        Some((_, rest)) if rest.contains(['.', ',']) => ClockStyle::WithoutHours,
        Some(_) => ClockStyle::WithoutSeconds,
        None => ClockStyle::Full,
    }
}

/// Whether a cell is a time of day without a date.
pub(super) fn is_time_of_day(cell: &str) -> bool {
    time_of_day(cell.trim()).is_some()
}

/// Returns the seconds since 1970 of a date, with a time of day or without; of a time of day alone
/// the seconds since midnight; of a duration the seconds.
pub(super) fn moment(text: &str) -> Option<f64> {
    let text = text.trim();
    if let Some(seconds) = time_of_day(text).or_else(|| duration(text)) {
        return Some(seconds);
    }
    // A month may be `Oct`.
    let separates = |(at, c): (usize, char)| {
        c == ' ' || matches!(c, 'T' | 't') && text[..at].ends_with(|c: char| c.is_ascii_digit())
    };
    let (date, rest) = match text.char_indices().find(|at| separates(*at)) {
        Some((at, _)) => (&text[..at], text[at + 1..].trim()),
        None => (text, ""),
    };
    let days = days(date)?;
    let (clock, offset_s) = offset(rest)?;
    let has_hours = clock_style(clock) != ClockStyle::WithoutHours;
    let of_day = if clock.is_empty() { 0.0 } else { time_of_day(clock).filter(|_| has_hours)? };
    Some(days * 86_400.0 + of_day - offset_s)
}

/// Returns the seconds of `0.25 sec` or `1.5 min`, as MATLAB writes a duration, or of `0 days 00:00:00.25`,
/// as pandas does.
fn duration(text: &str) -> Option<f64> {
    let (value, unit) = text.split_once(' ')?;
    let value = number(&value.replacen(',', ".", 1))?;
    match unit {
        "ms" => Some(value / 1e3),
        "s" | "sec" => Some(value),
        "min" => Some(60.0 * value),
        "hr" => Some(3600.0 * value),
        _ => Some(86_400.0 * value + time_of_day(unit.strip_prefix("days ")?)?),
    }
}

/// The months as MATLAB and others write them.
const MONTHS: [&str; 12] =
    ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];

/// Days since 1970 of a date: year, month and day with `-`, `/` or `.` or nothing between them; day,
/// month and year with `.`, or with the month as a word; or day and month in either order with `/`,
/// where one of them is too large for a month.
fn days(text: &str) -> Option<f64> {
    let parts: Vec<&str> = text.split(['-', '/', '.']).collect();
    let number;
    let (year, month, day) = match parts[..] {
        [year, month, day] if year.len() == 4 => (year, month, day),
        [day, month, year] if year.len() == 4 && text.contains('.') => (year, month, day),
        [day, word, year] if year.len() == 4 && word.len() == 3 => {
            let at = MONTHS.iter().position(|month| word.eq_ignore_ascii_case(month))?;
            number = (at + 1).to_string();
            (year, number.as_str(), day)
        }
        [one, other, year] if year.len() == 4 && text.contains('/') => {
            let is_day = |text: &str| text.parse().is_ok_and(|n: u8| n > 12);
            match (is_day(one), is_day(other)) {
                (true, false) => (year, other, one),
                (false, true) => (year, one, other),
                _ => return None,
            }
        }
        [whole] if whole.len() == 8 && whole.is_ascii() && whole.starts_with(['1', '2']) => {
            (&whole[..4], &whole[4..6], &whole[6..])
        }
        _ => return None,
    };
    let date = Date::new(year.parse().ok()?, month.parse().ok()?, day.parse().ok()?).ok()?;
    let since = date.since(Date::constant(1970, 1, 1)).ok()?;
    Some(f64::from(since.get_days()))
}

/// Splits a time of day from its offset to universal time, s.
fn offset(text: &str) -> Option<(&str, f64)> {
    let universal = text.strip_suffix(['Z', 'z']).or_else(|| text.strip_suffix("UTC"));
    if let Some(clock) = universal {
        return Some((clock.trim(), 0.0));
    }
    let Some(at) = text.rfind(['+', '-']) else { return Some((text, 0.0)) };
    let (clock, offset) = (&text[..at], &text[at + 1..]);
    let (hours, minutes) = match offset.split_once(':') {
        Some(parts) => parts,
        None if offset.len() == 4 && offset.is_ascii() => offset.split_at(2),
        None => (offset, "0"),
    };
    let seconds = 3600.0 * hours.parse::<f64>().ok()? + 60.0 * minutes.parse::<f64>().ok()?;
    Some((clock.trim(), if text.as_bytes()[at] == b'-' { -seconds } else { seconds }))
}

/// Seconds since midnight of `13:51`, `13:51:00`, `13:51:00.25` or `1:51:00.25 PM`, also with a decimal
/// comma; of `51:00.2`, as spreadsheets write a time of day, since the hour.
fn time_of_day(text: &str) -> Option<f64> {
    let half = text.len().checked_sub(2).filter(|at| text.is_char_boundary(*at));
    let noon_h = match half.map(|at| text[at..].to_ascii_lowercase()).as_deref() {
        Some("am") => Some(0.0),
        Some("pm") => Some(12.0),
        _ => None,
    };
    if let (Some(noon_h), Some(at)) = (noon_h, half) {
        let seconds = time_of_day(text[..at].trim_end())?;
        // 12:30 AM is half past midnight.
        return (3600.0..46_800.0)
            .contains(&seconds)
            .then_some(seconds % 43_200.0 + 3600.0 * noon_h);
    }
    let (hours, rest) = text.split_once(':')?;
    let (hours, minutes, seconds) = match rest.split_once(':') {
        Some((minutes, seconds)) => (hours, minutes, seconds),
        None if rest.contains(['.', ',']) => ("0", hours, rest),
        None => (hours, rest, "0"),
    };
    let (whole, fraction) = seconds.split_once(['.', ',']).unwrap_or((seconds, ""));
    let time =
        Time::new(hours.parse().ok()?, minutes.parse().ok()?, whole.parse().ok()?, 0).ok()?;
    let digits = fraction.chars().all(|c| c.is_ascii_digit());
    let fraction: f64 =
        if fraction.is_empty() { 0.0 } else { format!("0.{fraction}").parse().ok()? };
    let seconds = 3600.0 * f64::from(time.hour())
        + 60.0 * f64::from(time.minute())
        + f64::from(time.second());
    digits.then_some(seconds + fraction)
}

#[cfg(test)]
mod tests {
    use super::DecimalSign::{Comma, Either, Point};
    use super::*;

    #[test]
    fn missing_numbers_have_many_names() {
        for text in ["", " ", "\0\0", "nan", "NaN", "NA", "None", "null", "-", "N/A"] {
            assert_eq!(parse(text.as_bytes(), Point), Ok(None), "{text:?}");
        }
        assert_eq!(parse(b" -1.5e-3\r", Point), Ok(Some(-1.5e-3)));
        assert_eq!(parse(b"-1,5", Comma), Ok(Some(-1.5)));
        assert_eq!(parse(b"+.5\0", Point), Ok(Some(0.5)));
        for text in ["inf", "-Infinity", "1e999"] {
            assert!(parse(text.as_bytes(), Point).unwrap_err().contains("is not finite"), "{text}");
        }
        for text in ["-nan", "-nan(ind)", "1.#IND", "-1.#IND", "<NA>", "#NV", "missing", "NaT"] {
            assert_eq!(parse(text.as_bytes(), Point), Ok(None), "{text:?}");
        }
        assert_eq!(parse("\u{2212}1.5".as_bytes(), Point), Ok(Some(-1.5)));
        assert_eq!(parse(b"22,5", Either), Ok(Some(22.5)));
        assert_eq!(parse(b"22.5", Either), Ok(Some(22.5)));
        for (text, sign, plain) in
            [("1,000", Point, "1000"), ("1,000", Either, "1000"), ("-12.500", Comma, "-12500")]
        {
            let error = parse(text.as_bytes(), sign).unwrap_err();
            assert!(error.contains("thousands separator") && error.contains(plain), "{error}");
        }
        assert!(parse(b"22.5", Comma).is_err());
        for text in ["1,5", "abc", "0x10", "1 2", "nanny"] {
            assert!(parse(text.as_bytes(), Point).unwrap_err().contains("not a number"), "{text}");
        }
        assert_eq!(parse(b"\xff", Point), Err("not UTF-8".to_owned()));
        let date = parse(b"02/03/2026 13:51:00", Point).unwrap_err();
        assert!(date.contains("day and month cannot be told apart"), "{date}");
    }

    /// Seconds since 1970 by `date --utc --date=… +%s`.
    #[test]
    fn dates_and_times_are_seconds() {
        for (text, seconds) in [
            ("1970-01-01", 0.0),
            ("2026-02-20T13:51:00Z", 1_771_595_460.0),
            ("2026-02-20 13:51:00.25", 1_771_595_460.25),
            ("2026-02-20T14:51:00+01:00", 1_771_595_460.0),
            ("2026-02-20 08:21:00,5 -0530", 1_771_595_460.5),
            ("20.02.2026 13:51", 1_771_595_460.0),
            ("2026/02/20 13:51:00", 1_771_595_460.0),
            ("20260220 13:51:00", 1_771_595_460.0),
            ("13:51:00.5", 49_860.5),
            ("20-Feb-2026 13:51:00", 1_771_595_460.0),
            ("02/20/2026 1:51:00.5 PM", 1_771_595_460.5),
            ("20/02/2026 13:51", 1_771_595_460.0),
            ("2026-02-20 13:51:00 UTC", 1_771_595_460.0),
            ("31-Oct-2026", 1_793_404_800.0),
            ("12:30 am", 1_800.0),
            ("12:30:00 PM", 45_000.0),
            ("51:00.2", 3_060.2),
            ("0 days 00:00:00.250000", 0.25),
            ("1 days 00:00:01", 86_401.0),
            ("0.25 sec", 0.25),
            ("1,5 min", 90.0),
        ] {
            assert_eq!(moment(text), Some(seconds), "{text}");
        }
        // Day and month cannot be told apart; the others are not dates.
        for text in [
            "02/03/2026",
            "2026-13-01",
            "25:00",
            "13",
            "1771595460",
            "12:61",
            "61:00.0",
            "1 days",
            "3 mm",
            "2026-02-20 13:51.5",
            "1 2",
            "",
            "-1",
            "13:00 PM",
            "20-Foo-2026",
            "am",
            "µm",
        ] {
            assert_eq!(moment(text), None, "{text}");
        }
    }
}
