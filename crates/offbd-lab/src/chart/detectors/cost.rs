//! CPU time per sample, of the whole pipeline by profile and of the simple detectors.

use std::hint::black_box;

use super::calibrated_rig::CalibratedRig;
use super::method::{CHAPTER_M_S2, DetectionMethod, Detector, DetectorState};
use super::trace::{Moment, follow};
use crate::chart::ChartError;
use crate::simulation::Preset;
use crate::timing::{CpuTime, cpu_time};
use offbd_core::diagnosis::{FaultMemory, Profile};
use offbd_core::engine::{Engine, Input, Setup};
use offbd_core::vocabulary::Sample;

/// The CPU time of one sample.
#[derive(Clone, Debug)]
pub(super) struct SampleCost {
    pub(super) what: String,
    /// CPU time per sample, s.
    pub(super) time: CpuTime,
}

/// Detectors whose own cost is measured, with their thresholds; that of the likelihood
/// ratio is part of the engine's.
const LOOPS: [(DetectionMethod, f64); 3] = [
    (DetectionMethod::Chapter, CHAPTER_M_S2),
    (DetectionMethod::Debounced, 0.15),
    (DetectionMethod::Cusum { drift: 0.5 }, 100.0),
];

/// Measures on a minute of the chapter's rig. The first result is the whole pipeline with
/// the profile `default`.
pub(super) fn measure(rig: &CalibratedRig, repeats: usize) -> Result<Vec<SampleCost>, ChartError> {
    let samples = CalibratedRig::minute(Preset::Chapter)?;
    let per_sample = |run: CpuTime| {
        let n = samples.len() as f64;
        CpuTime { minimum_s: run.minimum_s / n, median_s: run.median_s / n }
    };
    let mut costs = Vec::new();
    for profile in Profile::ALL {
        let setup = rig.setup(profile);
        let time = cpu_time(repeats, || judge(setup, &samples));
        let what = format!("engine, {profile}");
        costs.push(SampleCost { what, time: per_sample(time) });
    }
    let trace =
        follow(&[Profile::Default, Profile::Textbook].map(|p| rig.setup(p).clone()), &samples);
    for (method, threshold) in LOOPS {
        let detector = Detector { method, threshold, chosen: true };
        let moments: &[Moment] = detector.moments(&trace);
        let time = cpu_time(repeats, || {
            let mut watch = DetectorState::new(detector, rig.healthy_m_s2);
            for moment in moments {
                black_box(watch.take(black_box(moment)));
            }
        });
        let what = method.name();
        costs.push(SampleCost { what, time: per_sample(time) });
    }
    Ok(costs)
}

fn judge(setup: &Setup, samples: &[Sample]) {
    let mut engine = Engine::new(setup.clone(), FaultMemory::default());
    let mut transitions = Vec::new();
    for sample in samples {
        engine.handle(Input::Sample(black_box(*sample)), &mut transitions);
        black_box(&transitions);
        transitions.clear();
    }
}
