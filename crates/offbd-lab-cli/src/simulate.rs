//! `offbd simulate`: simulates a session of a rig, or a labelled corpus.

mod numbers;
mod options;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::corpus;
use super::labels::{Label, class, labelled};
use super::session::write_session;
use offbd_core::vocabulary::{Axis, Invalid, Sample};
use offbd_file_cli::calibrate::write_asset;
use offbd_file_cli::{judge, recordings};
use offbd_lab::simulation::{
    BallFault, Fault, Preset, Reference, RigModel, SensorFault, ServoFault, SimulatedRig,
    Transport, Variety,
};
use offbd_terminal::errors::BadArgument;
use offbd_terminal::output::{self, value_parser};
use options::{LineArgs, RigArgs, SensorArgs};

/// Simulates a session of a rig: PID control, servos, noise, faults.
///
/// Equal seeds give equal bytes. A fault is CODE:KIND[=SIZE]@START[-END] with
/// times in seconds.
#[derive(Clone, Debug, Args)]
#[command(allow_negative_numbers = true, after_help = help())]
pub struct SimulateArgs {
    /// Kind of rig: its servos, surface, sensor and controller
    #[arg(long, default_value = "chapter", conflicts_with = "rig_seed",
          value_parser = value_parser::<Preset>(Preset::ALL.map(Preset::as_str)))]
    preset: Preset,
    /// Ball, plate, angle limit and sample rate from this asset file
    #[arg(long, value_name = "ASSET.json")]
    asset: Option<PathBuf>,
    /// Reference motion of the ball
    #[arg(long, default_value = "steps",
          value_parser = value_parser::<Reference>(Reference::ALL.map(Reference::as_str)))]
    reference: Reference,
    /// Length of the session, s
    #[arg(long, default_value_t = 60.0, value_name = "S", value_parser = seconds)]
    seconds: f64,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A fault: CODE:KIND[=SIZE]@START[-END]; may be repeated
    #[arg(long, value_name = "FAULT")]
    fault: Vec<Fault>,
    /// File of the session; - is stdout
    #[arg(short, long, default_value = "-", value_name = "SESSION.csv")]
    output: PathBuf,
    /// Write the label of the session here, as in the labels of a corpus
    #[arg(long, value_name = "FILE.json")]
    truth: Option<PathBuf>,
    /// Write the rig's asset file, as its owner would describe it, here
    #[arg(long, value_name = "ASSET.json")]
    rig: Option<PathBuf>,
    /// Number the rows in a column `seq`
    #[arg(long)]
    seq: bool,
    /// Write a labelled corpus here instead: every preset, healthy and faulty
    #[arg(long, value_name = "DIR",
          conflicts_with_all = ["output", "truth", "fault", "rig", "RigArgs"])]
    corpus: Option<PathBuf>,
    #[command(flatten)]
    own: RigArgs,
    #[command(flatten)]
    sensor: SensorArgs,
    #[command(flatten)]
    line: LineArgs,
}

const EXAMPLES: &str = "\
    Examples:\n  \
    offbd simulate --rig rig.json --reference circle -o healthy.csv\n  \
    offbd simulate --fault y_servo:gain=0.5@20 --truth truth.json -o weak.csv\n  \
    offbd simulate --preset touch --fault sensor:freeze@15-25 -o frozen.csv\n  \
    offbd simulate --rig-seed 7 --seed 3 -o tuesday.csv\n  \
    offbd simulate --level-deg -0.8,1.2 --whole-degrees --hold-rows 3 -o real.csv\n  \
    offbd simulate --late 0.1 --duplicates 0.05 --gap 12-14 --seq -o bad-line.csv\n  \
    offbd simulate --corpus mycorpus && offbd score mycorpus";

/// Longest line of the list of faults.
const HELP_COLUMNS: usize = 78;

