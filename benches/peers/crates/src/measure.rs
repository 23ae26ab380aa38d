//! CPU time of this thread, the truth, and the records that come of both.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use cpu_time::ThreadTime;
use serde::Serialize;

use crate::scene::{SCENES, Scene};

const REPEATS: usize = 3;
/// What the repeats of a short run should add up to.
const SHORTEST: Duration = Duration::from_millis(20);
/// After which repeating stops early.
const LONGEST: Duration = Duration::from_secs(20);
const MOST: usize = 1000;

/// Absolute over relative tolerance: positions are centimetres.
pub const ABSOLUTE: f64 = 1e-2;

/// Relative tolerances to try.
pub fn tolerances(quick: bool) -> &'static [f64] {
    if quick { &[1e-4, 1e-6, 1e-8] } else { &[1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9] }
}

/// One point of a work-precision diagram.
#[derive(Serialize)]
pub struct Record {
    scene: &'static str,
    engine: &'static str,
    model: &'static str,
    method: String,
    setting: &'static str,
    value: f64,
    error_m: Option<f64>,
    cpu_us_per_s: Option<f64>,
    spread: Option<f64>,
    note: Option<String>,
}

/// What is measured: a model, the method on it, and the setting that is swept.
pub struct Labels {
    pub model: &'static str,
    pub method: String,
    pub setting: &'static str,
    pub value: f64,
}

/// Where the ball should be: times and positions in the plate's frame.
pub struct Truth {
    pub times: Vec<f64>,
    positions: Vec<[f64; 2]>,
}

impl Truth {
    fn read(folder: &Path, scene: &Scene) -> Result<Self> {
        let path = folder.join(scene.name).with_extension("csv");
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let rows = text.lines().skip(1).map(row).collect::<Result<Vec<_>>>()?;
        Ok(Self {
            times: rows.iter().map(|row| row[0]).collect(),
            positions: rows.iter().map(|row| [row[1], row[2]]).collect(),
        })
    }

    /// Largest distance in x, y; `None` where it is not a number or one is missing.
    fn worst(&self, positions: &[[f64; 2]]) -> Option<f64> {
        if positions.len() != self.positions.len() {
            return None;
        }
        let gap = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
        let gaps = positions.iter().zip(&self.positions).map(gap);
        let worst = gaps.fold(0.0, |worst: f64, gap| if gap <= worst { worst } else { gap });
        worst.is_finite().then_some(worst)
    }
}

fn row(line: &str) -> Result<Vec<f64>> {
    line.split(',').map(|cell| cell.parse().with_context(|| line.to_owned())).collect()
}

/// Collects the records of one engine.
pub struct Bench {
    engine: &'static str,
    pub quick: bool,
    scenes: Vec<(Scene, Truth)>,
    pub records: Vec<Record>,
}

impl Bench {
    pub fn new(engine: &'static str, folder: &Path, quick: bool) -> Result<Self> {
        let chosen = SCENES.into_iter().filter(|scene| scene.quick || !quick);
        let scenes = chosen.map(|scene| Ok((scene, Truth::read(folder, &scene)?)));
        Ok(Self { engine, quick, scenes: scenes.collect::<Result<_>>()?, records: Vec::new() })
    }

    /// Calls `scan` for each scene with a place to put its records.
    pub fn each_scene(&mut self, scan: impl Fn(&mut Case)) {
        for (scene, truth) in &self.scenes {
            let records = &mut self.records;
            scan(&mut Case { engine: self.engine, quick: self.quick, scene, truth, records });
        }
    }
}

/// One scene of one engine.
pub struct Case<'a> {
    engine: &'static str,
    pub quick: bool,
    pub scene: &'a Scene,
    truth: &'a Truth,
    records: &'a mut Vec<Record>,
}

impl Case<'_> {
    /// Measures one setting. `run` returns the positions at the times that it is
    /// given; only runs without any are timed.
    pub fn add(&mut self, labels: Labels, run: impl Fn(&[f64]) -> Result<Vec<[f64; 2]>>) {
        let traced = run(&self.truth.times);
        let note = match &traced {
            Ok(positions) if self.truth.worst(positions).is_some() => None,
            Ok(_) => Some("non-finite".to_owned()),
            Err(failure) => Some(format!("did not finish: {failure}")),
        };
        let error_m = traced.as_ref().ok().and_then(|positions| self.truth.worst(positions));
        let times = if traced.is_ok() { cpu_times(|| run(&[])) } else { Vec::new() };
        let cost = times.first().map(|t| t.as_secs_f64() * 1e6 / self.scene.duration);
        let median = times.get(times.len() / 2);
        let record = Record {
            scene: self.scene.name,
            engine: self.engine,
            model: labels.model,
            method: labels.method,
            setting: labels.setting,
            value: labels.value,
            error_m,
            cpu_us_per_s: cost,
            spread: median.map(|median| median.as_secs_f64() / times[0].as_secs_f64()),
            note,
        };
        eprintln!("{}", summary(&record));
        self.records.push(record);
    }
}

/// CPU times of repeated runs, shortest first.
fn cpu_times<T>(run: impl Fn() -> T) -> Vec<Duration> {
    let mut times: Vec<Duration> = Vec::new();
    let mut total = Duration::ZERO;
    while times.len() < REPEATS || (total < SHORTEST && times.len() < MOST) {
        let begin = ThreadTime::now();
        std::hint::black_box(run());
        times.push(begin.elapsed());
        total += times[times.len() - 1];
        if total > LONGEST {
            break;
        }
    }
    times.sort();
    times
}

/// One line on a record, for whoever watches.
fn summary(record: &Record) -> String {
    let show =
        |x: Option<f64>, unit| x.map_or_else(|| "–".to_owned(), |x| format!("{x:.3e} {unit}"));
    format!(
        "{:10} {:12} {:34} {:<8} {:>14} {:>16} {}",
        record.scene,
        record.engine,
        record.method,
        record.value,
        show(record.error_m, "m"),
        show(record.cpu_us_per_s, "µs/s"),
        record.note.as_deref().unwrap_or_default(),
    )
}
