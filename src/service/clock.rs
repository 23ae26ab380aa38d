//! The wall clock, the only place that reads it.

use crate::store::Micros;

/// Reads the wall clock.
#[derive(Clone, Copy, Debug)]
pub struct Clock;

impl Clock {
    /// Now.
    #[must_use]
    #[expect(clippy::disallowed_methods, reason = "this is the place")]
    pub fn now(self) -> Micros {
        jiff::Timestamp::now().as_microsecond()
    }
}

/// The moment that RFC 3339 text says.
///
/// # Errors
/// Says what is wrong with it.
pub fn moment(text: &str) -> Result<Micros, String> {
    let parsed: Result<jiff::Timestamp, _> = text.parse();
    parsed.map(jiff::Timestamp::as_microsecond).map_err(|error| error.to_string())
}

/// A moment as RFC 3339, UTC, to the microsecond: always of one length, so that
/// text sorts as time does.
#[must_use]
pub(super) fn rfc3339(moment: Micros) -> String {
    jiff::Timestamp::from_microsecond(moment)
        .map(|timestamp| format!("{timestamp:.6}"))
        .unwrap_or_default()
}
