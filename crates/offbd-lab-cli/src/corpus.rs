//! A labelled corpus of simulated sessions: per preset a calibration session, healthy
//! sessions with pushes and gusts, and a session for each kind of fault.

use std::path::Path;

use anyhow::Context;
use rayon::prelude::*;

use super::labels::{Label, class, labelled};
use super::session::write_session;
use offbd_core::vocabulary::Axis;
use offbd_file_cli::calibrate::write_asset;
use offbd_file_cli::replay::progress;
use offbd_lab::simulation::{
    BallFault, Disturbances, Fault, FaultEffect, Preset, Reference, SensorFault, ServoFault,
    SimulatedRig,
};
use offbd_terminal::output;

/// The axis of each fault of a servo in a corpus, again from the first where there are more.
/// Chosen: both axes occur with about as many faults.
const SERVO_AXES: [Axis; 7] = [Axis::Y, Axis::X, Axis::X, Axis::Y, Axis::X, Axis::Y, Axis::X];

/// Returns the faults of a corpus: every one, with its default size, and along y if it is on
/// either axis of the sensor.
fn faults() -> impl Iterator<Item = FaultEffect> {
    let servo = ServoFault::all().into_iter().zip(SERVO_AXES.into_iter().cycle());
    let sensor = SensorFault::all().into_iter().map(|fault| match fault {
        SensorFault::FreezeAxis(_) => SensorFault::FreezeAxis(Axis::Y),
        fault => fault,
    });
    let servo = servo.map(|(fault, axis)| FaultEffect::Servo(axis, fault));
    let ball = BallFault::all().into_iter().map(FaultEffect::Ball);
    servo.chain(ball).chain(sensor.map(FaultEffect::Sensor))
}

/// Duration of a calibration session, s; chosen: enough for a reliable calibration.
const CALIBRATION_S: f64 = 120.0;
/// Number of healthy sessions per rig.
const N_HEALTHY: usize = 3;
/// Range of the onsets as shares of the session; chosen.
const ONSET_SHARE: [f64; 2] = [0.3, 0.55];
/// Fractional part of the golden ratio: the fractional parts of its multiples spread
/// onsets evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A session of a corpus to be recorded.
struct CorpusSession {
    preset: Preset,
    file: String,
    reference: Reference,
    seconds: f64,
    disturbances: Disturbances,
    fault: Option<Fault>,
    seed: u64,
}

/// Writes a corpus into `dir`, with sessions of `seconds`, all from one `seed`.
pub(super) fn write(dir: &Path, seconds: f64, seed: u64) -> anyhow::Result<()> {
    let plans: Vec<CorpusSession> =
        Preset::ALL.into_iter().flat_map(|preset| plans(preset, seconds, seed)).collect();
    for preset in Preset::ALL {
        let folder = dir.join(preset.as_str());
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        write_asset(&preset.model()?.rig, &folder.join("rig.json"))?;
    }
    let bar = progress(plans.len());
    let labels = plans
        .par_iter()
        .map(|plan| plan.write(dir).inspect(|_| bar.inc(1)))
        .collect::<anyhow::Result<Vec<Label>>>()?;
    bar.finish_and_clear();
    let path = dir.join("labels.json");
    std::fs::write(&path, serde_json::to_vec_pretty(&labels)?)
        .with_context(|| path.display().to_string())?;
    output::remark(format_args!(
        "{}: {} sessions of {} rigs",
        dir.display(),
        labels.len(),
        Preset::ALL.len()
    ));
    Ok(())
}

fn plans(preset: Preset, seconds: f64, seed: u64) -> Vec<CorpusSession> {
    let n_rig = preset as u64 + 1;
    let plan =
        |file: String, n: usize, fault: Option<Fault>, pushes_per_minute: f64| CorpusSession {
            preset,
            file,
            reference: if n == 0 { Reference::Lissajous } else { Reference::ALL[(n + 1) % 4] },
            seconds: if n == 0 { CALIBRATION_S } else { seconds },
            disturbances: Disturbances {
                pushes_per_minute,
                gusts_per_minute: pushes_per_minute / 2.0,
            },
            fault,
            seed: seed.wrapping_mul(1_000_003).wrapping_add(n_rig * 1000 + n as u64),
        };
    let mut all = vec![plan("calibration.csv".to_owned(), 0, None, 0.0)];
    for i in 0..N_HEALTHY {
        all.push(plan(format!("{i:03}.csv"), 1 + i, None, 2.0));
    }
    for (i, effect) in faults().enumerate() {
        let spread = ((i + 1) as f64 * GOLDEN).fract();
        let share = ONSET_SHARE[0] + (ONSET_SHARE[1] - ONSET_SHARE[0]) * spread;
        let onset_s = (share * seconds * 1e3).round() / 1e3;
        let fault = Fault { effect, onset_s, end_s: None };
        all.push(plan(format!("{:03}.csv", 100 + i), 1 + N_HEALTHY + i, Some(fault), 0.0));
    }
    all
}

impl CorpusSession {
    fn write(&self, dir: &Path) -> anyhow::Result<Label> {
        let model = self.preset.model()?;
        let mut rig = SimulatedRig::new(model, self.reference, self.disturbances, self.seed)?;
        self.fault.into_iter().for_each(|fault| rig.inject(fault));
        let samples = rig.record(self.seconds);
        let folder = self.preset.as_str();
        write_session(&dir.join(folder).join(&self.file), &samples, false)?;
        let truth = rig.faults().next();
        Ok(Label {
            file: format!("{folder}/{}", self.file),
            rig: folder.to_owned(),
            motion: self.reference.to_string(),
            seconds: self.seconds,
            rows: samples.len() as u64,
            class: class(truth),
            also: Vec::new(),
            fault: truth.map(labelled),
        })
    }
}
