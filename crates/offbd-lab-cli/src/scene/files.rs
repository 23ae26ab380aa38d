//! The files of a scene: trajectories as CSV, drawings as SVG and PNG.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;

use super::scene_run::Sampled;
use offbd_core::engine::{FreeRunPoint, Rig};
use offbd_core::vocabulary::Sample;
use offbd_file_cli::calibrate::write_asset;
use offbd_lab::chart::{Figure, png, svg};
use offbd_terminal::output;
use offbd_wire::session_csv;

/// The header of a trajectory, plate frame.
const HEADER: &str = "t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s";

/// The header of the twin's trajectory under recorded commands, plate frame.
const FREE_RUN_HEADER: &str = "t_s,x_m,y_m,vx_m_s,vy_m_s,qx_rad,qy_rad";

/// The directory of the files; the name of each file is printed to stderr.
pub(super) struct OutputFolder(PathBuf);

impl OutputFolder {
    /// Creates the directory `dir` if it is missing; returns `None` if none is requested.
    pub(super) fn new(dir: Option<&Path>) -> anyhow::Result<Option<Self>> {
        let Some(dir) = dir else { return Ok(None) };
        std::fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        Ok(Some(Self(dir.to_owned())))
    }

    /// Returns the path of a file, and prints it.
    fn announced(&self, name: &str) -> PathBuf {
        let path = self.0.join(name);
        output::remark(format_args!("{}", path.display()));
        path
    }

    /// Writes a trajectory, with all digits that are needed to read the same numbers back.
    pub(super) fn trajectory(&self, name: &str, samples: &[Sampled]) -> anyhow::Result<()> {
        self.rows(name, HEADER, samples.iter().map(|(t, at)| (*t, at.to_row())))
    }

    /// Writes the motion of ball and plate of a twin to `trajectory.csv`, likewise.
    pub(super) fn free_run(&self, points: &[FreeRunPoint]) -> anyhow::Result<()> {
        let row = |point: &FreeRunPoint| {
            let FreeRunPoint { at, ball, plate, .. } = point;
            let (p, v) = (ball.position, ball.velocity);
            // The x servo turns qy, the y servo qx.
            (at.seconds(), [p.x, p.y, v.x, v.y, plate.y, plate.x])
        };
        self.rows("trajectory.csv", FREE_RUN_HEADER, points.iter().map(row))
    }

    /// Writes a table of numbers over time, s.
    fn rows<const N: usize>(
        &self,
        name: &str,
        header: &str,
        rows: impl Iterator<Item = (f64, [f64; N])>,
    ) -> anyhow::Result<()> {
        let mut out = output::create(&self.announced(name))?;
        writeln!(out, "{header}")?;
        for (t, row) in rows {
            write!(out, "{t}")?;
            for value in row {
                // Adding zero turns −0 into 0.
                write!(out, ",{}", value + 0.0)?;
            }
            writeln!(out)?;
        }
        Ok(out.flush()?)
    }

    /// Writes the session that a device would have recorded, for `offbd replay`.
    pub(super) fn session(&self, samples: &[Sample]) -> anyhow::Result<()> {
        let mut out = output::create(&self.announced("session.csv"))?;
        session_csv::write(&mut out, samples)?;
        Ok(out.flush()?)
    }

    /// Writes the asset file of a rig, for `offbd replay --asset`.
    pub(super) fn asset(&self, rig: &Rig) -> anyhow::Result<()> {
        write_asset(rig, &self.announced("asset.json"))
    }

    pub(super) fn figure(&self, name: &str, figure: &Figure) -> anyhow::Result<()> {
        let drawing = svg(figure);
        put(&self.announced(&format!("{name}.svg")), drawing.as_bytes())?;
        put(&self.announced(&format!("{name}.png")), &png(&drawing)?)
    }
}

fn put(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}
