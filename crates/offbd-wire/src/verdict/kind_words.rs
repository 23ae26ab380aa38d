//! The kind of a fault in words, as a fact or as probable with its weight, and its status.

use offbd_core::diagnosis::SURE_KIND;
use offbd_core::vocabulary::{FaultCode, FaultStatus};
use std::fmt::Display;

/// Whether a kind with this weight is only probable.
#[must_use]
pub fn is_probable(weight: f64) -> bool {
    weight < SURE_KIND
}

/// Returns a kind as a word for people: `dead`, or `probably dead, 51 %`.
pub fn kind_words(kind: impl Display, weight: f64) -> String {
    match is_probable(weight) {
        true => format!("probably {kind}, {:.0} %", 100.0 * weight),
        false => kind.to_string(),
    }
}

/// Returns a fault with its kind, if it is known: `X servo (probably dead, 51 %)`.
pub fn fault_title(code: impl Display, kind: Option<impl Display>, weight: f64) -> String {
    match kind {
        Some(kind) => format!("{code} ({})", kind_words(kind, weight)),
        None => code.to_string(),
    }
}

/// A possible cause: the part, its kind of fault, and its weight.
type Cause<K> = (FaultCode, Option<K>, f64);

/// Returns possible causes with their weights, as `x_servo (dead) 40 %`, with the codes as `name` has
/// them. Two servos beside another cause are one: both without power.
#[must_use]
pub fn weighed_causes<K: Copy + Display>(
    candidates: &[Cause<K>],
    name: fn(FaultCode) -> &'static str,
) -> Vec<String> {
    let weighed = |title: String, weight: f64| format!("{title} {:.0} %", 100.0 * weight);
    let alone =
        |&&(code, kind, weight): &&Cause<K>| weighed(fault_title(name(code), kind, 1.0), weight);
    let is_servo = |(code, ..): &&Cause<K>| code.axis().is_some();
    let (servos, others): (Vec<&Cause<K>>, Vec<_>) = candidates.iter().partition(is_servo);
    let are_two = servos.iter().any(|(code, ..)| *code != servos[0].0);
    if others.is_empty() || !are_two {
        return candidates.iter().map(|cause| alone(&cause)).collect();
    }
    let both = fault_title("both servos", servos[0].1, 1.0);
    let weight = servos.iter().map(|(.., weight)| weight).sum();
    others.iter().map(alone).chain([weighed(both, weight)]).collect()
}

/// Returns what a code blames, in words for people, as within a sentence.
#[must_use]
pub const fn code_words(code: FaultCode) -> &'static str {
    match code {
        FaultCode::XServo => "x servo",
        FaultCode::YServo => "y servo",
        FaultCode::StuckBall => "stuck ball",
        FaultCode::Sensor => "position sensor",
    }
}

/// Returns what a code blames, as at the beginning of a sentence.
#[must_use]
pub fn code_title(code: FaultCode) -> String {
    let (first, rest) = code_words(code).split_at(1);
    first.to_uppercase() + rest
}

/// Returns a status as a word for people, who know a pending fault as a suspected one.
#[must_use]
pub fn status_words(status: FaultStatus) -> &'static str {
    match status {
        FaultStatus::Pending => "suspected",
        FaultStatus::Confirmed => "confirmed",
        FaultStatus::Healed => "healed",
        FaultStatus::Cleared => "cleared",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_a_fact_from_four_fifths_on() {
        assert_eq!(kind_words("dead", 0.512), "probably dead, 51 %");
        assert_eq!(kind_words("dead", 0.79), "probably dead, 79 %");
        assert_eq!(kind_words("dead", 0.8), "dead");
        assert_eq!(fault_title("x_servo", Some("dead"), 1.0), "x_servo (dead)");
        assert_eq!(fault_title("x_servo", None::<&str>, 0.0), "x_servo");
    }
}
