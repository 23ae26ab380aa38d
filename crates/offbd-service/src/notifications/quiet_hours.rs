//! Hours of each day in which a rule sends nothing.

use jiff::Timestamp;
use jiff::civil::Time;
use jiff::tz::TimeZone;

use offbd_core::vocabulary::Invalid;
use offbd_store::Micros;
use offbd_wire::notification::QuietHoursView;

/// Quiet hours in a time zone; their end is not one of them.
#[derive(Clone, Debug)]
pub(super) struct QuietHours {
    from: Time,
    to: Time,
    zone: TimeZone,
}

impl QuietHours {
    /// Reads quiet hours.
    ///
    /// # Errors
    /// [`Invalid`] with the invalid element.
    pub(super) fn new(view: &QuietHoursView) -> Result<Self, Invalid> {
        let time = |pointer, text: &str| {
            let invalid = |_| Invalid::new(pointer, "is not a time of day like 22:00");
            Time::strptime("%H:%M", text).map_err(invalid)
        };
        let from = time("/quiet_hours/from", &view.from)?;
        let to = time("/quiet_hours/to", &view.to)?;
        if from == to {
            return Err(Invalid::new("/quiet_hours/to", "is also the beginning"));
        }
        let unknown = |_| {
            Invalid::new("/quiet_hours/time_zone", "is not a time zone like Europe/Berlin or UTC")
        };
        Ok(Self { from, to, zone: TimeZone::get(&view.time_zone).map_err(unknown)? })
    }

    /// Returns the end of the quiet hours that `now` is within, if it is.
    pub(super) fn end(&self, now: Micros) -> Option<Micros> {
        let now = Timestamp::from_microsecond(now).ok()?.to_zoned(self.zone.clone());
        let (date, time) = (now.date(), now.time());
        let date = match self.from < self.to {
            true if time < self.from || time >= self.to => return None,
            true => date,
            false if time >= self.from => date.tomorrow().ok()?,
            false if time < self.to => date,
            false => return None,
        };
        let end = date.to_datetime(self.to).to_zoned(self.zone.clone()).ok()?;
        Some(end.timestamp().as_microsecond())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(from: &str, to: &str, time_zone: &str) -> QuietHoursView {
        QuietHoursView { from: from.into(), to: to.into(), time_zone: time_zone.into() }
    }

    /// The end of the quiet hours at a time, both in RFC 3339.
    fn end(hours: &QuietHoursView, at: &str) -> Option<String> {
        let at: Timestamp = at.parse().unwrap();
        let end = QuietHours::new(hours).unwrap().end(at.as_microsecond());
        end.map(|end| Timestamp::from_microsecond(end).unwrap().to_string())
    }

    #[test]
    fn quiet_hours_end_on_the_day_on_which_they_end() {
        let (night, noon) = (view("22:00", "06:30", "UTC"), view("12:00", "13:00", "UTC"));
        let ends = |hours: &QuietHoursView, at: &str, wanted: Option<&str>| {
            assert_eq!(end(hours, at).as_deref(), wanted, "{at}");
        };
        ends(&night, "2026-03-01T21:59:59Z", None);
        ends(&night, "2026-03-01T22:00:00Z", Some("2026-03-02T06:30:00Z"));
        ends(&night, "2026-03-02T06:29:59Z", Some("2026-03-02T06:30:00Z"));
        ends(&night, "2026-03-02T06:30:00Z", None);
        ends(&noon, "2026-03-02T11:59:59Z", None);
        ends(&noon, "2026-03-02T12:00:00Z", Some("2026-03-02T13:00:00Z"));
        ends(&noon, "2026-03-02T13:00:00Z", None);
    }

    /// In Berlin, clocks were put forward on 2026-03-29 at 01:00 UTC.
    #[test]
    fn quiet_hours_follow_the_clocks_of_their_zone() {
        let night = view("22:00", "06:00", "Europe/Berlin");
        let ends = |at: &str| end(&night, at);
        assert_eq!(ends("2026-03-28T20:59:59Z"), None);
        assert_eq!(ends("2026-03-28T21:00:00Z").as_deref(), Some("2026-03-29T04:00:00Z"));
        assert_eq!(ends("2026-03-29T20:00:00Z").as_deref(), Some("2026-03-30T04:00:00Z"));
        // The end falls into the hour that is left out: the clock shows an hour more then.
        let early = view("22:00", "02:30", "Europe/Berlin");
        assert_eq!(end(&early, "2026-03-29T00:30:00Z").as_deref(), Some("2026-03-29T01:30:00Z"));
    }

    #[test]
    fn invalid_hours_name_their_element() {
        let pointer = |view: QuietHoursView| QuietHours::new(&view).unwrap_err().element;
        assert_eq!(pointer(view("24:00", "06:00", "UTC")), "/quiet_hours/from");
        assert_eq!(pointer(view("22:00", "6", "UTC")), "/quiet_hours/to");
        assert_eq!(pointer(view("22:00", "22:00", "UTC")), "/quiet_hours/to");
        assert_eq!(pointer(view("22:00", "06:00", "Berlin")), "/quiet_hours/time_zone");
    }
}
