//! Queries of an asset.

use super::actor::Asset;
use super::session::OpenSession;
use offbd_core::engine::State;
use offbd_store::Micros;
use offbd_wire::link::LinkView;
use offbd_wire::service::{MonitorView, StateView, WatchView, monitor_views, state_view};

impl Asset {
    /// Returns the state of the twin.
    pub(super) fn state(&self) -> StateView {
        let uncalibrated = self.rig.calibration.is_none();
        let learning = uncalibrated.then(|| self.learning());
        let name = &self.row.name;
        let Some(open) = &self.open else {
            return StateView { learning, ..state_view(name, None, &State::default()) };
        };
        let samples = u64::try_from(open.progress.n_samples).unwrap_or_default();
        let session = (open.id.as_str(), open.name.as_str(), samples);
        StateView { learning, ..state_view(name, Some(session), &open.judging.engine().state()) }
    }

    /// Returns how the samples arrive, at `now`.
    pub(super) fn link(&self, now: Micros) -> LinkView {
        self.link.view(&self.row.name, self.rig.sample_rate_hz, now)
    }

    /// Returns the state and the trace after the first `seen` points of `session`.
    pub(super) fn watch(&self, session: Option<String>, seen: u64) -> WatchView {
        let state = self.state();
        let seen = if state.session_id == session { seen } else { 0 };
        let recent = self.open.as_ref().map(|open| open.recent.since(seen));
        let (trace, seen) = recent.unwrap_or_default();
        WatchView { state, trace, seen }
    }

    /// Returns the monitors of the open session; none without one.
    pub(super) fn monitors(&self) -> Vec<MonitorView> {
        let monitors = |open: &OpenSession| monitor_views(&open.judging.engine().state());
        self.open.as_deref().map(monitors).unwrap_or_default()
    }
}
