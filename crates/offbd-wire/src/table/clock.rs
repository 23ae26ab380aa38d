//! The time of a recording's rows: dates and durations become seconds, a counter that wraps goes on, and a
//! clock that starts again begins another run.

use super::cell::{self, ClockStyle, DecimalSign};
use super::columns::TimeSource;
use super::rows::Cells;

/// Values at which counters of microcontrollers wrap, 16 and 32 bits, and the steps by which one may
/// go on then. Chosen: a second of lost rows at 100 Hz is not a new run; a recording that ends by
/// chance within a few steps of 65 536 ms is rarer than one of about a minute.
const WRAPS: [(f64, f64); 2] = [(65_536.0, 3.0), (4_294_967_296.0, 100.0)];

/// Values at which a clock wraps, and the steps by which it may go on then.
type Wraps = &'static [(f64, f64)];

/// At midnight the time of day begins again, s.
const DAYS: [(f64, f64); 1] = [(86_400.0, 100.0)];
/// A time of day without hours begins again at each hour, s.
const HOURS: [(f64, f64); 1] = [(3_600.0, 100.0)];

/// A clock starts again if it falls by more than this, s, to within this of the run's first time.
/// Chosen: rows that a network delays are younger.
const RESTART_S: f64 = 1.0;

/// Whether a clock that has gone from `first_s` to `last_s` starts again at `t_s`, all in s.
#[must_use]
pub fn starts_again(first_s: f64, last_s: f64, t_s: f64) -> bool {
    t_s < last_s - RESTART_S && t_s < first_s + RESTART_S
}

/// The time of one row after the other.
#[derive(Clone, Debug)]
pub(super) struct RowClock {
    /// Whether counters are unwrapped and runs are told apart.
    is_recording: bool,
    /// How the time of day is written, if minutes and seconds are not both there.
    style: Option<ClockStyle>,
    /// The last value as it was written, and the last two steps upward.
    last: Option<f64>,
    steps: [f64; 2],
    /// What wraps have added.
    added: f64,
    n_rows: u64,
    /// First and last time of the run, s.
    run: Option<(f64, f64)>,
    /// Runs that have a valid row.
    n_runs: usize,
}

impl RowClock {
    pub(super) const fn new(is_recording: bool) -> Self {
        Self {
            is_recording,
            style: None,
            last: None,
            steps: [0.0; 2],
            added: 0.0,
            n_rows: 0,
            run: None,
            n_runs: 0,
        }
    }

    /// The number of the run that the rows have come to, from 1.
    pub(super) fn n_runs(&self) -> usize {
        self.n_runs.max(1)
    }

    /// Begins another run with the next valid row.
    pub(super) fn restart(&mut self) {
        *self = Self { n_runs: self.n_runs, ..Self::new(self.is_recording) };
    }

    /// Returns the time of the next row, s.
    ///
    /// # Errors
    /// The reason why the row has none.
    pub(super) fn next(
        &mut self,
        source: &TimeSource,
        cells: &Cells,
        sign: DecimalSign,
    ) -> Result<f64, String> {
        self.n_rows += 1;
        let t_s = match source {
            TimeSource::Rows(period_s) => (self.n_rows - 1) as f64 * period_s,
            TimeSource::Columns(columns) => {
                let value =
                    columns.value(cells, sign)?.ok_or_else(|| "`t_s` is empty".to_owned())?;
                match columns.line() {
                    Some(line) => self.unwrapped(value, line, &WRAPS),
                    None => value,
                }
            }
            TimeSource::Moments(columns) => {
                let (value, wraps) = self.moments(cells, columns)?;
                self.unwrapped(value, (1.0, 0.0), wraps)
            }
        };
        Ok(t_s)
    }

    /// Adds what a counter has lost by wrapping. Its value is in s, and is the count by the factor
    /// and offset of `line`.
    fn unwrapped(&mut self, value: f64, line: (f64, f64), wraps: Wraps) -> f64 {
        if !self.is_recording {
            return value;
        }
        let (factor, offset) = line;
        let counter = (value - offset) / factor;
        if let Some(last) = self.last
            && counter < last
        {
            let step = self.steps[0].min(self.steps[1]);
            let goes_on =
                |(wrap, most): &&(f64, f64)| last < *wrap && counter + wrap - last <= most * step;
            if let Some((wrap, _)) = wraps.iter().find(goes_on) {
                self.added += wrap * factor;
            }
        } else if let Some(step) = self.last.map(|last| counter - last).filter(|step| *step > 0.0) {
            let before = self.steps[1];
            self.steps = [if before > 0.0 { before } else { step }, step];
        }
        self.last = Some(counter);
        if self.added == 0.0 { value } else { value + self.added }
    }

    /// Takes the time of a valid row: it may begin another run.
    pub(super) fn note(&mut self, t_s: f64) {
        if !self.is_recording {
            return;
        }
        let goes_on = |(first, last): &(f64, f64)| !starts_again(*first, *last, t_s);
        match self.run.as_mut().filter(|run| goes_on(run)) {
            Some((_, last)) => *last = last.max(t_s),
            None => {
                self.run = Some((t_s, t_s));
                self.n_runs += 1;
            }
        }
    }

    /// Returns the sum of these columns, s, and where it begins again.
    fn moments(&mut self, cells: &Cells, columns: &[usize]) -> Result<(f64, Wraps), String> {
        let (mut sum, mut wraps) = (0.0, &DAYS[..]);
        for column in columns {
            let bytes = cells.get(*column).ok_or_else(|| "no field `t_s`".to_owned())?;
            let text = std::str::from_utf8(cell::bare(bytes))
                .map_err(|_| "`t_s`: not UTF-8".to_owned())?;
            // A spreadsheet has dates and numbers of seconds in one column.
            let seconds = cell::moment(text).or_else(|| cell::number(text));
            sum += seconds.ok_or_else(|| match text {
                "" => "`t_s` is empty".to_owned(),
                _ => format!("`t_s`: `{text}` is not a date or a time of day"),
            })?;
            let style = cell::clock_style(text);
            if style == ClockStyle::WithoutHours {
                wraps = &HOURS;
            }
            if style != ClockStyle::Full && *self.style.get_or_insert(style) != style {
                return Err(format!(
                    "`t_s`: `{text}` may be hours and minutes or minutes and seconds, both of which \
                     there are; write 00:05:00"
                ));
            }
            if cell::is_duration(text) {
                wraps = &[];
            }
        }
        Ok((sum, wraps))
    }
}
