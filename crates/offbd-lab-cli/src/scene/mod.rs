//! `offbd scene`: runs a scene by any model and method, and the book's exercises.

mod catalogue;
mod control;
mod decide;
mod files;
mod laws;
mod plots;
mod recorded;
mod report;
mod rig;
mod scene_run;
mod words;

use std::path::PathBuf;

use clap::Args;

use catalogue::Exercise;
use decide::ConfigurationArgs;
use offbd_terminal::output::OutputFormat;
use recorded::RecordedArgs;

/// Runs a scene: a ball or block on a moving plate.
///
/// By default it chooses the cheapest model and method that meet the wanted
/// accuracy, and prints the reasons.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd scene --list\n  \
    offbd scene tilt -o out\n  \
    offbd scene sine --tolerance 1e-6\n  \
    offbd scene steep --model compliant --method rodas4 --tolerance 1e-9\n  \
    offbd scene my.json --model rolling --method rk4 --step 0.005 --format json\n  \
    offbd scene --commands monday.csv --asset calibrated.json -o out\n\n\
    A scene file says what differs from the default rig (plate 0.38 × 0.24 m,\n\
    steel ball):\n  \
    { \"duration_s\": 2, \"contact\": { \"friction\": 0.3 },\n    \
    \"qy\": [ { \"sine\": { \"amplitude_rad\": 0.1, \"frequency_hz\": 0.5 } } ] }\n\
    Beside sine there are constant_rad (a number) and smoothstep (to_rad, start_s,\n\
    duration_s); beside ball there is block (edge_m, mass_kg); pushes are\n\
    { \"force_n\": [0.05, 0], \"start_s\": 1, \"duration_s\": 0.1 }.\n\n\
    With --commands, the twin of a rig obeys what a session recorded: its servos\n\
    with dead time, lag and limits, then the ball, which starts at rest where it was\n\
    measured, on a plate without an edge. --step, 0.002 to 0.01 s, is the longest\n\
    step. trajectory.csv has a row for each sample, with the angles of the plate.\n\n\
    Exit status: 0 done, 1 the run failed or no model meets the tolerance, 2 bad\n\
    arguments, 3 unusable file.")]
pub struct SceneArgs {
    /// Name of a scene in --list, or a scene file
    #[arg(value_name = "NAME|FILE.json", required_unless_present_any = ["list", "commands"])]
    scene: Option<String>,
    /// List the named scenes
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    recorded: RecordedArgs,
    #[command(flatten)]
    how: ConfigurationArgs,
    /// Time between two samples, s [default: 0.01, or a 200th of the scene where
    /// that is shorter]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = decide::positive_number)]
    sample: Option<f64>,
    /// Write trajectory.csv and plots into this directory; created if missing
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// A table for people, or one JSON object; with --list one per line
    #[arg(long, value_enum, default_value = "table")]
    format: OutputFormat,
}

pub(super) fn run(args: &SceneArgs) -> anyhow::Result<()> {
    if let Some(session) = &args.recorded.commands {
        return recorded::run(args, session);
    }
    let Some(word) = args.scene.as_deref().filter(|_| !args.list) else {
        return catalogue::list(args.format);
    };
    match catalogue::find(word)? {
        Exercise::Laws { scenes, tolerance_m } => laws::run(args, &scenes, tolerance_m),
        Exercise::Control { impulse } => control::run(args, impulse),
        Exercise::Rig { bad_x } => rig::run(args, bad_x),
    }
}
