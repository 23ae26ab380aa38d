//! Evaluates a stretch of a recording again, moment by moment.

use std::ops::ControlFlow;

use crate::playback::play;
use crate::replay_settings;
use crate::writing::Handles;
use crate::{ServiceError, snapshots, views};
use offbd_core::engine::Input;
use offbd_core::vocabulary::TimeRange;
use offbd_store::SessionRow;
use offbd_wire::asset::{self, AssetView, CalibrationView};
use offbd_wire::judging::Judging;
use offbd_wire::service::ReplaySettingsView;
use offbd_wire::session_file::SessionInfo;
use offbd_wire::trace::{ThresholdsView, TracePoint};

/// Limit of the samples to evaluate, which take several seconds of one core. A request for a
/// longer range is refused.
const MAX_EVALUATED: i64 = 2_000_000;

/// An engine at or before the start of a stretch of a recording.
pub(crate) struct Evaluation {
    range: TimeRange,
    /// Samples that the engine has evaluated.
    first: i64,
    judging: Judging,
    asset_file: AssetView,
    period_s: f64,
}

impl Evaluation {
    /// Prepares the evaluation of the stretch `range` of `session`, with the calibration
    /// `learnt` if it is not the recorded one.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for invalid settings; [`ServiceError::TooMany`] if too many
    /// samples must be evaluated: those of the range, and those from the last snapshot before
    /// it, or from the start of the session, without one.
    pub(crate) fn begin(
        handles: &Handles,
        session: &SessionRow,
        range: TimeRange,
        settings: &ReplaySettingsView,
        learnt: Option<&CalibrationView>,
    ) -> Result<Self, ServiceError> {
        let setup = replay_settings::setup(session, settings, learnt)?;
        let period_s = setup.settings.period_s;
        let mut asset_file = asset::view(&setup.rig);
        asset_file.diagnostics.get_or_insert_default().profile =
            Some(setup.settings.profile.into());
        let (first, end) = handles.wait(handles.store.indexes(session, range))?;
        let (first, judging) = snapshots::engine_before(handles, session, setup, first)?;
        if end - first > MAX_EVALUATED {
            let what = "samples to evaluate for this range";
            let limit = usize::try_from(MAX_EVALUATED).unwrap_or(usize::MAX);
            return Err(ServiceError::TooMany { what, limit });
        }
        Ok(Self { range, first, judging, asset_file, period_s })
    }

    /// The values at which the monitors decide.
    pub(crate) fn thresholds(&self) -> Vec<ThresholdsView> {
        ThresholdsView::of(self.judging.engine())
    }

    /// The time between two renewals of the evidence, s.
    pub(super) const fn period_s(&self) -> f64 {
        self.period_s
    }

    /// What a file says about `session`, judged with these settings. The verdict hash is that
    /// of the whole session with its own settings.
    pub(crate) fn info(
        &self,
        session: &SessionRow,
        settings: &ReplaySettingsView,
    ) -> Result<SessionInfo, ServiceError> {
        let mut info = views::session_info(session)?;
        let is_recorded = *settings == ReplaySettingsView::default();
        if !is_recorded {
            info.calibration_id = self.asset_file.calibration.as_ref().map(|c| c.id.clone());
            info.asset_file = Some(views::to_json(&self.asset_file)?);
        }
        info.verdict_hash =
            info.verdict_hash.filter(|_| is_recorded && self.range == TimeRange::ALL);
        Ok(info)
    }

    /// Passes the moments of the stretch to `take`, each later than the one before, until it
    /// breaks.
    ///
    /// # Errors
    /// Those of reading the recording; [`ServiceError::Unavailable`] if the service shuts down.
    pub(super) fn run(
        mut self,
        handles: &Handles,
        session: &SessionRow,
        mut take: impl FnMut(TracePoint) -> ControlFlow<()>,
    ) -> Result<(), ServiceError> {
        let mut last = None::<f64>;
        play(handles, session, self.first, |input| {
            if handles.closing.is_cancelled() {
                return ControlFlow::Break(());
            }
            let is_sample = matches!(input, Input::NewSample(_));
            self.judging.input(input);
            let point = is_sample.then(|| TracePoint::of(&self.judging.engine().state())).flatten();
            let is_new = |t_s| t_s >= self.range.from_s && last.is_none_or(|last| t_s > last);
            let Some(point) = point.filter(|point| is_new(point.t_s())) else {
                return ControlFlow::Continue(());
            };
            if point.t_s() > self.range.to_s {
                return ControlFlow::Break(());
            }
            last = Some(point.t_s());
            take(point)
        })?;
        match handles.closing.is_cancelled() {
            true => Err(ServiceError::Unavailable { what: "the service is shutting down" }),
            false => Ok(()),
        }
    }
}
