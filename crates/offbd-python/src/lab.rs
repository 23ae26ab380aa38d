//! Simulated rigs and scenes.

use pyo3::prelude::*;

use crate::table::{Table, numbers};
use crate::{rig, unusable};
use offbd_core::plant::Motion;
use offbd_core::vocabulary::{Invalid, Sample, in_range, positive};
use offbd_lab::scene::{Configuration, Method, Model, Pace, Samples, one_pass, run, suits};
use offbd_lab::simulation::{
    Disturbances, Fault, Preset, Reference, RigModel, SimulatedRig, Variety,
};
use offbd_scene_file::{NamedScene, parse};
use offbd_wire::asset;

/// Longest simulated session, s: a day, as for `offbd simulate`.
const MAX_SECONDS: f64 = 86_400.0;
/// Maximum number of samples of a scene, 80 bytes each; a shorter interval is refused.
const MAX_SAMPLES: f64 = 1e6;

/// Simulates a session as `offbd simulate` does. Returns the asset file of the rig, as its
/// owner would describe it, and the session.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn simulate(
    py: Python<'_>,
    preset: &str,
    rig_seed: Option<u64>,
    asset_file: Option<&str>,
    reference: &str,
    seconds: f64,
    seed: u64,
    faults: Vec<String>,
    seq: bool,
) -> PyResult<(String, Table)> {
    let reference: Reference = reference.parse().map_err(unusable)?;
    let seconds = positive("/seconds", seconds, MAX_SECONDS).map_err(unusable)?;
    let faults: Result<Vec<Fault>, _> = faults.iter().map(|fault| fault.parse()).collect();
    let faults = faults.map_err(unusable)?;
    let model = rig_model(preset, rig_seed, asset_file)?.of_session(seed);
    let file = serde_json::to_string(&asset::view(&model.rig)).map_err(unusable)?;
    let samples =
        py.detach(|| record(model, reference, seconds, seed, &faults)).map_err(unusable)?;
    Ok((file, Table::of_samples(&samples, seq).map_err(unusable)?))
}

fn rig_model(preset: &str, rig_seed: Option<u64>, asset_file: Option<&str>) -> PyResult<RigModel> {
    let model = match rig_seed {
        Some(seed) => Variety::Real.rig(seed),
        None => preset.parse::<Preset>().map_err(unusable)?.model(),
    };
    let model = model.map_err(unusable)?;
    Ok(match asset_file {
        Some(_) => model.owned_as(rig(asset_file).map_err(unusable)?),
        None => model,
    })
}

fn record(
    model: RigModel,
    reference: Reference,
    seconds: f64,
    seed: u64,
    faults: &[Fault],
) -> Result<Vec<Sample>, Invalid> {
    let mut rig = SimulatedRig::new(model, reference, Disturbances::default(), seed)?;
    faults.iter().for_each(|fault| rig.inject(*fault));
    Ok(rig.record(seconds))
}

/// Runs a scene file. Returns the model and the method that ran, and the trajectory in the
/// plate frame.
#[pyfunction]
pub(crate) fn scene(
    py: Python<'_>,
    scene_file: &str,
    model: Option<&str>,
    method: Option<&str>,
    step_s: Option<f64>,
    tolerance_m: f64,
    sample_s: f64,
) -> PyResult<(&'static str, &'static str, Table)> {
    let scene = parse(scene_file.as_bytes()).map_err(unusable)?;
    let model = model.map(str::parse).transpose().map_err(unusable)?;
    let method = method.map(str::parse).transpose().map_err(unusable)?;
    let sample_s = positive("/sample_s", sample_s, f64::MAX).map_err(unusable)?;
    if scene.scene.duration_s / sample_s > MAX_SAMPLES {
        return Err(unusable(format!("sample_s: over {MAX_SAMPLES} samples")));
    }
    py.detach(|| {
        let mut rows = Vec::new();
        let mut sink = |t_s: f64, at: &Motion| rows.push((t_s, *at));
        let mut samples = Samples::new(sample_s, &mut sink);
        let ran = if let Some(model) = model {
            let by = configuration(&scene, model, method, step_s, tolerance_m)?;
            run(&scene.scene, &mut scene.laws.clone(), &by, Some(&mut samples))
                .map_err(unusable)?;
            (by.model().name(), by.method().name())
        } else {
            if method.is_some() || step_s.is_some() {
                return Err(unusable("method and step_s need a model"));
            }
            let tolerance_m =
                in_range("/tolerance_m", tolerance_m, 1e-12..=1.0).map_err(unusable)?;
            let mut laws = scene.laws.clone();
            one_pass(&scene.scene, &mut laws, tolerance_m, Some(&mut samples))
                .map_err(unusable)?
                .most_accurate()
        };
        Ok((ran.0, ran.1, table(&rows)?))
    })
}

/// Returns the configuration with these choices.
fn configuration(
    scene: &NamedScene,
    model: Model,
    method: Option<Method>,
    step_s: Option<f64>,
    tolerance_m: f64,
) -> PyResult<Configuration> {
    suits(&scene.scene, model).map_err(unusable)?;
    let method = method.unwrap_or_else(|| model.usual_method());
    let configuration = match step_s {
        Some(step_s) => Configuration::new(model, method, Pace::Step(step_s)),
        None => Configuration::within(model, method, tolerance_m),
    };
    configuration.map_err(unusable)
}

fn table(rows: &[(f64, Motion)]) -> PyResult<Table> {
    const NAMES: [&str; 9] =
        ["x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"];
    let column = |i: usize| numbers(rows.iter().map(|(_, at)| Some(at.to_row()[i])));
    let times = [("t_s", numbers(rows.iter().map(|(t_s, _)| Some(*t_s))))];
    let motion = NAMES.into_iter().enumerate().map(|(i, name)| (name, column(i)));
    Table::new(times.into_iter().chain(motion)).map_err(unusable)
}
