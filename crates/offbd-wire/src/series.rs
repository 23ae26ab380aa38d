//! Series of the results of a rig's sessions, for charts: flat rows, each with a time.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::words::SeriesAggregate;

/// The results of a rig's ended sessions over time.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct SeriesView {
    pub asset: String,
    /// Length of a step, s; null if each row is one session.
    pub step_s: Option<u32>,
    /// How the sessions of a step become one value.
    pub aggregate: SeriesAggregate,
    /// Oldest first; a step without a session has no row.
    pub rows: Vec<SeriesRowView>,
}

/// The results of one session, or of the sessions that were opened within one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SeriesRowView {
    /// Time at which the session was opened, or at which the step begins, RFC 3339.
    pub time: String,
    /// Number of sessions.
    pub sessions: u64,
    /// Number of sessions in which a fault was confirmed.
    pub faulty: u64,
    /// Number of recorded samples.
    pub samples: u64,
    #[serde(flatten)]
    pub values: SeriesValuesView,
}

/// Defines the values of a row, whose names are those of the columns.
macro_rules! series_values {
    ($($(#[$doc:meta])* $name:ident),+ $(,)?) => {
        /// The values of a row; each is null if no session has it.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
        pub struct SeriesValuesView { $($(#[$doc])* pub $name: Option<f64>),+ }

        impl SeriesValuesView {
            /// Names of the values, in their order.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),+];

            /// Returns the values in their order.
            #[must_use]
            pub fn values(&self) -> Vec<Option<f64>> {
                vec![$(self.$name),+]
            }

            /// Returns the values that `aggregate` makes of those of several sessions, oldest
            /// first.
            #[must_use]
            pub fn of(sessions: &[Self], aggregate: SeriesAggregate) -> Self {
                Self { $($name: one_of(sessions.iter().filter_map(|s| s.$name), aggregate)),+ }
            }
        }
    };
}

series_values! {
    /// Gain of the x servo relative to the calibration: 1 means unchanged.
    gain_x,
    /// Gain of the y servo relative to the calibration: 1 means unchanged.
    gain_y,
    /// Acceleration along x that the command does not explain, m/s².
    offset_x_m_s2,
    /// Acceleration along y that the command does not explain, m/s².
    offset_y_m_s2,
    /// Delay of the x servo in addition to the twin's, s.
    delay_x_s,
    /// Delay of the y servo in addition to the twin's, s.
    delay_y_s,
    /// Root mean square along x of the acceleration that the twin does not predict, m/s².
    residual_x_m_s2,
    /// Root mean square along y of the acceleration that the twin does not predict, m/s².
    residual_y_m_s2,
    /// Share of the session in which the x servo could be judged, 0 to 1.
    judged_x_servo,
    /// Share of the session in which the y servo could be judged, 0 to 1.
    judged_y_servo,
    /// Share of the session in which it could be judged whether the ball is stuck, 0 to 1.
    judged_stuck_ball,
    /// Share of the session in which the sensor could be judged, 0 to 1.
    judged_sensor,
}

fn one_of(values: impl Iterator<Item = f64>, aggregate: SeriesAggregate) -> Option<f64> {
    match aggregate {
        SeriesAggregate::Min => values.reduce(f64::min),
        SeriesAggregate::Max => values.reduce(f64::max),
        SeriesAggregate::Last => values.last(),
        SeriesAggregate::Mean => {
            let (n, sum) = values.fold((0_u32, 0.0), |(n, sum), value| (n + 1, sum + value));
            (n > 0).then(|| sum / f64::from(n))
        }
    }
}

/// Writes the rows as CSV, with a header; a missing value is empty.
///
/// # Errors
/// Those of `out`.
pub fn write_csv(out: &mut impl Write, series: &SeriesView) -> io::Result<()> {
    writeln!(out, "time,sessions,faulty,samples,{}", SeriesValuesView::NAMES.join(","))?;
    for row in &series.rows {
        write!(out, "{},{},{},{}", row.time, row.sessions, row.faulty, row.samples)?;
        for value in row.values.values() {
            match value {
                Some(value) => write!(out, ",{value}")?,
                None => write!(out, ",")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A fault transition as a mark on a chart, in the form that Grafana reads.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct AnnotationView {
    /// Time at which the service learnt of the transition, ms since 1970.
    pub time: i64,
    /// Asset, code and status, such as `bench-1: X servo confirmed`.
    pub title: String,
    /// The transition in one sentence.
    pub text: String,
    /// Asset, code and status, separated by commas.
    pub tags: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_of_a_step_become_one_value() {
        let session = |gain_x| SeriesValuesView { gain_x, ..SeriesValuesView::default() };
        let sessions = [session(Some(3.0)), session(None), session(Some(1.0))];
        for (aggregate, expected) in [
            (SeriesAggregate::Mean, 2.0),
            (SeriesAggregate::Min, 1.0),
            (SeriesAggregate::Max, 3.0),
            (SeriesAggregate::Last, 1.0),
        ] {
            let values = SeriesValuesView::of(&sessions, aggregate);
            assert_eq!((values.gain_x, values.gain_y), (Some(expected), None), "{aggregate}");
        }
        assert_eq!(SeriesValuesView::of(&[], SeriesAggregate::Mean), SeriesValuesView::default());
    }
}
