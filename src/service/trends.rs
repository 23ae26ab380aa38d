//! How the servos of a rig answer from session to session.

use super::clock::rfc3339;
use super::running::OpenSession;
use super::shard::Context;
use super::{Service, ServiceError, views};
use crate::store::{Micros, TrendEntry, TrendRow, Write};
use crate::wire::trend::{
    TrendPointView, TrendWarningView, TrendsView, estimate_view, trend_views,
};
use offbd_core::diagnosis::ServoEstimate;
use offbd_core::diagnosis::trend::MAX_SESSIONS;
use offbd_core::vocabulary::{Axis, PerAxis};

/// Rows that are looked at: one for each axis of a session.
const MAX_ROWS: u32 = 2 * MAX_SESSIONS as u32;

impl Service {
    /// What the sessions of `asset` estimated, and the trends of those that
    /// were judged by the calibration that it has now.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn trends(&self, asset: &str) -> Result<TrendsView, ServiceError> {
        let calibration_id = self.asset(asset).await?.calibration.map(|c| c.id);
        let points = points(self.inner.handles.store.trend(asset, MAX_ROWS).await?);
        let learnt = calibration_id.is_some();
        let of_now = points.iter().filter(|p| learnt && p.calibration_id == calibration_id);
        let estimates: Vec<_> = of_now.map(|p| p.estimates).collect();
        Ok(TrendsView {
            asset: asset.to_owned(),
            calibration_id,
            trends: trend_views(&estimates),
            points: points.into_iter().map(Point::view).collect(),
        })
    }
}

/// What is written of a session that ends at `at`: its estimates, each with
/// the warnings that the sessions up to now lead to.
pub(super) fn ended(
    context: &Context,
    asset: &str,
    open: &OpenSession,
    at: Micros,
) -> Result<Vec<Write>, ServiceError> {
    let estimates = open.judging.engine().servo_estimates();
    if estimates.x.is_none() && estimates.y.is_none() {
        return Ok(Vec::new());
    }
    let calibration_id = open.judging.basis().calibration_id.clone();
    let mut known = Vec::new();
    if calibration_id.is_some() {
        context.handles.fence()?;
        let points = points(context.handles.wait(context.handles.store.trend(asset, MAX_ROWS))?);
        let alike = points.into_iter().filter(|p| p.calibration_id == calibration_id);
        known = alike.map(|p| p.estimates).chain([estimates]).collect();
    }
    let trends = trend_views(&known);
    let row = |axis: Axis, estimate: &ServoEstimate| -> Result<Write, ServiceError> {
        let warnings: Vec<&TrendWarningView> = trends
            .iter()
            .filter(|trend| trend.axis == axis.as_str())
            .filter_map(|trend| trend.warning.as_ref())
            .collect();
        Ok(Write::Trend(TrendRow {
            session: open.id.clone(),
            axis: axis.as_str().to_owned(),
            asset: asset.to_owned(),
            ended_at: at,
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

/// A session's estimates.
struct Point {
    session: String,
    session_id: String,
    ended_at: Micros,
    calibration_id: Option<String>,
    n_samples: i64,
    estimates: PerAxis<Option<ServoEstimate>>,
}

impl Point {
    fn view(self) -> TrendPointView {
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

/// Sessions, oldest first, out of rows, newest first.
fn points(rows: Vec<TrendEntry>) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::new();
    for TrendEntry { session_name, row } in rows.into_iter().rev() {
        if points.last().is_none_or(|point| point.session_id != row.session) {
            points.push(Point {
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
