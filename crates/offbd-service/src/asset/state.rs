//! Queries of an asset.

use super::actor::Asset;
use super::session::OpenSession;
use offbd_core::engine::State;
use offbd_store::Micros;
use offbd_wire::link::LinkView;
use offbd_wire::service::{
    MonitorView, StateView, TraceCursor, WatchView, monitor_views, state_view,
};

impl Asset {
    /// Returns the state of the twin. It has no monitors if none of the recorded samples has been
    /// evaluated, because the asset was not loaded and no state of its engine is stored.
    pub(crate) fn state(&self) -> StateView {
        let uncalibrated = self.rig.calibration.is_none();
        let learning = uncalibrated.then(|| self.learning());
        let name = &self.row.name;
        let Some(open) = &self.open else {
            return StateView { learning, ..state_view(name, None, &State::default()) };
        };
        let samples = u64::try_from(open.progress.n_samples).unwrap_or_default();
        let session = (open.id.as_str(), open.name.as_str(), samples);
        let state = state_view(name, Some(session), &open.judging.engine().state());
        let monitors = if open.is_known() { state.monitors } else { Vec::new() };
        StateView { learning, monitors, ..state }
    }

    /// Returns how the samples arrive, at `now`.
    pub(crate) fn link(&self, now: Micros) -> LinkView {
        self.link.view(&self.row.name, self.rig.sample_rate_hz, now)
    }

    /// Returns the state and, with the cursor of a trace, the trace after it.
    pub(crate) fn watch(&self, cursor: Option<TraceCursor>) -> WatchView {
        let state = self.state();
        let after = cursor.map(|cursor| {
            let is_same = cursor.session_id == state.session_id;
            let seen = if is_same { cursor.seen } else { 0 };
            let recent = self.open.as_ref().map(|open| open.recent.since(seen));
            let (trace, seen) = recent.unwrap_or_default();
            (trace, TraceCursor { session_id: state.session_id.clone(), seen })
        });
        let (trace, cursor) = after.unzip();
        WatchView { state, trace, cursor }
    }

    /// Returns the monitors of the open session; none without one.
    pub(crate) fn monitors(&self) -> Vec<MonitorView> {
        let monitors = |open: &OpenSession| monitor_views(&open.judging.engine().state());
        self.open.as_deref().map(monitors).unwrap_or_default()
    }
}
