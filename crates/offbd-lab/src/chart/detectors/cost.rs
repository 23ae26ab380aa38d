//! CPU time per sample: the whole pipeline by profile, and the loops of the
//! detectors beside it.

use std::hint::black_box;

use super::bench::Bench;
use super::method::{CHAPTER_M_S2, Detector, Method, Watch};
use super::trace::{Moment, follow};
use crate::chart::ChartError;
use crate::simulation::Preset;
use crate::timing::{CpuTime, cpu_time};
use offbd_core::diagnosis::{FaultMemory, Profile};
use offbd_core::engine::{Engine, Input, Setup};
use offbd_core::vocabulary::Sample;

/// What one sample costs.
#[derive(Clone, Debug)]
pub(super) struct Cost {
    pub(super) what: String,
    /// Of one sample, s.
    pub(super) time: CpuTime,
}

/// Loops whose own cost is measured; that of the weighed explanations is part
/// of the engine.
const LOOPS: [(Method, f64); 3] = [
    (Method::Chapter, CHAPTER_M_S2),
    (Method::Debounced, 0.15),
    (Method::Cusum { drift: 0.5 }, 100.0),
];

/// Measures on a minute of the chapter's rig; the whole pipeline by profile
/// default comes first.
pub(super) fn measure(bench: &Bench, repeats: usize) -> Result<Vec<Cost>, ChartError> {
    let samples = Bench::minute(Preset::Chapter)?;
    let per_sample = |run: CpuTime| {
        let n = samples.len() as f64;
        CpuTime { minimum_s: run.minimum_s / n, median_s: run.median_s / n }
    };
    let mut costs = Vec::new();
    for profile in Profile::ALL {
        let setup = bench.setup(profile);
        let time = cpu_time(repeats, || judge(setup, &samples));
        let what = format!("engine, {profile}");
        costs.push(Cost { what, time: per_sample(time) });
    }
    let trace =
        follow(&[Profile::Default, Profile::Textbook].map(|p| bench.setup(p).clone()), &samples);
    for (method, threshold) in LOOPS {
        let detector = Detector { method, threshold, chosen: true };
        let moments: &[Moment] = detector.moments(&trace);
        let time = cpu_time(repeats, || {
            let mut watch = Watch::new(detector, bench.healthy_m_s2);
            for moment in moments {
                black_box(watch.take(black_box(moment)));
            }
        });
        let what = method.name();
        costs.push(Cost { what, time: per_sample(time) });
    }
    Ok(costs)
}

fn judge(setup: &Setup, samples: &[Sample]) {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut outputs = Vec::new();
    for sample in samples {
        engine.handle(Input::Sample(black_box(*sample)), &mut outputs);
        black_box(&outputs);
        outputs.clear();
    }
}
