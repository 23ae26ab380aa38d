//! `offbd chart`: measures, draws, and stores the records.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use offbd_lab::chart::work_precision::{self, ChartedScene, Peers};
use offbd_lab::chart::{self, Chart, ChartError, Effort};
use offbd_scene_file as scene;
use offbd_terminal::errors::InputError;
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;

/// Measures a trade-off on this machine: SVG, PNG and the records as JSON.
///
/// Writes a short table or the records to stdout, and the names of the files to stderr. Costs are
/// CPU times: keep the machine idle meanwhile.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd chart work-precision\n  \
    offbd chart work-precision --with peers.json\n  \
    offbd chart estimators -o measured --quick\n  \
    offbd chart stability --format json | jq .\n  \
    offbd chart detectors")]
pub struct ChartArgs {
    /// Which chart
    #[arg(value_enum)]
    name: ChartName,
    /// Directory of the files; created if missing
    #[arg(short, long, value_name = "DIR", default_value = "charts")]
    output: PathBuf,
    /// Records of other engines to draw as well, for work-precision
    #[arg(long, value_name = "FILE")]
    with: Vec<PathBuf>,
    /// Measure a few points only
    #[arg(long)]
    quick: bool,
    /// A table for people, or the records, one JSON object per line
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum ChartName {
    /// Acceleration estimators: error against delay and cost
    Estimators,
    /// Models and methods: error against CPU time per simulated second
    WorkPrecision,
    /// Models: error over the plate's motion, and the automatic choice
    Fidelity,
    /// Methods: largest stable step, measured and predicted
    Stability,
    /// Detectors of servo faults: delay against false alarms
    Detectors,
    /// Calibrations: false alarms and delays, predicted and observed
    Certificate,
}

impl ChartName {
    fn make(self, effort: Effort, with: &[PathBuf]) -> Result<Chart, ChartError> {
        match self {
            Self::Estimators => chart::estimators::make(effort),
            Self::WorkPrecision => {
                let mut peers = Peers::default();
                for path in with {
                    let more = work_precision::read(path)?;
                    peers.records.extend(more.records);
                    peers.versions.extend(more.versions);
                }
                work_precision::make(effort, charted()?, &peers)
            }
            Self::Fidelity => chart::fidelity::make(effort),
            Self::Stability => chart::stability::make(effort),
            Self::Detectors => chart::detectors::make(effort),
            Self::Certificate => chart::certificate::make(effort),
        }
    }
}

pub(super) fn run(args: &ChartArgs) -> anyhow::Result<()> {
    let effort = if args.quick { Effort::Quick } else { Effort::Full };
    let chart = args.name.make(effort, &args.with).map_err(unusable)?;
    let written = chart::write(&chart, &args.output)?;
    match args.format {
        OutputFormat::Table => write_table(&chart.table)?,
        OutputFormat::Json => chart.records.iter().try_for_each(output::print_json)?,
    }
    for path in written {
        output::remark(format_args!("{}", path.display()));
    }
    Ok(())
}

/// Maps unreadable records to unusable input.
fn unusable(error: ChartError) -> anyhow::Error {
    match error {
        ChartError::Peers { path, reason } => InputError::file(&path, reason).into(),
        other => other.into(),
    }
}

fn write_table(rows: &chart::ChartTable) -> anyhow::Result<()> {
    let mut out = output::stdout();
    let mut table = table::table(&rows.heading, &rows.right);
    for row in &rows.rows {
        table.add_row(row);
    }
    for line in table::lines(&table) {
        writeln!(out, "{line}")?;
    }
    Ok(out.flush()?)
}

macro_rules! scene {
    ($name:literal) => {
        include_str!(concat!("../scenes/", $name, ".json"))
    };
}

/// The scenes of the work–precision chart: a constant slope, a sine, and a plate that
/// turns so steep that the ball slips, flies and lands; each on a hard and a soft contact.
const CHARTED: [&str; 6] = [
    scene!("slope"),
    scene!("sine"),
    scene!("steep"),
    scene!("slope-soft"),
    scene!("sine-soft"),
    scene!("steep-soft"),
];

fn charted() -> Result<Vec<ChartedScene>, ChartError> {
    let parsed = CHARTED.iter().map(|file| scene::parse(file.as_bytes()));
    Ok(parsed
        .map(|named| named.map(|n| ChartedScene { name: n.name, scene: n.scene, laws: n.laws }))
        .collect::<Result<_, _>>()?)
}
