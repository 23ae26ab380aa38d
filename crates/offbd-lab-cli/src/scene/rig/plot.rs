//! Plots deviation and enable of both axes, as in the chapter.

use super::ideal_rig::{DURATION_S, DeviationSignal, ProfileVerdict};
use crate::scene::plots;
use offbd_lab::chart::{Axis, Figure, Look, Panel, Scale, Series, Stroke};

/// The chapter's limit, m/s².
const LIMIT_M_S2: f64 = 0.01;

/// Range of the logarithmic axis of deviations, m/s². Chosen: smaller deviations are due to
/// the log's resolution of 10 µm.
const DEVIATIONS_M_S2: (f64, f64) = (1e-5, 10.0);

const AXES: [&str; 2] = ["x axis: qy", "y axis: qx"];

/// Draws deviations above, enable below; x on the left, y on the right.
pub(super) fn deviation(name: &str, judged: &ProfileVerdict) -> Figure {
    let mut panels: Vec<Panel> = [0, 1].map(|i| deviations(&judged.signals, i)).into();
    panels.extend([0, 1].map(|i| enable(&judged.signals, i)));
    let subtitle = format!(
        "Every 0.1 s by the profile textbook: a fault where an axis is enabled and its deviation \
         reaches 0.01 m/s². Reported: {}.",
        judged.words()
    );
    let mut figure = plots::figure(format!("{name}: twin against rig"), subtitle, 2, panels);
    figure.panel_height = 520;
    figure
}

fn deviations(signals: &[DeviationSignal], i: usize) -> Panel {
    let (low, high) = DEVIATIONS_M_S2;
    let mut panel = Panel::new(
        AXES[i],
        plots::time_axis(DURATION_S),
        Axis::new("|a twin − a measured| (m/s²)", Scale::Log(low, high)),
    );
    let of = |enabled: bool| -> Vec<(f64, f64)> {
        let these = signals.iter().filter(|signal| signal.enabled[i] == enabled);
        these.filter_map(|s| Some((s.at_s, s.deviation[i]?.clamp(low, high)))).collect()
    };
    let limit = signals.iter().map(|signal| (signal.at_s, LIMIT_M_S2)).collect();
    panel.series = vec![
        Series::new("limit", Look::BLACK, Stroke::Line, limit),
        Series::new("deviation, not enabled", Look::of(5), Stroke::Markers, of(false)),
        Series::new("deviation, enabled", Look::of(1), Stroke::Markers, of(true)),
    ];
    panel
}

fn enable(signals: &[DeviationSignal], i: usize) -> Panel {
    let mut panel = Panel::new(
        "",
        plots::time_axis(DURATION_S),
        Axis::new("enable (0 or 1)", Scale::Linear(-0.1, 1.1)),
    );
    panel.series = vec![plots::line("enable", 0, steps(signals, i))];
    panel
}

/// Returns a line that jumps with the signal.
fn steps(signals: &[DeviationSignal], i: usize) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for signal in signals {
        let value = if signal.enabled[i] { 1.0 } else { 0.0 };
        if let Some(&(_, before)) = points.last()
            && before != value
        {
            points.push((signal.at_s, before));
        }
        points.push((signal.at_s, value));
    }
    points
}