/// Returns the faults with their sizes, and examples.
fn help() -> String {
    let components = [
        ("x_servo, y_servo", ServoFault::usages()),
        ("stuck_ball", BallFault::usages()),
        ("sensor", SensorFault::usages()),
    ];
    let mut help = "Faults (sizes have defaults):".to_owned();
    for (component, faults) in components {
        let mut line = format!("\n  {component:<17}");
        for (i, fault) in faults.iter().enumerate() {
            let end = if i + 1 < faults.len() { "," } else { "" };
            if line.trim_start_matches('\n').len() + 1 + fault.len() + end.len() > HELP_COLUMNS {
                help += &line;
                line = format!("\n{:19}", "");
            }
            line += &format!(" {fault}{end}");
        }
        help += &line;
    }
    help + "\n\n" + EXAMPLES
}

/// Longest session, s; chosen: a day.
const MAX_SECONDS: f64 = 86_400.0;

/// Parses a duration in seconds, in (0, 86400].
pub fn seconds(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    let in_range = |v: &f64| *v > 0.0 && *v <= MAX_SECONDS;
    value.filter(in_range).ok_or_else(|| format!("not above 0 and at most {MAX_SECONDS} seconds"))
}

pub(super) fn run(args: &SimulateArgs) -> anyhow::Result<()> {
    if let Some(dir) = &args.corpus {
        return corpus::write(dir, args.seconds, args.seed);
    }
    let model = args.model()?;
    if let Some(path) = &args.rig {
        write_asset(&model.rig, path)?;
    }
    let name = model.rig.name.clone();
    args.check_fault_axes(&model)?;
    let disturbances = args.sensor.disturbances();
    let mut rig =
        SimulatedRig::new(model, args.reference, disturbances, args.seed).map_err(bad_argument)?;
    args.fault.iter().for_each(|fault| rig.inject(*fault));
    let samples = rig.record(args.seconds);
    let rows = args.transported(&samples)?;
    write_session(&args.output, &rows, args.seq)?;
    if let Some(path) = &args.truth {
        write_truth(path, &args.label(&rig, &name, rows.len()))?;
    }
    Ok(())
}

fn write_truth(path: &Path, label: &Label) -> anyhow::Result<()> {
    let mut out = output::create(path)?;
    serde_json::to_writer_pretty(&mut out, label)?;
    writeln!(out)?;
    Ok(out.flush()?)
}

/// Maps an invalid number on the command line to an error.
fn bad_argument(error: Invalid) -> anyhow::Error {
    offbd_terminal::errors::InputError::new("cannot simulate", error).into()
}

impl SimulateArgs {
    /// Returns the rig of this session.
    fn model(&self) -> anyhow::Result<RigModel> {
        let mut model = match self.own.rig_seed {
            Some(seed) => Variety::Real.rig(seed),
            None => self.preset.model(),
        }
        .map_err(bad_argument)?;
        if self.asset.is_some() {
            model = model.owned_as(judge::load_rig(self.asset.as_deref())?);
        }
        self.own.change(&mut model);
        self.sensor.change(&mut model.sensor);
        Ok(model.of_session(self.seed))
    }

    /// Checks that the rig has the axes of the faults.
    fn check_fault_axes(&self, model: &RigModel) -> Result<(), BadArgument> {
        let missing = |fault: &&Fault| fault.effect.axis() == Some(Axis::Y) && model.one_axis;
        self.fault.iter().find(missing).map_or(Ok(()), |fault| {
            Err(BadArgument(format!("--fault {fault}: the rig has one axis, x")))
        })
    }

    fn transported(&self, samples: &[Sample]) -> anyhow::Result<Vec<Sample>> {
        let mut line = Transport::new(self.line.faults(), self.seed).map_err(bad_argument)?;
        let mut rows = Vec::with_capacity(samples.len());
        samples.iter().for_each(|sample| line.send(*sample, &mut rows));
        line.finish(&mut rows);
        Ok(rows)
    }

    fn label(&self, rig: &SimulatedRig, name: &str, rows: usize) -> Label {
        let first = rig.faults().next();
        Label {
            file: recordings::session_name(&self.output),
            rig: name.to_owned(),
            motion: self.reference.to_string(),
            seconds: self.seconds,
            rows: rows as u64,
            class: class(first),
            also: Vec::new(),
            fault: first.map(labelled),
        }
    }
}
