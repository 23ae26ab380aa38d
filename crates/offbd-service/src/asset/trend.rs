//! The servo estimates of sessions, and the trend over them.

use super::session::OpenSession;
use super::turn::Turn;
use crate::clock::rfc3339;
use crate::{ServiceError, views};
use offbd_core::diagnosis::ServoEstimate;
use offbd_core::diagnosis::trend::MAX_SESSIONS;
use offbd_core::vocabulary::{Axis, PerAxis};
use offbd_store::{Micros, TrendEntry, TrendRow, Write};
use offbd_wire::trend::{TrendPointView, TrendWarningView, estimate_view, trend_views};

/// Limit of rows that a trend uses: one for each axis of a session.
pub(crate) const MAX_ROWS: u32 = 2 * MAX_SESSIONS as u32;

/// Returns the writes of a session that ends: its estimates, each with the warnings of the
/// trend up to now.
pub(super) fn ended(
    asset: &str,
    open: &OpenSession,
    turn: &Turn<'_>,
) -> Result<Vec<Write>, ServiceError> {
    let estimates = open.judging.engine().servo_estimates();
    if estimates.x.is_none() && estimates.y.is_none() {
        return Ok(Vec::new());
    }
    let calibration_id = open.judging.basis().calibration_id.clone();
    let mut estimates_so_far = Vec::new();
    if calibration_id.is_some() {
        turn.barrier()?;
        let handles = &turn.env.handles;
        let points = points(handles.wait(handles.store.trend(asset, MAX_ROWS))?);
        let same = points.into_iter().filter(|p| p.calibration_id == calibration_id);
        estimates_so_far = same.map(|p| p.estimates).chain([estimates]).collect();
    }
    let trends = trend_views(&estimates_so_far);
    let row = |axis: Axis, estimate: &ServoEstimate| -> Result<Write, ServiceError> {
        let warnings: Vec<&TrendWarningView> = trends
            .iter()
            .filter(|trend| trend.axis == axis.into())
            .filter_map(|trend| trend.warning.as_ref())
            .collect();
        Ok(Write::Trend(TrendRow {
            session: open.id.clone(),
            axis: axis.as_str().to_owned(),
            asset: asset.to_owned(),
            ended_at: turn.at,
            n_samples: open.progress.n_samples,
            calibration_id: calibration_id.clone(),
            gain: estimate.gain,
            gain_error: estimate.gain_error,
            offset_m_s2: estimate.offset_m_s2,
            offset_error_m_s2: estimate.offset_error_m_s2,
            delay_s: estimate.delay_s,
            delay_error_s: estimate.delay_error_s,
            motion_s: estimate.seconds,
            warnings: (!warnings.is_empty()).then(|| views::to_json(&warnings)).transpose()?,
        }))
    };
    let estimated = Axis::ALL.into_iter().filter_map(|axis| Some((axis, estimates[axis]?)));
    estimated.map(|(axis, estimate)| row(axis, &estimate)).collect()
}

/// The estimates of a session.
pub(crate) struct TrendPoint {
    session: String,
    session_id: String,
    ended_at: Micros,
    pub(crate) calibration_id: Option<String>,
    n_samples: i64,
    pub(crate) estimates: PerAxis<Option<ServoEstimate>>,
}

impl TrendPoint {
    pub(crate) fn view(self) -> TrendPointView {
        TrendPointView {
            session: self.session,
            session_id: Some(self.session_id),
            ended_at: Some(rfc3339(self.ended_at)),
            calibration_id: self.calibration_id,
            samples: u64::try_from(self.n_samples).unwrap_or_default(),
            x: self.estimates.x.as_ref().map(estimate_view),
            y: self.estimates.y.as_ref().map(estimate_view),
        }
    }
}

/// Groups rows, newest first, by session; returns the sessions oldest first.
pub(crate) fn points(rows: Vec<TrendEntry>) -> Vec<TrendPoint> {
    let mut points: Vec<TrendPoint> = Vec::new();
    for TrendEntry { session_name, row } in rows.into_iter().rev() {
        if points.last().is_none_or(|point| point.session_id != row.session) {
            points.push(TrendPoint {
                session: session_name,
                session_id: row.session.clone(),
                ended_at: row.ended_at,
                calibration_id: row.calibration_id.clone(),
                n_samples: row.n_samples,
                estimates: PerAxis::default(),
            });
        }
        let Some(point) = points.last_mut() else { continue };
        let axis = if row.axis == Axis::X.as_str() { Axis::X } else { Axis::Y };
        point.estimates[axis] = Some(estimate(&row));
    }
    points
}

const fn estimate(row: &TrendRow) -> ServoEstimate {
    ServoEstimate {
        offset_m_s2: row.offset_m_s2,
        offset_error_m_s2: row.offset_error_m_s2,
        gain: row.gain,
        gain_error: row.gain_error,
        delay_s: row.delay_s,
        delay_error_s: row.delay_error_s,
        seconds: row.motion_s,
    }
}
