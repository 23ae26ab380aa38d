//! `offbd export --trace`: what a recorded session is judged by, as a table.

use std::io::Write;
use std::path::Path;

use super::{BadArgument, InputError, NewFile, TableOptions, recordings};
use offbd_core::engine::Setup;
use offbd_wire::judging::RecordedSession;
use offbd_wire::session_file::{SessionFormat, SessionInfo, SessionRowError, TraceWriter};
use offbd_wire::trace::{TracePoint, TraceView};

/// Moments that are written at a time.
const BLOCK_POINTS: usize = 8192;

/// Returns the format of `file` by its suffix.
pub(super) fn format(file: &Path) -> Result<SessionFormat, BadArgument> {
    let suffix = file.extension().and_then(|suffix| suffix.to_str());
    let format = TraceWriter::FORMATS.into_iter().find(|f| Some(f.suffix()) == suffix);
    let format = format.ok_or_else(|| {
        let formats = TraceWriter::FORMATS.map(SessionFormat::suffix).join(" or ");
        BadArgument(format!("{}: the suffix of a trace is {formats}", file.display()))
    })?;
    format.check().map_err(|e| BadArgument(e.to_string()))?;
    Ok(format)
}

/// Writes every judged moment of the session into `file`.
pub(super) fn write(
    setup: &Setup,
    (path, table): (&Path, &TableOptions),
    info: &SessionInfo,
    file: &Path,
) -> anyhow::Result<()> {
    let mut session = RecordedSession::new(setup.clone(), info.session.clone());
    let mut out = TraceFile {
        writer: TraceWriter::new(format(file)?, info, &session.thresholds())?,
        file: NewFile::create(file)?,
        block: TraceView::default(),
        last_t_s: None,
    };
    let mut rows = recordings::open(path, table)?;
    while let Some(row) = rows.next() {
        match row {
            Ok(sample) => session.sample(sample, || rows.place(), |_| {}),
            Err(SessionRowError::Rejected(_)) => continue,
            Err(error) => return Err(InputError::file(path, error).into()),
        }
        if let Some(point) = TracePoint::of(&session.state()) {
            out.push(&point)?;
        }
    }
    out.end()
}

/// A table that is being written.
struct TraceFile {
    writer: TraceWriter,
    file: NewFile,
    block: TraceView,
    /// Time of the last moment.
    last_t_s: Option<f64>,
}

impl TraceFile {
    /// Appends a moment that is later than the last one: after a row that is not judged, the
    /// engine's state is still that of the row before.
    fn push(&mut self, point: &TracePoint) -> anyhow::Result<()> {
        if self.last_t_s.is_some_and(|last| point.t_s() <= last) {
            return Ok(());
        }
        self.last_t_s = Some(point.t_s());
        self.block.push(point);
        if self.block.t_s.len() == BLOCK_POINTS {
            let bytes = self.writer.rows(&std::mem::take(&mut self.block))?;
            self.file.write_all(&bytes)?;
        }
        Ok(())
    }

    fn end(mut self) -> anyhow::Result<()> {
        let last = self.writer.rows(&self.block)?;
        self.file.write_all(&last)?;
        self.file.write_all(&self.writer.end()?)?;
        self.file.keep()
    }
}
