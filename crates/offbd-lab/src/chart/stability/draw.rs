//! Draws the maps: one panel per method, with the predicted limits.

use super::map::{StabilityMap, Sweep, chapter_ratio};
use super::measure::Fate;
use crate::chart::{Axis, Category, Figure, Look, Marker, Panel, Regions, Scale, Series, Stroke};
use crate::scene::StepLimits;

/// A fate with its name, colour and marker.
type FateStyle = (Fate, &'static str, (u8, u8, u8), Marker);

const FATES: [FateStyle; 4] = [
    (Fate::Stable, "stable", (0xD4, 0xEC, 0xDF), Marker::Ring),
    (Fate::Touchdown, "stable, but a touchdown fails", (0xF7, 0xE3, 0x9C), Marker::Triangle),
    (Fate::Chatter, "chatter: only slip and energy show it", (0xE6, 0x9F, 0x00), Marker::Plus),
    (Fate::BlownUp, "blown up", (0x9A, 0x2A, 0x1A), Marker::Cross),
];

const SLIP: Look = Look { rgb: (0, 0, 0), marker: Marker::Ring, dash: None };
const NORMAL: Look = Look { rgb: (0x00, 0x3C, 0x78), marker: Marker::Ring, dash: Some((16, 10)) };
const MEASURED: Look = Look { rgb: (0, 0, 0), marker: Marker::Circle, dash: None };

/// The measured limit is drawn for every n-th column; chosen for legibility.
const EACH: usize = 3;

pub(super) fn figure(maps: &[StabilityMap]) -> Figure {
    let sweep = maps[0].sweep;
    Figure {
        title: title(sweep),
        subtitle: subtitle(maps),
        columns: 3,
        panel_height: 520,
        panels: maps.iter().map(panel).collect(),
    }
}

fn title(sweep: Sweep) -> String {
    match sweep {
        Sweep::Threshold => "Step against slip threshold: who fails, and how".to_owned(),
        Sweep::Stiffness => {
            format!("Step against stiffness, damping ratio held at {:.2}", chapter_ratio())
        }
        Sweep::Damping => "Step against damping, at the chapter's stiffness".to_owned(),
    }
}

/// Summarises the maps as the subtitle.
fn subtitle(maps: &[StabilityMap]) -> String {
    let limits: usize = maps.iter().map(|map| map.limits.len()).sum();
    let worst = maps.iter().filter_map(StabilityMap::worst_off).fold(0.0, f64::max);
    let explicit: Vec<&StabilityMap> = maps.iter().filter(|map| !map.limits.is_empty()).collect();
    let clamped = explicit.iter().map(|map| map.chatter_over_clamp()).fold(0.0, f64::max);
    format!(
        "The {limits} measured limits of the explicit methods lie within {:.1} % of the eigenvalues'. \
         Between slip limit and normal limit linear theory does not hold: slip should grow without \
         bound, but stays within {clamped:.1} times what full friction changes in one step. {}",
        100.0 * worst,
        implicit(maps)
    )
}

/// Summarises the methods that are stable everywhere in theory.
fn implicit(maps: &[StabilityMap]) -> String {
    let results = maps.iter().filter(|map| map.limits.is_empty()).map(|map| {
        let fails = map.cells.len() - map.count(Fate::Stable);
        if fails == 0 {
            return format!("{} takes every step", map.method);
        }
        let share = 100.0 * fails as f64 / map.cells.len() as f64;
        format!("{} fails at touchdown in {share:.0} % of its cells", map.method)
    });
    format!("{}.", results.collect::<Vec<_>>().join(", "))
}

fn panel(map: &StabilityMap) -> Panel {
    let [values, steps] = map.sweep.ranges();
    let label = match map.sweep {
        Sweep::Threshold => "slip threshold, m/s",
        Sweep::Stiffness => "stiffness, N/m",
        Sweep::Damping => "damping, N·s/m",
    };
    let x = Axis::new(label, Scale::Log(values.0, values.1));
    let y = Axis::new("step, s", Scale::Log(steps.0, steps.1));
    let mut panel = Panel::new(map.method.name(), x, y);
    panel.regions = Some(regions(map));
    panel.series = theory(map);
    let shown = map.limits.iter().step_by(EACH);
    let points = shown.map(|limit| (limit.value, limit.measured)).collect();
    panel.series.push(Series::new("measured limit", MEASURED, Stroke::Markers, points));
    panel
}

fn regions(map: &StabilityMap) -> Regions {
    let categories = FATES.map(|(_, name, rgb, marker)| Category {
        name: name.to_owned(),
        look: Look { rgb, marker, dash: None },
    });
    Regions::centred_log(categories.to_vec(), &map.values, &map.steps, |i, j| {
        let fate = map.cells[j * map.values.len() + i].0;
        FATES.iter().position(|known| known.0 == fate).unwrap_or(FATES.len())
    })
}

/// Returns the predicted limits of both modes over the range swept.
fn theory(map: &StabilityMap) -> Vec<Series> {
    let predicted: Vec<(f64, StepLimits)> = map
        .values
        .iter()
        .filter_map(|&value| {
            let held = map.sweep.held(value);
            Some((value, StepLimits::of(map.method, &held.model, held.normal_m_s2())?))
        })
        .collect();
    let line = |name, look, limit: fn(&StepLimits) -> f64| {
        let points = predicted.iter().map(|(value, limits)| (*value, limit(limits))).collect();
        Series::new(name, look, Stroke::Line, points)
    };
    vec![
        line("slip limit, predicted", SLIP, |limits| limits.slip_s),
        line("normal limit, predicted", NORMAL, |limits| limits.normal_s),
    ]
}
