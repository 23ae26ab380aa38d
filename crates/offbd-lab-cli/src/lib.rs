//! The commands of the laboratory: simulated rigs, scenes, charts, and scores of the
//! diagnosis against labels.

mod chart;
mod corpus;
mod labels;
mod scene;
mod score;
mod session;
pub mod simulate;
mod soak;

use clap::Subcommand;

#[derive(Debug, Subcommand)]
/// A command of the laboratory.
pub enum LabCommand {
    Simulate(Box<simulate::SimulateArgs>),
    Score(score::ScoreArgs),
    Soak(soak::SoakArgs),
    Scene(scene::SceneArgs),
    Chart(chart::ChartArgs),
}

impl LabCommand {
    /// Runs the command.
    ///
    /// # Errors
    /// What the command reports, for its exit code.
    pub fn run(self) -> anyhow::Result<()> {
        match self {
            Self::Simulate(args) => simulate::run(&args),
            Self::Score(args) => score::run(&args),
            Self::Soak(args) => soak::run(&args),
            Self::Scene(args) => scene::run(&args),
            Self::Chart(args) => chart::run(&args),
        }
    }
}
