use std::io;
use std::path::PathBuf;

/// Why a chart could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ChartError {
    /// The drawing could not be laid out, a panel too small for its labels say.
    #[error("cannot draw {figure}: {reason}")]
    Draw { figure: String, reason: String },
    /// The drawing could not be made into pixels.
    #[error("cannot rasterise the drawing: {0}")]
    Raster(String),
    /// The records are no JSON, a number that is not finite say.
    #[error("cannot write the records: {0}")]
    Records(#[from] serde_json::Error),
    /// A scene cannot be.
    #[error("{0}")]
    Scene(#[from] offbd_core::vocabulary::Invalid),
    /// A simulated rig cannot be learnt.
    #[error("{0}")]
    Rig(#[from] offbd_core::engine::CannotCalibrate),
    /// Somebody else's records could not be read.
    #[error("{}: {reason}", path.display())]
    Peers { path: PathBuf, reason: String },
    /// A file could not be written.
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
}
