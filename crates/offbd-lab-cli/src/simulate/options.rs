//! Options that replace properties of a preset's rig, sensor and transport.

use clap::Args;

use super::numbers::{pair, radians, span, step, within};
use offbd_core::vocabulary::{Axis, PerAxis};
use offbd_lab::simulation::{Disturbances, Refresh, RigModel, SensorModel, TransportFaults};

/// One degree, rad.
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Limit of the level, degrees; chosen: no table is worse.
const LEVEL_DEG: f64 = 10.0;
/// Limit of its standard deviation between sessions, degrees. Chosen so that the largest
/// level plus three deviations can be simulated.
const LEVEL_SD_DEG: f64 = 5.0;
/// Range of the plate angle per command; chosen: a negative gain is a fault.
const GAIN: [f64; 2] = [0.05, 5.0];
/// Limit of the breakaway tilt, degrees; chosen: beyond it the ball lies in a hole.
const BREAKAWAY_DEG: f64 = 10.0;
/// Lowest log rate, rows per second; chosen. The highest one is the simulation's.
const LEAST_RATE_HZ: f64 = 1.0;
/// Limit of pushes or gusts per minute; chosen: one push of 0.1 s after the other.
const MOST_PER_MINUTE: f64 = 600.0;

/// Properties of the rig.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Rig and session [default: the preset's]")]
pub(super) struct RigArgs {
    /// A rig drawn at random within the ranges of real rigs, as `soak` does it;
    /// --seed then draws the session's level and gain too
    #[arg(long, value_name = "N")]
    pub rig_seed: Option<u64>,
    /// Plate angle at a command of zero, degrees; one number applies to both axes
    #[arg(long, value_name = "X[,Y]", allow_hyphen_values = true,
          value_parser = pair(-LEVEL_DEG..=LEVEL_DEG))]
    level_deg: Option<PerAxis<f64>>,
    /// Standard deviation of the level between sessions with different --seed
    #[arg(long, value_name = "DEG", value_parser = within(0.0..=LEVEL_SD_DEG))]
    level_sd_deg: Option<f64>,
    /// Plate angle per command
    #[arg(long, value_name = "X[,Y]", value_parser = pair(GAIN[0]..=GAIN[1]))]
    gain: Option<PerAxis<f64>>,
    /// Stiction: tilt at which a ball at rest starts, degrees
    #[arg(long, value_name = "DEG", value_parser = within(0.0..=BREAKAWAY_DEG))]
    breakaway_deg: Option<f64>,
    /// Servos with a resolution of one degree
    #[arg(long)]
    whole_degrees: bool,
    /// Ball and beam: neither commands nor positions along y
    #[arg(long)]
    one_axis: bool,
    /// Rows of the log per second
    #[arg(long, value_name = "HZ",
          value_parser = within(LEAST_RATE_HZ..=RigModel::MAX_LOG_HZ))]
    rate_hz: Option<f64>,
}

/// Properties of the rig's sensor and surroundings.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Sensor and surroundings [default: the preset's]")]
pub(super) struct SensorArgs {
    /// Standard deviation of a reading, m
    #[arg(long, value_name = "M", value_parser = within(SensorModel::LENGTH_M))]
    noise_m: Option<f64>,
    /// Quantisation: step of the readings (pixel, count), m
    #[arg(long, value_name = "M", value_parser = step(*SensorModel::LENGTH_M.end()))]
    quantum_m: Option<f64>,
    /// Dead band: a reading closer to the last than this repeats it, m
    #[arg(long, value_name = "M", value_parser = within(SensorModel::LENGTH_M))]
    dead_band_m: Option<f64>,
    /// Reading of a ball at the plate's centre, m
    #[arg(long, value_name = "X[,Y]", allow_hyphen_values = true,
          value_parser = pair(SensorModel::ORIGIN_M))]
    origin_m: Option<PerAxis<f64>>,
    /// New readings per second; rows in between repeat the last one
    #[arg(long, value_name = "HZ", value_parser = within(Refresh::HZ))]
    refresh_hz: Option<f64>,
    /// A new reading with every Nth row; the others repeat the last one
    #[arg(long, value_name = "N", conflicts_with = "refresh_hz",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(Refresh::MAX_ROWS)))]
    hold_rows: Option<u32>,
    /// Standard deviation of the log's period as a share of it
    #[arg(long, value_name = "SHARE", value_parser = within(0.0..=1.0))]
    jitter: Option<f64>,
    /// Share of readings without a ball
    #[arg(long, value_name = "SHARE", value_parser = within(0.0..=1.0))]
    missing: Option<f64>,
    /// Share of readings that are outliers
    #[arg(long, value_name = "SHARE", value_parser = within(0.0..=1.0))]
    outliers: Option<f64>,
    /// Pushes of the ball by hand, per minute
    #[arg(long, value_name = "N", default_value_t = 0.0,
          value_parser = within(0.0..=MOST_PER_MINUTE))]
    pushes: f64,
    /// Gusts of one to three seconds, per minute
    #[arg(long, value_name = "N", default_value_t = 0.0,
          value_parser = within(0.0..=MOST_PER_MINUTE))]
    gusts: f64,
}

