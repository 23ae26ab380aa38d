//! What the rig, its sensor and the line from it are like, instead of the preset's.

use clap::Args;

use super::numbers::{pair, radians, span, step, within};
use offbd_core::vocabulary::{Axis, PerAxis};
use offbd_lab::simulation::{Disturbances, Refresh, RigModel, SensorModel, TransportFaults};

/// One degree, rad.
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Levels, and their spread between sessions, degrees: no table is worse, and three
/// deviations beyond the largest level are still one that can be simulated.
const LEVEL_DEG: f64 = 10.0;
const LEVEL_SD_DEG: f64 = 5.0;
/// Plate angle per command; a plate that turns against it is a fault.
const GAIN: [f64; 2] = [0.05, 5.0];
/// Breakaway tilts, degrees: beyond that a ball lies in a hole.
const BREAKAWAY_DEG: f64 = 10.0;
/// Slowest log, rows per second; the fastest is the simulation's.
const LEAST_RATE_HZ: f64 = 1.0;
/// Most hands or gusts a minute: one after the other.
const MOST_PER_MINUTE: f64 = 600.0;

/// What the rig is like.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Rig and session [default: the preset's]")]
pub(super) struct RigArgs {
    /// A rig drawn at random within the ranges of real rigs, as `soak` does it;
    /// --seed then draws the session's level and gain too
    #[arg(long, value_name = "N")]
    pub rig_seed: Option<u64>,
    /// Plate angle at a command of zero, degrees; one number is for both axes
    #[arg(long, value_name = "X[,Y]", allow_hyphen_values = true,
          value_parser = pair(-LEVEL_DEG..=LEVEL_DEG))]
    level_deg: Option<PerAxis<f64>>,
    /// Standard deviation of the level between sessions of different --seed
    #[arg(long, value_name = "DEG", value_parser = within(0.0..=LEVEL_SD_DEG))]
    level_sd_deg: Option<f64>,
    /// Plate angle per command
    #[arg(long, value_name = "X[,Y]", value_parser = pair(GAIN[0]..=GAIN[1]))]
    gain: Option<PerAxis<f64>>,
    /// Stiction: tilt at which a ball at rest starts, degrees
    #[arg(long, value_name = "DEG", value_parser = within(0.0..=BREAKAWAY_DEG))]
    breakaway_deg: Option<f64>,
    /// Servos that take whole degrees
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

/// What the rig's sensor and surroundings are like.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Sensor and surroundings [default: the preset's]")]
pub(super) struct SensorArgs {
    /// Standard deviation of a reading, m
    #[arg(long, value_name = "M", value_parser = within(SensorModel::LENGTH_M))]
    noise_m: Option<f64>,
    /// Quantisation: step of the readings (pixel, count), m
    #[arg(long, value_name = "M", value_parser = step(*SensorModel::LENGTH_M.end()))]
    quantum_m: Option<f64>,
    /// Readings nearer to the last than this repeat it, m
    #[arg(long, value_name = "M", value_parser = within(SensorModel::LENGTH_M))]
    dead_band_m: Option<f64>,
    /// Reading of a ball at the plate's centre, m
    #[arg(long, value_name = "X[,Y]", allow_hyphen_values = true,
          value_parser = pair(SensorModel::ORIGIN_M))]
    origin_m: Option<PerAxis<f64>>,
    /// New readings per second; between them rows repeat the last
    #[arg(long, value_name = "HZ", value_parser = within(Refresh::HZ))]
    refresh_hz: Option<f64>,
    /// A new reading with every Nth row; the others repeat the last
    #[arg(long, value_name = "N", conflicts_with = "refresh_hz",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(Refresh::MAX_ROWS)))]
    hold_rows: Option<u32>,
    /// Standard deviation of the log's period, as a share of it
    #[arg(long, value_name = "SHARE", value_parser = within(0.0..=1.0))]
    jitter: Option<f64>,
    /// Share of readings without a ball
    #[arg(long, value_name = "SHARE", value_parser = within(0.0..=1.0))]
    missing: Option<f64>,
    /// Share of lone readings far off
    #[arg(long, value_name = "SHARE", value_parser = within(0.0..=1.0))]
    outliers: Option<f64>,
    /// Hands pushing the ball, per minute
    #[arg(long, value_name = "N", default_value_t = 0.0,
          value_parser = within(0.0..=MOST_PER_MINUTE))]
    pushes: f64,
    /// Gusts of one to three seconds, per minute
    #[arg(long, value_name = "N", default_value_t = 0.0,
          value_parser = within(0.0..=MOST_PER_MINUTE))]
    gusts: f64,
}

/// What happens to rows on the way.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Transport")]
pub(super) struct LineArgs {
    /// Share of rows sent twice
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0..=1.0))]
    duplicates: f64,
    /// Share of rows held up, so that they come out of order
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0..=1.0))]
    late: f64,
    /// How long a row may be held up, s
    #[arg(long, value_name = "S", default_value_t = 0.05,
          value_parser = within(TransportFaults::WINDOW_S))]
    late_window_s: f64,
    /// Share of rows lost
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = within(0.0..=1.0))]
    lost: f64,
    /// A span of time in which every row is lost; may be given again
    #[arg(long, value_name = "FROM-TO", value_parser = span)]
    gap: Vec<(f64, f64)>,
}

/// Sets what is given.
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
        // A ball that rolls is held by no more than one at rest.
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
