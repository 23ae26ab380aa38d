//! Writes simulated sessions.

use std::io::Write as _;
use std::path::Path;

use offbd_core::vocabulary::Sample;
use offbd_terminal::output;
use offbd_wire::session_csv;

/// Writes a session, with the column `seq` if `seq` is true.
pub(super) fn write_session(path: &Path, samples: &[Sample], seq: bool) -> anyhow::Result<()> {
    let mut out = output::create(path)?;
    let unnumbered = |s: &Sample| Sample { seq: s.seq.filter(|_| seq), ..*s };
    session_csv::write(&mut out, &samples.iter().map(unnumbered).collect::<Vec<_>>())?;
    Ok(out.flush()?)
}