/// Transport faults.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Transport")]
pub(super) struct LineArgs {
    /// Share of rows sent twice
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0..=1.0))]
    duplicates: f64,
    /// Share of rows delayed, so that they arrive out of order
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0..=1.0))]
    late: f64,
    /// Maximum delay of a row, s
    #[arg(long, value_name = "S", default_value_t = 0.05,
          value_parser = within(TransportFaults::WINDOW_S))]
    late_window_s: f64,
    /// Share of rows lost
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0..=1.0))]
    lost: f64,
    /// An interval in which every row is lost, s; may be repeated
    #[arg(long, value_name = "FROM-TO", value_parser = span)]
    gap: Vec<(f64, f64)>,
}

/// Sets a value if one is given.
fn set<T: Copy>(to: &mut T, from: Option<T>) {
    *to = from.unwrap_or(*to);
}

impl RigArgs {
    pub(super) fn change(&self, model: &mut RigModel) {
        set(&mut model.rig.sample_rate_hz, self.rate_hz);
        set(&mut model.spread.level_rad, self.level_sd_deg.map(f64::to_radians));
        let level_rad = self.level_deg.map(radians);
        for axis in Axis::ALL {
            set(&mut model.servos[axis].level_rad, level_rad.map(|level| level[axis]));
            set(&mut model.servos[axis].gain, self.gain.map(|gain| gain[axis]));
        }
        set(&mut model.surface.breakaway_rad, self.breakaway_deg.map(f64::to_radians));
        // Rolling resistance is at most the stiction.
        model.surface.rolling_rad = model.surface.rolling_rad.min(model.surface.breakaway_rad);
        set(&mut model.controller.resolution_rad, self.whole_degrees.then_some(DEGREE));
        model.one_axis |= self.one_axis;
    }
}

impl SensorArgs {
    pub(super) fn change(&self, sensor: &mut SensorModel) {
        set(&mut sensor.noise_m, self.noise_m);
        set(&mut sensor.quantum_m, self.quantum_m);
        set(&mut sensor.dead_band_m, self.dead_band_m);
        set(&mut sensor.origin_m, self.origin_m);
        set(&mut sensor.jitter, self.jitter);
        set(&mut sensor.missing, self.missing);
        set(&mut sensor.outliers, self.outliers);
        let refresh = self.refresh_hz.map(Refresh::Hz);
        set(&mut sensor.refresh, refresh.or(self.hold_rows.map(Refresh::Rows)));
    }

    pub(super) const fn disturbances(&self) -> Disturbances {
        Disturbances { pushes_per_minute: self.pushes, gusts_per_minute: self.gusts }
    }
}

impl LineArgs {
    pub(super) fn faults(&self) -> TransportFaults {
        let Self { duplicates, late, late_window_s, lost, ref gap } = *self;
        let gaps = gap.clone();
        TransportFaults { duplicates, late, window_s: late_window_s, lost, gaps }
    }
}
