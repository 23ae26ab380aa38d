//! The twin of a rig under the commands of a recorded session.

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Vector2;
use serde_json::{Value, json};

use super::SceneArgs;
use super::files::OutputFolder;
use super::{plots, report, words};
use offbd_core::engine::{FreeRunPoint, free_run};
use offbd_core::plant::SimulatedTwin;
use offbd_core::vocabulary::{Axis, in_range};
use offbd_file_cli::recordings::Recording;
use offbd_file_cli::{calibrate, judge, recordings};
use offbd_lab::chart::Figure;
use offbd_terminal::errors::{BadArgument, InputError};
use offbd_terminal::output::{self, OutputFormat};
use offbd_wire::table::TableOptions;

/// The session whose commands drive the twin.
#[derive(Clone, Debug, Args)]
pub(super) struct RecordedArgs {
    /// Instead of a scene, run the twin of a rig under the commands of this session
    #[arg(long, value_name = "SESSION.csv",
          conflicts_with_all = ["scene", "list", "model", "method", "tolerance", "sample"])]
    pub commands: Option<PathBuf>,
    /// The rig's asset file, for --commands [default: the default rig (plate
    /// 0.38 × 0.24 m, steel ball)]
    #[arg(long, value_name = "ASSET.json", requires = "commands", conflicts_with_all = ["scene", "list"])]
    asset: Option<PathBuf>,
}

/// A free run of the twin.
struct RecordedRun {
    session: String,
    rig: String,
    step_s: f64,
    points: Vec<FreeRunPoint>,
    end: FreeRunPoint,
    /// Largest distance from the measured position, m, and its time, s.
    apart: Option<(f64, f64)>,
    /// When the ball leaves the plate, s. The twin has no edge: it goes on as if the plate did.
    leaves_s: Option<f64>,
}

/// Runs the twin under the commands of the session at `path`.
pub(super) fn run(args: &SceneArgs, path: &Path) -> anyhow::Result<()> {
    let run = RecordedRun::of(args, path)?;
    if let Some(folder) = OutputFolder::new(args.output.as_deref())? {
        folder.free_run(&run.points)?;
        folder.figure("position", &run.figure())?;
    }
    match args.format {
        OutputFormat::Table => output::print_line(&run.lines().join("\n")),
        OutputFormat::Json => output::print_line(&run.object().to_string()),
    }
}

impl RecordedRun {
    fn of(args: &SceneArgs, path: &Path) -> anyhow::Result<Self> {
        let step_s = args.how.step.unwrap_or(*SimulatedTwin::STEPS_S.start());
        in_range("--step", step_s, SimulatedTwin::STEPS_S)
            .map_err(|e| BadArgument(e.to_string()))?;
        let setup = judge::set_up(judge::load_rig(args.recorded.asset.as_deref())?, None)?;
        let samples = calibrate::load(&[Recording::of(path)], &TableOptions::default())?.concat();
        let points = free_run(&setup, &samples, step_s).map_err(|e| InputError::file(path, e))?;
        let Some(&end) = points.last() else {
            return Err(InputError::file(path, "has no usable sample").into());
        };
        let apart = points.iter().filter_map(|p| Some((distance_m(p)?, p.at.seconds())));
        let apart = apart.max_by(|a, b| a.0.total_cmp(&b.0));
        let plate = setup.rig.plate;
        let on_plate =
            |p: &&FreeRunPoint| plate.edge_distance_m(p.ball.position.x, p.ball.position.y) >= 0.0;
        let leaves_s = points.iter().find(|p| !on_plate(p)).map(|p| p.at.seconds());
        let session = recordings::session_name(path);
        Ok(Self { session, rig: setup.rig.name, step_s, points, end, apart, leaves_s })
    }

    fn duration_s(&self) -> f64 {
        self.end.at - self.points[0].at
    }

    fn lines(&self) -> Vec<String> {
        let (duration_s, n) = (self.duration_s(), self.points.len());
        let [x, y] = self.end.ball.position.into();
        let apart = self.apart.map_or_else(
            || "no position was measured".to_owned(),
            |(far, at)| format!("up to {far:.4} m from the measured position, at {at:.2} s"),
        );
        let ran = format!(
            "the twin of {}: its servos under the recorded commands, and a ball that starts at \
             rest where it was measured; steps of at most {} s",
            self.rig,
            words::plain(self.step_s)
        );
        let leaves = self.leaves_s.map_or_else(
            || "the ball stays on the plate".to_owned(),
            |at| {
                format!(
                    "the ball leaves the plate at {at:.2} s; the twin has no edge and goes on as \
                     if the plate did. The plot ends there"
                )
            },
        );
        vec![
            report::row("commands", &format!("{}, {n} samples, {duration_s:.2} s", self.session)),
            report::row("plate", &leaves),
            report::row("end", &format!("x {x:.6}, y {y:.6} m")),
            report::row("apart", &apart),
            String::new(),
            report::row("ran", &ran),
        ]
    }

    fn object(&self) -> Value {
        let (ball, plate) = (&self.end.ball, &self.end.plate);
        json!({
            "commands": self.session,
            "asset": self.rig,
            "samples": self.points.len(),
            "duration_s": self.duration_s(),
            "step_s": self.step_s,
            "end": {
                "position_m": [ball.position.x, ball.position.y],
                "velocity_m_s": [ball.velocity.x, ball.velocity.y],
                // The x servo turns qy, the y servo qx.
                "qx_rad": plate.y,
                "qy_rad": plate.x,
            },
            "leaves_plate_s": self.leaves_s,
            "farthest_from_measured_m": self.apart.map(|apart| apart.0),
            "farthest_from_measured_s": self.apart.map(|apart| apart.1),
        })
    }

    /// The points up to the one at which the ball leaves the plate.
    fn points_on_plate(&self) -> &[FreeRunPoint] {
        let beyond = |p: &FreeRunPoint| self.leaves_s.is_some_and(|s| p.at.seconds() > s);
        let n = self.points.iter().position(beyond).unwrap_or(self.points.len());
        &self.points[..n]
    }

    /// Draws the twin's x and y beside the measured ones, over the time from the first sample.
    fn figure(&self) -> Figure {
        let (start, points) = (self.points[0].at, self.points_on_plate());
        let mut series = Vec::new();
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            let twin = points.iter().map(|p| (p.at - start, p.ball.position[i])).collect();
            series.push(plots::line(&format!("{}, twin", axis.as_str()), 2 * i, twin));
            let seen = points.iter().filter_map(|p| Some((p.at - start, p.measured[axis]?)));
            let seen: Vec<(f64, f64)> = seen.collect();
            if !seen.is_empty() {
                series.push(plots::line(&format!("{}, measured", axis.as_str()), 2 * i + 1, seen));
            }
        }
        let duration_s = points.last().map_or(0.0, |last| last.at - start);
        let panel = plots::time_panel("position on the plate (m)", duration_s, series);
        let title = format!("{}: position over time", self.session);
        let subtitle = format!("The twin of {} under the recorded commands.", self.rig);
        plots::figure(title, subtitle, 1, vec![panel])
    }
}

/// Distance of the twin's ball from the measured one, m.
fn distance_m(point: &FreeRunPoint) -> Option<f64> {
    let (x, y) = (point.measured.x?, point.measured.y?);
    Some((point.ball.position - Vector2::new(x, y)).norm())
}
