//! Scales of axes: range, ticks and labels; linear, logarithmic, or names.

/// Maximum number of labels along a logarithmic axis; chosen.
const MOST_LABELS: usize = 7;

/// The type and range of an axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Scale {
    /// Linear, from the first to the second value, both finite.
    Linear(f64, f64),
    /// Logarithmic, from the first to the second value, both positive.
    Log(f64, f64),
    /// Names at 0, 1, 2 and so on.
    Names(Vec<String>),
}

impl Scale {
    /// Returns a logarithmic range around the positive `values`, with a margin on both
    /// sides as a share of its length.
    #[must_use]
    pub fn log_around(values: impl IntoIterator<Item = f64>, margin: f64) -> Self {
        let logs = values.into_iter().filter(|v| v.is_finite() && *v > 0.0).map(f64::log10);
        let (low, high) = around(logs, margin);
        Self::Log(10_f64.powf(low), 10_f64.powf(high))
    }

    /// Returns a linear range around `values`, with a margin likewise.
    #[must_use]
    pub fn linear_around(values: impl IntoIterator<Item = f64>, margin: f64) -> Self {
        let (low, high) = around(values.into_iter().filter(|v| v.is_finite()), margin);
        Self::Linear(low, high)
    }

    /// Returns the first and the last value.
    pub(super) fn ends(&self) -> (f64, f64) {
        match self {
            Self::Linear(low, high) | Self::Log(low, high) => (*low, *high),
            Self::Names(names) => (-0.5, names.len() as f64 - 0.5),
        }
    }

    pub(super) fn contains(&self, value: f64) -> bool {
        let (low, high) = self.ends();
        (low..=high).contains(&value)
    }

    pub(super) fn clamp(&self, value: f64) -> f64 {
        let (low, high) = self.ends();
        value.clamp(low, high)
    }

    /// Returns the number of characters of the longest name; 0 for numeric scales.
    pub(super) fn longest_name(&self) -> usize {
        let Self::Names(names) = self else { return 0 };
        names.iter().map(|name| name.chars().count()).max().unwrap_or_default()
    }

    /// Returns the position of `value` between the ends, 0 to 1.
    pub(super) fn share(&self, value: f64) -> f64 {
        let (low, high) = self.ends();
        match self {
            Self::Log(..) => (value / low).ln() / (high / low).ln(),
            _ => (value - low) / (high - low),
        }
    }

    /// Returns the values with a label.
    pub(super) fn labelled(&self) -> Vec<f64> {
        match *self {
            Self::Linear(low, high) => multiples(low, high, nice_step(high - low)),
            Self::Log(low, high) => labelled_log(low, high),
            Self::Names(ref names) => (0..names.len()).map(|i| i as f64).collect(),
        }
    }

    /// Returns the values with a grid line, including those with a label.
    pub(super) fn ticks(&self) -> Vec<f64> {
        match *self {
            Self::Linear(..) | Self::Names(_) => self.labelled(),
            Self::Log(low, high) if high / low > 1e6 => decades(low, high, &[1.0]),
            Self::Log(low, high) => {
                decades(low, high, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
            }
        }
    }

    pub(super) fn label(&self, value: f64) -> String {
        match *self {
            Self::Log(low, high) if low < 0.9e-4 || high > 1.1e5 => power_of_ten(value),
            Self::Names(ref names) => names.get(value as usize).cloned().unwrap_or_default(),
            _ => plain(value),
        }
    }
}

fn around(values: impl Iterator<Item = f64>, margin: f64) -> (f64, f64) {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let pad = if high > low { margin * (high - low) } else { 0.5 };
    (low - pad, high + pad)
}

/// Returns the labelled values of a logarithmic axis: decades, only some of them if there
/// are many; with multiples of 2 and 5, or more, if there are few.
fn labelled_log(low: f64, high: f64) -> Vec<f64> {
    let whole = decades(low, high, &[1.0]);
    if whole.len() > MOST_LABELS {
        let stride = whole.len().div_ceil(MOST_LABELS) as i32;
        let power = |v: &f64| v.log10().round() as i32;
        return whole.into_iter().filter(|v| power(v) % stride == 0).collect();
    }
    let with_few = decades(low, high, &[1.0, 2.0, 5.0]);
    if high / low < 4.0 {
        return decades(low, high, &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0]);
    }
    if with_few.len() <= MOST_LABELS { with_few } else { whole }
}

/// Returns the `digits` times powers of ten between `low` and `high`.
fn decades(low: f64, high: f64, digits: &[f64]) -> Vec<f64> {
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let all = powers.flat_map(|p| digits.iter().map(move |d| d * 10_f64.powi(p)));
    all.filter(|v| (low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(v)).collect()
}

/// Returns 1, 2 or 5 times a power of ten, of which about five fit into `length`.
fn nice_step(length: f64) -> f64 {
    let raw = length / 5.0;
    let power = 10_f64.powf(raw.log10().floor());
    let digit = [1.0, 2.0, 5.0].into_iter().find(|d| d * power >= raw * 0.75).unwrap_or(10.0);
    digit * power
}

fn multiples(low: f64, high: f64, step: f64) -> Vec<f64> {
    let (first, last) = ((low / step).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// Formats a number without superfluous digits.
fn plain(value: f64) -> String {
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(value);
    format!("{rounded}").replace('-', "−")
}

/// Formats 0.001 as 10⁻³ and 20 000 as 2·10⁴.
fn power_of_ten(value: f64) -> String {
    let text = format!("{value:.0e}");
    let Some((digit, power)) = text.split_once('e') else { return text };
    let raised: String = power.chars().map(superscript).collect();
    if digit == "1" { format!("10{raised}") } else { format!("{digit}·10{raised}") }
}

fn superscript(c: char) -> char {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: &Scale) -> Vec<String> {
        scale.labelled().into_iter().map(|v| scale.label(v)).collect()
    }

    #[test]
    fn labels_are_those_that_a_person_would_write() {
        assert_eq!(labels(&Scale::Log(0.01, 100.0)), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(labels(&Scale::Log(3.0, 60.0)), ["5", "10", "20", "50"]);
        assert_eq!(labels(&Scale::Log(1e-9, 1e-6)), ["10⁻⁹", "10⁻⁸", "10⁻⁷", "10⁻⁶"]);
        assert_eq!(labels(&Scale::Linear(-1.0, 1.0)), ["−1", "−0.5", "0", "0.5", "1"]);
        assert!(labels(&Scale::Log(1e-12, 1e3)).len() <= MOST_LABELS + 1);
        assert_eq!(labels(&Scale::Names(vec!["a".to_owned(), "b".to_owned()])), ["a", "b"]);
    }

    #[test]
    fn a_margin_is_a_share_of_the_range() {
        let Scale::Log(low, high) = Scale::log_around([1.0, 100.0, f64::NAN, -1.0], 0.5) else {
            panic!("not logarithmic")
        };
        assert!((low - 0.1).abs() < 1e-12 && (high - 1000.0).abs() < 1e-9);
    }
}
