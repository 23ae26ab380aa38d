//! The commands of the laboratory: simulated rigs, scenes, charts, and scores of the
//! diagnosis against labels.

mod chart;
mod corpus;
mod demo;
mod labels;
mod scene;
mod score;
mod simulate;
mod soak;

use clap::Subcommand;

#[derive(Debug, Subcommand)]
pub(super) enum LabCommand {
    Simulate(Box<simulate::SimulateArgs>),
    Score(score::ScoreArgs),
    Soak(soak::SoakArgs),
    Scene(scene::SceneArgs),
    Chart(chart::ChartArgs),
    Demo(demo::DemoArgs),
}

impl LabCommand {
    /// Returns the default log level: the service inside the demo logs warnings and errors
    /// only.
    pub(super) fn log_level(&self) -> Option<&'static str> {
        matches!(self, Self::Demo(_)).then_some("warn")
    }

    pub(super) fn run(self) -> anyhow::Result<()> {
        match self {
            Self::Simulate(args) => simulate::run(&args),
            Self::Score(args) => score::run(&args),
            Self::Soak(args) => soak::run(&args),
            Self::Scene(args) => scene::run(&args),
            Self::Chart(args) => chart::run(&args),
            Self::Demo(args) => demo::run(&args),
        }
    }
}
