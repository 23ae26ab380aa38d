//! Series of the stored results of a rig's sessions, and marks of its faults, for charts.

use std::collections::BTreeMap;

use crate::clock::rfc3339;
use crate::{Service, ServiceError, views};
use offbd_store::{Micros, SessionFilter, SessionRow, TrendRow};
use offbd_wire::series::{AnnotationView, SeriesRowView, SeriesValuesView, SeriesView};
use offbd_wire::verdict::{FaultView, SummaryView, code_title, status_words};
use offbd_wire::words::{CodeWord, SeriesAggregate, SessionState};

/// Most sessions that one series reads; with more in its range it is refused, and asks for a
/// shorter one. Chosen: their verdicts take some megabytes.
pub const MAX_SERIES_SESSIONS: u32 = 2000;

/// The range of a series, and how its rows are made.
#[derive(Clone, Copy, Debug)]
pub struct SeriesQuery {
    /// Sessions that were opened at this time or later, microseconds since 1970.
    pub from: Option<i64>,
    /// Sessions that were opened before this time, microseconds since 1970.
    pub to: Option<i64>,
    /// Length of a step, s; one row for each session without it.
    pub step_s: Option<u32>,
    pub aggregate: SeriesAggregate,
}

/// The results of one session.
struct SessionResult {
    opened_at: Micros,
    is_faulty: bool,
    n_samples: u64,
    values: SeriesValuesView,
}

impl Service {
    /// Returns the results of the ended sessions of `asset`, from what is stored of them: no
    /// recording is judged again.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::TooMany`] with more sessions than
    /// [`MAX_SERIES_SESSIONS`].
    pub async fn series(
        &self,
        asset: &str,
        query: SeriesQuery,
    ) -> Result<SeriesView, ServiceError> {
        self.check_asset(Some(asset)).await?;
        let store = &self.inner.handles.store;
        let filter = SessionFilter {
            asset: Some(asset.to_owned()),
            state: Some(SessionState::Ended.to_string()),
            opened_from: query.from,
            opened_to: query.to,
            is_ascending: true,
            ..SessionFilter::default()
        };
        let rows = store.sessions(&filter, MAX_SERIES_SESSIONS + 1).await?;
        if rows.len() > MAX_SERIES_SESSIONS as usize {
            let what = "sessions in the range of the series; choose a shorter one";
            return Err(ServiceError::TooMany { what, limit: MAX_SERIES_SESSIONS as usize });
        }
        let mut estimates: BTreeMap<String, Vec<TrendRow>> = BTreeMap::new();
        let (from, to) = (query.from.unwrap_or(i64::MIN), query.to.unwrap_or(i64::MAX));
        for row in store.trend_between(asset, from, to, 2 * MAX_SERIES_SESSIONS).await? {
            estimates.entry(row.session.clone()).or_default().push(row);
        }
        let result = |row: SessionRow| {
            let estimates = estimates.get(&row.id).map(Vec::as_slice).unwrap_or_default();
            session_result(&row, estimates)
        };
        let results: Vec<_> = rows.into_iter().map(result).collect::<Result<_, _>>()?;
        Ok(SeriesView {
            asset: asset.to_owned(),
            step_s: query.step_s,
            aggregate: query.aggregate,
            rows: series_rows(&results, query),
        })
    }

    /// Returns the fault transitions between two times, the latest first, as marks on a chart.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn annotations(
        &self,
        asset: Option<&str>,
        (from, to): (Option<i64>, Option<i64>),
        limit: u32,
    ) -> Result<Vec<AnnotationView>, ServiceError> {
        self.check_asset(asset).await?;
        let range = (from.unwrap_or(i64::MIN), to.unwrap_or(i64::MAX));
        let rows = self.inner.handles.store.transitions_between(asset, range, limit).await?;
        let view = |row: offbd_store::TransitionRow| {
            let fault: FaultView = views::from_json(&row.document)?;
            Ok(AnnotationView {
                time: row.at / 1000,
                title: format!(
                    "{}: {} {}",
                    row.asset,
                    code_title(fault.code.into()),
                    status_words(fault.status.into())
                ),
                text: fault.summary,
                tags: format!("{},{},{}", row.asset, row.code, row.status),
            })
        };
        rows.into_iter().map(view).collect()
    }
}

fn session_result(row: &SessionRow, estimates: &[TrendRow]) -> Result<SessionResult, ServiceError> {
    let mut values = SeriesValuesView::default();
    for estimate in estimates {
        let (gain, offset, delay) = match estimate.axis.as_str() {
            "x" => (&mut values.gain_x, &mut values.offset_x_m_s2, &mut values.delay_x_s),
            _ => (&mut values.gain_y, &mut values.offset_y_m_s2, &mut values.delay_y_s),
        };
        (*gain, *offset, *delay) =
            (Some(estimate.gain), Some(estimate.offset_m_s2), Some(estimate.delay_s));
    }
    let verdict: Option<SummaryView> = row.verdict.as_deref().map(views::from_json).transpose()?;
    if let Some(verdict) = &verdict {
        values.residual_x_m_s2 = verdict.residual_x_m_s2;
        values.residual_y_m_s2 = verdict.residual_y_m_s2;
    }
    for monitor in verdict.iter().flat_map(|verdict| &verdict.monitors) {
        let share = match monitor.code {
            CodeWord::XServo => &mut values.judged_x_servo,
            CodeWord::YServo => &mut values.judged_y_servo,
            CodeWord::StuckBall => &mut values.judged_stuck_ball,
            CodeWord::Sensor => &mut values.judged_sensor,
        };
        *share = Some(monitor.judged_share);
    }
    Ok(SessionResult {
        opened_at: row.opened_at,
        is_faulty: verdict.is_some_and(|verdict| !verdict.faults.is_empty()),
        n_samples: u64::try_from(row.progress.n_samples).unwrap_or_default(),
        values,
    })
}

/// Returns one row for each session or, with a step, for each step that has sessions. The
/// results ascend in time, so that those of a step follow each other.
fn series_rows(results: &[SessionResult], query: SeriesQuery) -> Vec<SeriesRowView> {
    let step = query.step_s.map(|step_s| i64::from(step_s) * 1_000_000);
    let start = |result: &SessionResult| match step {
        Some(step) => result.opened_at.div_euclid(step) * step,
        None => result.opened_at,
    };
    let is_same = |a: &SessionResult, b: &SessionResult| step.is_some() && start(a) == start(b);
    let row = |sessions: &[SessionResult]| {
        let values: Vec<_> = sessions.iter().map(|session| session.values).collect();
        SeriesRowView {
            time: sessions.first().map(|first| rfc3339(start(first))).unwrap_or_default(),
            sessions: sessions.len() as u64,
            faulty: sessions.iter().filter(|session| session.is_faulty).count() as u64,
            samples: sessions.iter().map(|session| session.n_samples).sum(),
            values: SeriesValuesView::of(&values, query.aggregate),
        }
    };
    results.chunk_by(is_same).map(row).collect()
}
