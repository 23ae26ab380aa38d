//! The session file as it is written: CSV with the columns `t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m`, and
//! optionally `seq`. An empty field is a missing value. It is read as any table of text is
//! (`table.rs`), in which the columns may have any order, and there may be others.

use std::io::{self, Write};

use offbd_core::vocabulary::Sample;

/// The columns of a session file, in the order in which they are written.
pub const COLUMNS: [&str; 5] = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"];

/// Writes samples with a header, and with the column `seq` if any sample has one. Numbers
/// are written such that reading them returns the same bits.
///
/// # Errors
/// [`io::Error`] if `sink` fails.
pub fn write<W: Write>(mut sink: W, samples: &[Sample]) -> io::Result<()> {
    let with_seq = samples.iter().any(|s| s.seq.is_some());
    write_header(&mut sink, with_seq)?;
    write_rows(&mut sink, samples, with_seq)
}

/// Writes only the header.
///
/// # Errors
/// [`io::Error`] if `sink` fails.
pub fn write_header<W: Write>(mut sink: W, with_seq: bool) -> io::Result<()> {
    if with_seq {
        write!(sink, "seq,")?;
    }
    writeln!(sink, "{}", COLUMNS.join(","))
}

/// Writes only the rows.
///
/// # Errors
/// [`io::Error`] if `sink` fails.
pub fn write_rows<W: Write>(mut sink: W, samples: &[Sample], with_seq: bool) -> io::Result<()> {
    for sample in samples {
        if with_seq {
            write!(sink, "{},", sample.seq.map(|s| s.to_string()).unwrap_or_default())?;
        }
        write!(sink, "{}", sample.t_s)?;
        for value in [sample.cmd_qx_rad, sample.cmd_qy_rad, sample.x_m, sample.y_m] {
            match value {
                Some(value) => write!(sink, ",{value}")?,
                None => write!(sink, ",")?,
            }
        }
        writeln!(sink)?;
    }
    Ok(())
}
