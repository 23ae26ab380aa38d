//! Scenes whose plate moves by a law of time.

use serde_json::json;

use super::SceneArgs;
use super::course::{Course, Plan};
use super::decide::NoneMeets;
use super::files::Folder;
use super::{plots, report};
use crate::cli::output::{self, Format};
use crate::wire::scene::NamedScene;

/// Runs `scenes`, shows and writes what comes of them; to within `tolerance_m`
/// where nothing else is asked for.
pub(super) fn run(
    args: &SceneArgs,
    scenes: &[NamedScene],
    tolerance_m: Option<f64>,
) -> anyhow::Result<()> {
    let mut how = args.how.clone();
    if how.is_plain() {
        how.tolerance = tolerance_m;
    }
    let plan = Plan { how: &how, sample: args.sample, sampled: args.output.is_some() };
    let mut courses = Vec::new();
    for NamedScene { name, scene, laws } in scenes {
        let course = plan.run(name, scene, &mut laws.clone()).inspect_err(say_tried)?;
        courses.push(course);
    }
    if let Some(folder) = Folder::new(args.output.as_deref())? {
        write(&folder, &courses)?;
    }
    show(args.format, &courses)?;
    failed(&courses)
}

/// What was tried in vain, on stderr.
pub(super) fn say_tried(error: &anyhow::Error) {
    let Some(none) = error.downcast_ref::<NoneMeets>() else { return };
    for line in report::tried(&none.tried) {
        anstream::eprintln!("{line}");
    }
}

fn write(folder: &Folder, courses: &[Course]) -> anyhow::Result<()> {
    let Some((first, others)) = courses.split_first() else { return Ok(()) };
    folder.trajectory("trajectory.csv", &first.samples)?;
    for course in others {
        folder.trajectory(&format!("trajectory-{}.csv", course.name), &course.samples)?;
    }
    folder.figure("position", &plots::position(first))?;
    folder.figure("path", &plots::path(first))?;
    if !others.is_empty() {
        folder.figure("side-by-side", &plots::side_by_side(courses))?;
    }
    Ok(())
}

fn show(format: Format, courses: &[Course]) -> anyhow::Result<()> {
    for course in courses {
        warn(course);
    }
    match format {
        Format::Table => {
            let blocks = courses.iter().map(|course| report::lines(course).join("\n"));
            output::line(&blocks.collect::<Vec<_>>().join("\n\n"))
        }
        Format::Json => {
            let mut objects = courses.iter().map(report::object);
            let mut first = objects.next().unwrap_or_default();
            let beside: Vec<_> = objects.collect();
            if !beside.is_empty() {
                first["beside"] = json!(beside);
            }
            output::line(&first.to_string())
        }
    }
}

/// Says on stderr what to beware of.
pub(super) fn warn(course: &Course) {
    for warning in &course.warnings {
        anstream::eprintln!("warning: {warning}");
    }
}

/// The first failure among the courses.
pub(super) fn failed(courses: &[Course]) -> anyhow::Result<()> {
    for course in courses {
        if let Err(failure) = &course.outcome {
            return Err(anyhow::anyhow!("{}: {failure}", course.name));
        }
    }
    Ok(())
}
