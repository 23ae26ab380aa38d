//! Numbers and names as people read them.

use crate::scene::{Configuration, Event, Pace, Scene, Subject};

/// Seconds of work in a unit of its size, three digits.
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

/// Metres with a power of ten, two digits.
pub(super) fn metres(value: f64) -> String {
    format!("{value:.1e} m")
}

/// As it was typed: 0.001, 1e-9.
pub(super) fn plain(value: f64) -> String {
    if (1e-3..1e4).contains(&value.abs()) || value == 0.0 {
        format!("{value}")
    } else {
        let short = format!("{value:.1e}");
        short.replace(".0e", "e")
    }
}

/// Model, method and pace.
pub(super) fn configuration(configuration: &Configuration) -> String {
    let pace = match configuration.pace() {
        Pace::Step(step) => format!("steps of {} s", plain(step)),
        Pace::Tolerance(tolerance) => format!("tolerance {} m", plain(tolerance)),
    };
    format!("{} model by {}, {pace}", configuration.model(), configuration.method())
}

/// What happens at the event: a block does not roll.
pub(super) fn event(event: &Event, scene: &Scene) -> &'static str {
    match (&scene.subject, event.what) {
        (Subject::Block(_), "rolls") => "rests",
        (_, what) => what,
    }
}
