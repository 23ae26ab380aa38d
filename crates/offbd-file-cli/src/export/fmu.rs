//! `offbd export fmu`: the digital twin of a rig as an FMU.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::judge;
use offbd_terminal::errors::{InputError, read};
use offbd_terminal::output::{self, NewFile};
use offbd_wire::fmu::{FmiVersion, FmuPlatform, archive};

/// Writes the digital twin of a rig as an FMU, for other simulators.
///
/// An FMU (co-simulation by FMI 3.0 or 2.0) runs in other simulators. Its inputs are the
/// commands of both servos in rad; its outputs are the position and velocity of the ball
/// and the angles of the plate. The parameters start with the values of the asset file,
/// calibrated if it is; those of the servos can be changed while the FMU runs, to inject
/// a fault.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    cargo build --release --package offbd-fmu\n  \
    offbd export fmu --asset calibrated.json -o ball_on_plate.fmu\n  \
    offbd export fmu --fmi 2.0 -o ball_on_plate.fmu\n  \
    offbd export fmu --library liboffbd_fmu.so --library offbd_fmu.dll -o both.fmu\n\n\
    An FMU holds a shared library for each platform on which it runs. The library\n\
    for this platform is found beside the program, where cargo builds it, or where\n\
    a release installs it.")]
pub(crate) struct FmuArgs {
    /// The version of FMI: 3.0, or 2.0, which more simulators read
    #[arg(long, value_name = "VERSION", default_value_t = FmiVersion::V3)]
    fmi: FmiVersion,
    /// The rig's asset file [default: the default rig (plate 0.38 × 0.24 m, steel ball)]
    #[arg(long, value_name = "ASSET.json")]
    asset: Option<PathBuf>,
    /// The shared library of a platform; can be repeated [default: the one beside this
    /// program]
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,
    /// The file to write, replaced once it is complete; - is stdout
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

pub(super) fn run(args: &FmuArgs) -> anyhow::Result<()> {
    let rig = judge::load_rig(args.asset.as_deref())?;
    let name = rig.name.clone();
    let setup = judge::set_up(rig, None)?;
    let own = if args.library.is_empty() { vec![own_library()?] } else { Vec::new() };
    let libraries: Result<Vec<_>, InputError> =
        args.library.iter().chain(&own).map(|path| library(path)).collect();
    let fmu =
        archive(&setup, args.fmi, &libraries?).map_err(|error| InputError::new(name, error))?;
    if args.output == Path::new("-") {
        let mut out = output::stdout();
        out.write_all(&fmu)?;
        return Ok(out.flush()?);
    }
    let mut file = NewFile::create(&args.output)?;
    file.write_all(&fmu)?;
    file.keep()
}

/// Returns the path of the library that was built or installed with this program.
fn own_library() -> anyhow::Result<PathBuf> {
    let name = format!("{DLL_PREFIX}offbd_fmu{DLL_SUFFIX}");
    let program = std::env::current_exe()?;
    let installed = program.with_file_name("../lib/offbd").join(&name);
    let built = program.with_file_name(name);
    let found = [&built, &installed].into_iter().find(|path| path.is_file());
    let reason = "is missing, the library of the twin: build it with `cargo build --release \
                  --package offbd-fmu`, and name it with --library, unless it is beside offbd";
    found.cloned().ok_or_else(|| InputError::file(&built, reason).into())
}

fn library(path: &Path) -> Result<(FmuPlatform, Vec<u8>), InputError> {
    let bytes = read(path)?;
    let platform = FmuPlatform::of_library(&bytes).ok_or_else(|| {
        let reason = "is not a shared library of Linux, macOS or Windows for x86_64 or aarch64";
        InputError::file(path, reason)
    })?;
    Ok((platform, bytes))
}
