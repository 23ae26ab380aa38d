//! Formats numbers and names for people.

use offbd_lab::scene::{Configuration, Event, Pace, Scene, Subject};

/// Formats a duration in a suitable unit, with three digits.
pub(super) fn work(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{} µs", digits(s * 1e6)),
        s if s < 1.0 => format!("{} ms", digits(s * 1e3)),
        s => format!("{} s", digits(s)),
    }
}

fn digits(value: f64) -> String {
    match value {
        v if v < 9.995 => format!("{v:.2}"),
        v if v < 99.95 => format!("{v:.1}"),
        v => format!("{v:.0}"),
    }
}

/// Formats metres in scientific notation, with two digits.
pub(super) fn metres(value: f64) -> String {
    if !value.is_finite() {
        return "no limit".to_owned();
    }
    format!("{value:.1e} m")
}

/// Formats a number as people type it, such as 0.001 or 1e-9, with at most four digits.
pub(super) fn plain(value: f64) -> String {
    let short: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if (1e-3..1e4).contains(&short.abs()) || short == 0.0 {
        format!("{short}")
    } else {
        format!("{short:e}")
    }
}

/// Describes model, method and pace.
pub(super) fn configuration(configuration: &Configuration) -> String {
    let pace = match configuration.pace() {
        Pace::Step(step) => format!("steps of {} s", plain(step)),
        Pace::Tolerance(tolerance) => format!("tolerance {} m", plain(tolerance)),
    };
    format!("{} model by {}, {pace}", configuration.model(), configuration.method())
}

/// Returns the name of the event's phase; a block rests instead of rolling.
pub(super) fn event(event: &Event, scene: &Scene) -> &'static str {
    match (&scene.subject, event.what) {
        (Subject::Block(_), "rolls") => "rests",
        (_, what) => what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_no_more_digits_than_people_read() {
        let plains = [0.001, 1e-9, 1.0 / 231.0, 2e-4, 10.0].map(plain);
        assert_eq!(plains, ["0.001", "1e-9", "0.004329", "2e-4", "10"]);
        assert_eq!([work(6.54e-6), work(0.0123), work(150.0)], ["6.54 µs", "12.3 ms", "150 s"]);
    }
}
