//! The values of cells: numbers, missing numbers, dates and times of day.

use jiff::civil::{Date, Time};

/// Words for a missing number, as programs write them.
const MISSING: [&str; 10] = ["nan", "na", "n/a", "#n/a", "none", "null", "nil", "-", "--", "?"];

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
    text.is_empty() || text.len() <= 4 && MISSING.iter().any(|word| text.eq_ignore_ascii_case(word))
}

/// Returns the finite number in a cell with a decimal point.
pub(super) fn number(text: &str) -> Option<f64> {
    let starts = |c: char| c.is_ascii_digit() || "+-.".contains(c);
    text.parse().ok().filter(|value: &f64| value.is_finite() && text.starts_with(starts))
}

/// Whether a cell is a number or a missing one, so that it is not a name.
pub(super) fn is_value(cell: &str, has_decimal_commas: bool) -> bool {
    is_missing(cell)
        || if has_decimal_commas { number(&cell.replacen(',', ".", 1)) } else { number(cell) }
            .is_some()
}

/// Splits a cell such as `x:0.1` or `x = 0.1` into the name of its column and its value.
pub(super) fn labelled(cell: &str) -> Option<(&str, &str)> {
    let (label, value) = cell.split_once([':', '='])?;
    let (label, value) = (label.trim(), value.trim_start());
    let is_number = |has_commas| is_value(value.trim_end(), has_commas);
    let is_name = label.starts_with(char::is_alphabetic);
    (is_name && (is_number(false) || is_number(true))).then_some((label, value))
}

/// Parses a number; `None` if it is missing.
///
/// # Errors
/// The reason, which quotes the cell.
pub(super) fn parse(cell: &[u8], has_decimal_commas: bool) -> Result<Option<f64>, String> {
    let text = std::str::from_utf8(bare(cell)).map_err(|_| "not UTF-8".to_owned())?;
    // The usual case first: a finite number.
    let parsed = if has_decimal_commas { text.replacen(',', ".", 1).parse() } else { text.parse() };
    match parsed {
        Ok(value) if f64::is_finite(value) => Ok(Some(value)),
        _ if is_missing(text) => Ok(None),
        Ok(_) => Err(format!("`{text}` is not finite")),
        Err(_) if is_ambiguous_date(text) => Err(format!(
            "`{text}` is a date whose day and month cannot be told apart; write 2026-02-20"
        )),
        Err(_) => Err(format!("`{text}` is not a number")),
    }
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

/// Whether a cell is a date, a time of day, or both.
pub(super) fn is_moment(cell: &str) -> bool {
    moment(cell).is_some()
}

/// Returns the seconds since 1970 of a date, with a time of day or without; of a time of day alone
/// the seconds since midnight.
pub(super) fn moment(text: &str) -> Option<f64> {
    let text = text.trim();
    if let Some(seconds) = time_of_day(text) {
        return Some(seconds);
    }
    let (date, rest) = match text.find(['T', 't', ' ']) {
        Some(at) => (&text[..at], text[at + 1..].trim()),
        None => (text, ""),
    };
    let days = days(date)?;
    let (clock, offset_s) = offset(rest)?;
    let of_day = if clock.is_empty() { 0.0 } else { time_of_day(clock)? };
    Some(days * 86_400.0 + of_day - offset_s)
}

/// Days since 1970 of a date: year, month and day with `-`, `/` or `.` or nothing between them, or
/// day, month and year with `.`.
fn days(text: &str) -> Option<f64> {
    let parts: Vec<&str> = text.split(['-', '/', '.']).collect();
    let (year, month, day) = match parts[..] {
        [year, month, day] if year.len() == 4 => (year, month, day),
        [day, month, year] if year.len() == 4 && text.contains('.') => (year, month, day),
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
    if let Some(clock) = text.strip_suffix(['Z', 'z']) {
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

/// Seconds since midnight of `13:51`, `13:51:00` or `13:51:00.25`, also with a decimal comma.
fn time_of_day(text: &str) -> Option<f64> {
    let (hours, rest) = text.split_once(':')?;
    let (minutes, seconds) = rest.split_once(':').unwrap_or((rest, "0"));
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
    use super::*;

    #[test]
    fn missing_numbers_have_many_names() {
        for text in ["", " ", "\0\0", "nan", "NaN", "NA", "None", "null", "-", "N/A"] {
            assert_eq!(parse(text.as_bytes(), false), Ok(None), "{text:?}");
        }
        assert_eq!(parse(b" -1.5e-3\r", false), Ok(Some(-1.5e-3)));
        assert_eq!(parse(b"-1,5", true), Ok(Some(-1.5)));
        assert_eq!(parse(b"+.5\0", false), Ok(Some(0.5)));
        for text in ["inf", "-Infinity", "1e999"] {
            assert!(parse(text.as_bytes(), false).unwrap_err().contains("is not finite"), "{text}");
        }
        for text in ["1,5", "abc", "0x10", "1 2", "nanny"] {
            assert!(parse(text.as_bytes(), false).unwrap_err().contains("not a number"), "{text}");
        }
        assert_eq!(parse(b"\xff", false), Err("not UTF-8".to_owned()));
        let date = parse(b"02/03/2026 13:51:00", false).unwrap_err();
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
        ] {
            assert_eq!(moment(text), Some(seconds), "{text}");
        }
        // Day and month cannot be told apart; the others are not dates.
        for text in ["02/03/2026", "2026-13-01", "25:00", "13", "1771595460", "12:61", "", "-1"] {
            assert_eq!(moment(text), None, "{text}");
        }
    }
}
