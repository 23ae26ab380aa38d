//! The wall clock. No other module of the service reads it.

use offbd_store::Micros;

/// The wall clock.
#[derive(Clone, Debug)]
pub enum Clock {
    /// That of the system.
    System,
    /// A time that a simulation sets.
    #[cfg(test)]
    Simulated(std::sync::Arc<std::sync::atomic::AtomicI64>),
}

impl Clock {
    /// Returns the current time.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "the only place that reads the clock")]
    pub fn now(&self) -> Micros {
        match self {
            Self::System => jiff::Timestamp::now().as_microsecond(),
            #[cfg(test)]
            Self::Simulated(now) => now.load(std::sync::atomic::Ordering::SeqCst),
        }
    }
}

/// Parses an RFC 3339 timestamp.
///
/// # Errors
/// The reason why it is invalid.
pub fn parse_timestamp(text: &str) -> Result<Micros, String> {
    let parsed: Result<jiff::Timestamp, _> = text.parse();
    parsed
        .map(jiff::Timestamp::as_microsecond)
        .map_err(|error| format!("expected a time such as 2026-02-20T13:51:00Z: {error}"))
}

/// Formats a timestamp as RFC 3339, UTC, with microseconds. All results have the same
/// length and sort in the order of time.
#[must_use]
pub(super) fn rfc3339(at: Micros) -> String {
    jiff::Timestamp::from_microsecond(at)
        .map(|timestamp| format!("{timestamp:.6}"))
        .unwrap_or_default()
}
