use std::io;
use std::path::PathBuf;

/// An error of making a chart.
#[derive(Debug, thiserror::Error)]
pub enum ChartError {
    /// The drawing could not be rasterised.
    #[error("cannot rasterise the drawing: {0}")]
    Raster(String),
    /// The records could not be written as JSON; for example, a number is not finite.
    #[error("cannot write the records: {0}")]
    Records(#[from] serde_json::Error),
    /// A scene or rig is invalid.
    #[error("{0}")]
    Scene(#[from] offbd_core::vocabulary::Invalid),
    /// A simulated rig could not be calibrated.
    #[error("{0}")]
    Rig(#[from] offbd_core::engine::CannotCalibrate),
    /// The records of other engines could not be read.
    #[error("{}: {reason}", path.display())]
    Peers { path: PathBuf, reason: String },
    /// A file could not be written.
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
}
