//! Scenes whose plate moves by a law of time.

use serde_json::json;

use super::SceneArgs;
use super::decide::NoModelMeets;
use super::files::OutputFolder;
use super::scene_run::{RunRequest, SceneRun};
use super::{plots, report};
use offbd_scene_file::NamedScene;
use offbd_terminal::output::{self, OutputFormat};

/// Runs `scenes`, prints and writes the results; within `tolerance_m` if no other option
/// is given.
pub(super) fn run(
    args: &SceneArgs,
    scenes: &[NamedScene],
    tolerance_m: Option<f64>,
) -> anyhow::Result<()> {
    let mut how = args.how.clone();
    if how.is_plain() {
        how.tolerance = tolerance_m;
    }
    let plan = RunRequest { how: &how, sample: args.sample, sampled: args.output.is_some() };
    let mut scene_runs = Vec::new();
    for NamedScene { name, scene, laws } in scenes {
        let scene_run = plan.run(name, scene, &mut laws.clone()).inspect_err(print_tried)?;
        scene_runs.push(scene_run);
    }
    if let Some(folder) = OutputFolder::new(args.output.as_deref())? {
        write(&folder, &scene_runs)?;
    }
    show(args.format, &scene_runs)?;
    failed(&scene_runs)
}

/// Prints the candidates that were tried without success to stderr.
pub(super) fn print_tried(error: &anyhow::Error) {
    let Some(none) = error.downcast_ref::<NoModelMeets>() else { return };
    for line in report::tried(&none.tried) {
        anstream::eprintln!("{line}");
    }
}

fn write(folder: &OutputFolder, scene_runs: &[SceneRun]) -> anyhow::Result<()> {
    let Some((first, others)) = scene_runs.split_first() else { return Ok(()) };
    folder.trajectory("trajectory.csv", &first.samples)?;
    for scene_run in others {
        folder.trajectory(&format!("trajectory-{}.csv", scene_run.name), &scene_run.samples)?;
    }
    folder.figure("position", &plots::position(first))?;
    folder.figure("path", &plots::path(first))?;
    if !others.is_empty() {
        folder.figure("side-by-side", &plots::side_by_side(scene_runs))?;
    }
    Ok(())
}

fn show(format: OutputFormat, scene_runs: &[SceneRun]) -> anyhow::Result<()> {
    for scene_run in scene_runs {
        warn(scene_run);
    }
    match format {
        OutputFormat::Table => {
            let blocks = scene_runs.iter().map(|scene_run| report::lines(scene_run).join("\n"));
            output::print_line(&blocks.collect::<Vec<_>>().join("\n\n"))
        }
        OutputFormat::Json => {
            let mut objects = scene_runs.iter().map(report::object);
            let mut first = objects.next().unwrap_or_default();
            let beside: Vec<_> = objects.collect();
            if !beside.is_empty() {
                first["beside"] = json!(beside);
            }
            output::print_line(&first.to_string())
        }
    }
}

/// Prints the warnings to stderr.
pub(super) fn warn(scene_run: &SceneRun) {
    for warning in &scene_run.warnings {
        output::remark(format_args!("warning: {warning}"));
    }
}

/// Returns the first failure of the runs as an error.
pub(super) fn failed(scene_runs: &[SceneRun]) -> anyhow::Result<()> {
    for scene_run in scene_runs {
        if let Err(failure) = &scene_run.outcome {
            return Err(anyhow::anyhow!("{}: {failure}", scene_run.name));
        }
    }
    Ok(())
}
