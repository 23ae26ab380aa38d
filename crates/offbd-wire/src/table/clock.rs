//! The time of a recording's rows: dates become seconds, a counter that wraps goes on, and a
//! clock that starts again begins another run.

use super::cell;
use super::columns::TimeSource;
use super::rows::Cells;

/// Values at which counters of microcontrollers wrap: 16 and 32 bits.
const WRAPS: [f64; 2] = [65_536.0, 4_294_967_296.0];

/// A counter wraps if it goes on by at most this many of its last steps. Chosen: a second of lost
/// rows at 100 Hz is not a new run.
const MOST_STEPS: f64 = 100.0;

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
    /// The last value as it was written, and the last step upward.
    last: Option<f64>,
    step: f64,
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
        Self { is_recording, last: None, step: 0.0, added: 0.0, n_rows: 0, run: None, n_runs: 0 }
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
        has_decimal_commas: bool,
    ) -> Result<f64, String> {
        self.n_rows += 1;
        let t_s = match source {
            TimeSource::Rows(period_s) => (self.n_rows - 1) as f64 * period_s,
            TimeSource::Columns(columns) => {
                let value = columns.value(cells, has_decimal_commas)?;
                self.unwrapped(value.ok_or_else(|| "`t_s` is empty".to_owned())?, columns.factor())
            }
            TimeSource::Moments(columns) => moments(cells, columns)?,
        };
        Ok(t_s)
    }

    /// Adds what a counter of `factor` seconds has lost by wrapping.
    fn unwrapped(&mut self, value: f64, factor: Option<f64>) -> f64 {
        let Some(factor) = factor.filter(|_| self.is_recording) else { return value };
        let counter = value / factor;
        if let Some(last) = self.last
            && counter < last
        {
            let goes_on =
                |wrap: &&f64| last < **wrap && counter + **wrap - last <= MOST_STEPS * self.step;
            if let Some(wrap) = WRAPS.iter().find(goes_on) {
                self.added += wrap * factor;
            }
        } else if let Some(last) = self.last {
            self.step = counter - last;
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
}

fn moments(cells: &Cells, columns: &[usize]) -> Result<f64, String> {
    let mut sum = 0.0;
    for column in columns {
        let bytes = cells.get(*column).ok_or_else(|| "no field `t_s`".to_owned())?;
        let text =
            std::str::from_utf8(cell::bare(bytes)).map_err(|_| "`t_s`: not UTF-8".to_owned())?;
        // A spreadsheet has dates and numbers of seconds in one column.
        let seconds = cell::moment(text).or_else(|| cell::number(text));
        sum += seconds.ok_or_else(|| match text {
            "" => "`t_s` is empty".to_owned(),
            _ => format!("`t_s`: `{text}` is not a date or a time of day"),
        })?;
    }
    Ok(sum)
}
