//! Draws the maps: regions of the cheapest model with the choices marked, and errors by
//! model.

use super::ContactMap;
use super::errors::SMALLER;
use super::judge::{ChoiceVerdict, DecisionCounts, MotionCell, TOLERANCES_M};
use crate::chart::{
    Axis, Category, Figure, Look, Mark, Marker, Panel, Regions, Scale, Series, Stroke,
};
use crate::scene::Model;

/// One category per model, and the last one for cells without a reference solution.
const MODELS: [(&str, (u8, u8, u8), Marker); 6] = [
    ("planar", (0xDC, 0xEB, 0xF7), Marker::Ring),
    ("rolling", (0x9E, 0xCA, 0xE1), Marker::Circle),
    ("creeping", (0x42, 0x92, 0xC6), Marker::Triangle),
    ("sliding", (0x9A, 0xD3, 0xA5), Marker::Square),
    ("compliant", (0xE6, 0x9F, 0x00), Marker::Diamond),
    ("no truth: thrown about", (0xC8, 0xC8, 0xC8), Marker::Cross),
];

/// The wanted accuracies, as text.
const TOLERANCE_NAMES: [&str; TOLERANCES_M.len()] = ["10⁻³ m", "10⁻⁴ m", "10⁻⁵ m"];

/// Upper limits of the bins of an error, m, with their names.
const BINS_M: [(f64, &str); 7] = [
    (1e-7, "below 10⁻⁷ m"),
    (1e-6, "10⁻⁶"),
    (1e-5, "10⁻⁵"),
    (1e-4, "10⁻⁴"),
    (1e-3, "10⁻³"),
    (1e-2, "10⁻²"),
    (f64::INFINITY, "above 10⁻² m"),
];

const DEAR: Look = Look { rgb: (0xB0, 0x10, 0x30), marker: Marker::Cross, dash: None };

pub(super) fn regions(maps: &[ContactMap]) -> Figure {
    let panels = maps.iter().flat_map(|map| {
        (0..TOLERANCES_M.len()).map(move |k| {
            let title = format!("{}, within {}", map.name, TOLERANCE_NAMES[k]);
            region_panel(map, k, title)
        })
    });
    Figure {
        title: "The cheapest model that is good enough, and what is chosen".to_owned(),
        subtitle: verdicts(maps),
        columns: TOLERANCES_M.len(),
        panel_height: 620,
        panels: panels.collect(),
    }
}

/// Summarises the choices as the subtitle.
fn verdicts(maps: &[ContactMap]) -> String {
    let tallies: Vec<DecisionCounts> = maps
        .iter()
        .flat_map(|map| (0..TOLERANCES_M.len()).map(|k| DecisionCounts::of(&map.cells, k)))
        .collect();
    let sum = |f: fn(&DecisionCounts) -> usize| tallies.iter().map(f).sum::<usize>();
    let mut factors: Vec<f64> = maps
        .iter()
        .flat_map(|map| &map.cells)
        .flat_map(|cell| &cell.judged)
        .filter(|judged| judged.verdict == ChoiceVerdict::TooDear)
        .filter_map(|judged| judged.cost_factor)
        .collect();
    let worst = factors.iter().copied().fold(1.0, f64::max);
    let median = offbd_core::maths::median(&mut factors).unwrap_or(1.0);
    format!(
        "Of {} decisions {} are too cheap and {} too dear, by a median factor of {median:.1} in CPU \
         time and {worst:.0} at worst. A ball at rest on a plate that swings about one axis for 1 s.",
        sum(|tally| tally.judged),
        sum(|tally| tally.too_cheap),
        sum(|tally| tally.too_dear),
    )
}

fn axes(map: &ContactMap) -> (Axis, Axis) {
    let around = |values: &[f64]| {
        let half = (values[1] / values[0]).sqrt();
        Scale::Log(values[0] / half, values[values.len() - 1] * half)
    };
    (
        Axis::new("amplitude, rad", around(&map.amplitudes)),
        Axis::new("frequency, Hz", around(&map.frequencies)),
    )
}

fn regions_of(
    map: &ContactMap,
    categories: Vec<Category>,
    category: impl Fn(&MotionCell) -> usize,
) -> Regions {
    let columns = map.amplitudes.len();
    let of = |i: usize, j: usize| category(&map.cells[j * columns + i]);
    Regions::centred_log(categories, &map.amplitudes, &map.frequencies, of)
}

fn region_panel(map: &ContactMap, k: usize, title: String) -> Panel {
    let (x, y) = axes(map);
    let categories = MODELS.map(|(name, rgb, marker)| Category {
        name: name.to_owned(),
        look: Look { rgb, marker, dash: None },
    });
    let mut panel = Panel::new(title, x, y);
    panel.regions = Some(regions_of(map, categories.to_vec(), |cell| {
        let known = |model: Model| Model::ALL.iter().position(|&m| m == model);
        cell.judged[k].cheapest.and_then(known).unwrap_or(Model::ALL.len())
    }));
    let decided = |verdict| {
        let cells = map.cells.iter().filter(move |c| c.judged[k].verdict == verdict);
        cells.map(|cell| (cell.amplitude, cell.frequency))
    };
    let dear = decided(ChoiceVerdict::TooDear).collect();
    panel.series.push(Series::new("chosen: dearer than need be", DEAR, Stroke::Markers, dear));
    let mark = |at| Mark { name: "chosen: too cheap".to_owned(), text: String::new(), at };
    panel.marks = decided(ChoiceVerdict::TooCheap).map(mark).collect();
    panel
}

pub(super) fn errors(maps: &[ContactMap]) -> Figure {
    let panels =
        maps.iter().flat_map(|map| (0..SMALLER.len()).map(move |model| error_panel(map, model)));
    Figure {
        title: "Error of each model against the compliant one".to_owned(),
        subtitle: reaches(maps),
        columns: SMALLER.len(),
        panel_height: 560,
        panels: panels.collect(),
    }
}

/// Counts the cells in which each model is accurate enough, as the subtitle.
fn reaches(maps: &[ContactMap]) -> String {
    let limit = TOLERANCES_M[1];
    let known = || maps.iter().flat_map(|g| &g.cells).filter(|cell| cell.has_truth(limit));
    let able = |model| {
        let within =
            |cell: &&MotionCell| cell.errors.by_model().any(|(m, e)| m == model && e <= limit);
        format!("{model} in {}", known().filter(within).count())
    };
    format!(
        "Worst distance in position over 1 s; dark is far off, blank is not known. Within {} of the \
         {} cells whose truth is known: {}.",
        TOLERANCE_NAMES[1],
        known().count(),
        SMALLER.map(able).join(", ")
    )
}

fn error_panel(map: &ContactMap, model: usize) -> Panel {
    let (x, y) = axes(map);
    let bins = BINS_M.iter().enumerate().map(|(i, (_, name))| Category {
        name: (*name).to_owned(),
        look: Look::step(i, BINS_M.len()),
    });
    let mut panel = Panel::new(format!("{}, {}", SMALLER[model], map.name), x, y);
    panel.regions = Some(regions_of(map, bins.collect(), |cell| {
        if !cell.has_truth(TOLERANCES_M[0]) {
            return BINS_M.len();
        }
        let error = cell.errors.by_model().nth(model).map_or(f64::INFINITY, |(_, error)| error);
        BINS_M.iter().position(|(end, _)| error <= *end).unwrap_or(BINS_M.len())
    }));
    panel
}
