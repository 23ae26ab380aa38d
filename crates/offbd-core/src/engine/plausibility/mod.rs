//! Plausibility of a rig's description and its data: sample rate, units, plate, commands
//! and axes are compared before anything is judged or learnt.
//!
//! A contradiction is reported with its numbers; a cause is only suggested if it removes
//! the contradiction. One pass over the samples as sent, including those that the engine
//! rejects; bounded memory.

mod period;
mod response;
mod scatter;
#[cfg(test)]
mod tests;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use period::Periods;
use response::{AxisResponse, ResponseCorrelator};
use scatter::ReadingScatter;
use serde::{Deserialize, Serialize};

use super::Rig;
use super::frame::{Moment, moment};
use crate::vocabulary::{Axis, FaultCode, PerAxis, Sample};

/// Least number of samples, readings or commands for a fraction of them to count. Chosen:
/// they arrive within a second.
const LEAST_COUNT: u32 = 20;
/// Factor by which a sample rate may be off. Chosen: a log that leaves out two samples of
/// three still has the same clock.
const RATE_FACTOR: f64 = 3.0;
/// Fraction that counts as most.
const MAJORITY: f64 = 0.5;
/// Fraction that must fit with another unit for that unit to be suggested. Chosen.
const FITTING_SHARE: f64 = 0.9;
/// Factor between the stated and the measured sample rate up to which the clock is not in doubt.
/// Chosen: a clock that runs wrong by a factor changes the motion by its square, here 2.25, which is
/// far from 10.
const SAME_RATE_FACTOR: f64 = 1.5;
/// Factor by which positions must exceed the plate to count as far off. Chosen: a plate
/// measured wrong by as much is less likely than another unit.
const FAR_FACTOR: f64 = 5.0;
/// Tolerance of a command's limit, rad: half a degree of rounding.
const ROUNDING_RAD: f64 = 0.009;
/// Angle that no plate is tilted by, rad. Chosen.
const STEEP_RAD: f64 = core::f64::consts::FRAC_PI_4;
/// Fraction of steep commands from which on they are not in radians. Chosen.
const STEEP_SHARE: f64 = 0.25;
/// Duration below which "no fault" tells nothing, s: a window must fill and a failure
/// must last before a fault is confirmed (1 to 2 s for most, by the prospects of the
/// chapter's rig).
const LEAST_SESSION_S: f64 = 3.0;
/// Position units other than the stated one, in terms of it: centimetres and millimetres
/// for metres.
const POSITION_UNITS: [f64; 2] = [0.01, 0.001];
/// Factors by which positions are too small if they are read in a unit that is too small: mm for
/// cm, mm for m, and one between them.
const SCALES: [f64; 3] = [10.0, 100.0, 1000.0];
/// Largest factor between the motion and a tenth (and so on) of what is expected: a quarter of a
/// decade, 10^0.25. Chosen: half the distance at which another power of ten is as near.
const SCALE_FACTOR: f64 = 1.778;
/// Distance of a session's level from that of the rig's sessions from which on it is named, in their
/// standard deviations. Chosen: of normally distributed levels 5 % are farther away.
const LEVEL_SPREADS: f64 = 2.0;
/// One degree in radians.
const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// A contradiction between a rig's description and its data.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Misfit {
    #[error("no sample has a position: without a ball nothing can be judged")]
    NoReadings,
    #[error("there are no commands: neither the servos nor the ball can be judged")]
    NoCommands,
    #[error("no axis has both commands and positions: x needs qy, y needs qx")]
    NoAxis,
    #[error("{duration_s:.1} s are too short to be judged; record at least {LEAST_SESSION_S} s")]
    Short { duration_s: f64 },
    #[error(
        "a sample comes every {} s, but by the asset file's sample_rate_hz of {stated_hz} every {} s: {}",
        digits(*period_s), digits(stated_hz.recip()), clock_hint(*per_second)
    )]
    Rate {
        /// Median time between samples.
        period_s: f64,
        stated_hz: f64,
        /// Units of the device's clock per second, if that explains it.
        per_second: Option<f64>,
    },
    #[error(
        "a sample comes every {} s, but by the asset file's sample_rate_hz of {stated_hz} every {} s: \
         are samples left out, or is sample_rate_hz {}?",
        digits(*period_s), digits(stated_hz.recip()), digits(period_s.recip())
    )]
    OtherRate {
        /// Median time between samples.
        period_s: f64,
        stated_hz: f64,
    },
    #[error(
        "{:.0} % of the positions lie outside the plate of the asset file{}",
        100.0 * share, unit_hint("axes.position_unit_m", units_m)
    )]
    Positions {
        /// Fraction of the positions that lie outside.
        share: f64,
        /// Units with which they would lie on the plate, m.
        units_m: [Option<f64>; POSITION_UNITS.len()],
    },
    #[error(
        "{:.0} % of the commands are beyond servo.angle_limit_rad, {limit_rad} rad{}",
        100.0 * share, unit_hint("axes.command_unit_rad", &[*unit_rad])
    )]
    Commands {
        /// Fraction of the commands that are beyond the limit.
        share: f64,
        limit_rad: f64,
        /// The unit with which they would be within the limit, rad.
        unit_rad: Option<f64>,
    },
    #[error("the commands never change: nothing shows how the servos answer")]
    CommandsHeld,
    #[error(
        "{axis} has no commands or no positions: the servo of {command} is not judged",
        axis = axis.as_str(), command = axis.command()
    )]
    OneAxis {
        /// The axis that is missing.
        axis: Axis,
    },
    #[error(
        "{axis} answers the command of {other}, not that of {command}: are the axes swapped? \
         (axes.swap is {swap})",
        axis = axis.as_str(), command = axis.command(), other = axis.other().command()
    )]
    Swapped { axis: Axis, swap: bool },
    #[error(
        "{axis} moves against the command of {command}: is the sign wrong (axes.{axis}_sign is {sign}), \
         or does the servo answer the other way?",
        axis = axis.as_str(), command = axis.command()
    )]
    WrongSign { axis: Axis, sign: f64 },
    #[error(
        "the motion is {:.2} of what the commands ask{}: are the positions {factor} times as large \
         (axes.position_unit_m {} instead of {unit_m})?",
        digits(*ratio), if *scattered { ", and the readings scatter as much less" } else { "" },
        digits(factor * unit_m)
    )]
    Scale {
        /// The motion over what the commands ask, the geometric mean over the axes.
        ratio: f64,
        /// Factor that would explain it.
        factor: f64,
        /// The stated unit of positions, m.
        unit_m: f64,
        /// Whether the readings also scatter less than those of the calibration, which no fault of
        /// the servos explains.
        scattered: bool,
    },
    #[error(
        "at {:.0} % of the positions the ball, {radius_m} m in radius, would touch the edge of the plate of \
         the asset file: is the radius or the plate wrong?",
        100.0 * share
    )]
    NoRoom {
        /// Fraction of the positions at which the ball would touch the edge.
        share: f64,
        radius_m: f64,
    },
    #[error(
        "along {axis} the plate lies {:.1}° off the level of the rig's sessions, which differ by {:.1}°: \
         was the rig moved, or is the {axis} servo off?",
        off_rad / DEGREE, spread_rad / DEGREE, axis = axis.as_str()
    )]
    Level {
        axis: Axis,
        /// Difference between the session's level and that of the calibration, rad.
        off_rad: f64,
        /// Standard deviation of the levels of the rig's sessions, rad.
        spread_rad: f64,
    },
}

impl Misfit {
    /// The identifier of the misfit.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NoReadings => "no_readings",
            Self::NoCommands => "no_commands",
            Self::NoAxis => "no_axis",
            Self::Short { .. } => "short",
            Self::Rate { .. } | Self::OtherRate { .. } => "rate",
            Self::Positions { .. } => "positions",
            Self::Commands { .. } => "commands",
            Self::CommandsHeld => "commands_held",
            Self::OneAxis { .. } => "one_axis",
            Self::Swapped { .. } => "swapped",
            Self::WrongSign { .. } => "wrong_sign",
            Self::Scale { .. } => "scale",
            Self::NoRoom { .. } => "no_room",
            Self::Level { .. } => "level",
        }
    }

    /// Whether a verdict "no fault" would be meaningless.
    #[must_use]
    pub const fn prevents_judging(self) -> bool {
        !matches!(
            self,
            Self::CommandsHeld
                | Self::OtherRate { .. }
                | Self::OneAxis { .. }
                | Self::Swapped { .. }
                | Self::WrongSign { .. }
                | Self::Scale { scattered: false, .. }
                | Self::NoRoom { .. }
                | Self::Level { .. }
        )
    }

    /// Whether it explains the evidence against a servo as well as a fault of the servo does.
    #[must_use]
    pub const fn excuses_servos(self) -> bool {
        matches!(self, Self::Scale { scattered: true, .. })
    }

    /// The servo for which "no fault" would be said too soon: a fault of it would look the same.
    #[must_use]
    pub const fn doubted_servo(self) -> Option<FaultCode> {
        match self {
            Self::Level { axis, .. } => Some(FaultCode::servo(axis)),
            _ => None,
        }
    }

    /// Whether it can be the reason why a rig cannot be learnt from a session.
    #[must_use]
    pub const fn hinders_learning(self) -> bool {
        matches!(
            self,
            Self::Swapped { .. }
                | Self::WrongSign { .. }
                | Self::Scale { .. }
                | Self::NoRoom { .. }
        )
    }

    /// Whether nothing can be learnt, however long the session.
    #[must_use]
    pub const fn prevents_learning(self) -> bool {
        matches!(
            self,
            Self::NoReadings
                | Self::NoCommands
                | Self::Rate { .. }
                | Self::Positions { .. }
                | Self::Commands { .. }
                | Self::CommandsHeld
        ) || matches!(self, Self::NoRoom { share, .. } if share > MAJORITY)
    }
}

/// Rounds to three significant digits.
fn digits(value: f64) -> f64 {
    let scale = 10_f64.powi(2 - value.abs().log10().floor() as i32);
    if scale.is_finite() && scale > 0.0 { (value * scale).round() / scale } else { value }
}

fn clock_hint(per_second: Option<f64>) -> &'static str {
    match per_second {
        Some(1e3) => "is t_s in ms?",
        Some(_) => "is t_s in µs?",
        None => "which of the two is wrong?",
    }
}

fn unit_hint(element: &str, units: &[Option<f64>]) -> String {
    let units: Vec<String> = units.iter().flatten().map(|&u| digits(u).to_string()).collect();
    match units.is_empty() {
        true => String::new(),
        false => format!(": is {element} {}?", units.join(" or ")),
    }
}

/// A count out of a total.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Count {
    n: u32,
    of: u32,
}

impl Count {
    fn take(&mut self, counts: bool) {
        self.n = self.n.saturating_add(counts.into());
        self.of = self.of.saturating_add(1);
    }

    /// The fraction; `None` if the total is too small.
    fn share(self) -> Option<f64> {
        (self.of >= LEAST_COUNT).then(|| f64::from(self.n) / f64::from(self.of))
    }

    fn exceeds(self, share: f64) -> bool {
        self.share().is_some_and(|s| s > share)
    }
}

/// Counts of where the positions lie.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct PositionCounts {
    outside: Count,
    far: Count,
    /// Where the ball would touch the edge.
    at_edge: Count,
    /// On the plate with each of [`POSITION_UNITS`].
    fit: [Count; POSITION_UNITS.len()],
}

/// Counts of the commands' sizes.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct CommandCounts {
    beyond: Count,
    steep: Count,
    /// Within the limit if in degrees.
    fit: Count,
}

/// What has been seen of one axis.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct SeenAxis {
    read: bool,
    command: Option<f64>,
    changed: bool,
    n_commands: u32,
}

/// What the calibration of a rig tells of an axis.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct CalibratedAxis {
    gain: f64,
    noise_m: f64,
    level_spread_rad: f64,
}

/// The comparison of one session's samples with the description of its rig.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Plausibility {
    rig: Rig,
    /// The rig's calibration, if there is one.
    learnt: Option<PerAxis<Option<CalibratedAxis>>>,
    span_s: Option<(f64, f64)>,
    periods: Periods,
    places: PositionCounts,
    sizes: CommandCounts,
    seen: PerAxis<SeenAxis>,
    responses: ResponseCorrelator,
    scatter: PerAxis<ReadingScatter>,
}

impl Plausibility {
    /// Builds a comparison for `rig` without samples.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            responses: ResponseCorrelator::new(rig.sample_rate_hz),
            learnt: rig.calibration.as_ref().map(|c| {
                c.axes.map(|axis| {
                    axis.map(|a| CalibratedAxis {
                        gain: a.gain,
                        noise_m: a.noise_m,
                        level_spread_rad: a.level_spread_rad,
                    })
                })
            }),
            rig: Rig { calibration: None, ..rig.clone() },
            span_s: None,
            periods: Periods::default(),
            places: PositionCounts::default(),
            sizes: CommandCounts::default(),
            seen: PerAxis::default(),
            scatter: PerAxis::default(),
        }
    }

    /// Compares a whole session.
    #[must_use]
    pub fn of(rig: &Rig, samples: &[Sample]) -> Self {
        let mut plausibility = Self::new(rig);
        samples.iter().for_each(|sample| plausibility.take(sample));
        plausibility
    }

    /// Takes the next sample as sent, in any order.
    pub fn take(&mut self, sample: &Sample) {
        let Some(mut moment) = moment(&self.rig.mapping, sample) else { return };
        let finite = |value: Option<f64>| value.filter(|v| v.is_finite());
        moment.command = moment.command.map(finite);
        moment.position = moment.position.map(finite);
        self.tick(moment.at.seconds());
        self.see(&moment);
        self.place(&moment);
        self.size(&moment);
        let plate = &self.rig.plate;
        let at = |axis: Axis| moment.position[axis].unwrap_or(0.0);
        if plate.edge_distance_m(at(Axis::X), at(Axis::Y)) < self.rig.contact_room_m() {
            moment.position = PerAxis::default();
        }
        for axis in Axis::ALL {
            if let Some(CalibratedAxis { noise_m, .. }) = self.learnt_axis(axis) {
                self.scatter[axis].take(moment.position[axis], noise_m);
            }
        }
        self.responses.take(&moment);
    }

    fn tick(&mut self, t_s: f64) {
        let (first, newest) = self.span_s.unwrap_or((t_s, t_s));
        self.periods.take(t_s - newest);
        self.span_s = Some((first.min(t_s), newest.max(t_s)));
    }

    fn see(&mut self, moment: &Moment) {
        for axis in Axis::ALL {
            let seen = &mut self.seen[axis];
            seen.read |= moment.position[axis].is_some();
            let Some(command) = moment.command[axis] else { continue };
            seen.n_commands = seen.n_commands.saturating_add(1);
            seen.changed |= seen.command.is_some_and(|before| before != command);
            seen.command = Some(command);
        }
    }

    fn place(&mut self, moment: &Moment) {
        let PerAxis { x, y } = moment.position;
        if x.or(y).is_none() {
            return;
        }
        let (plate, x, y) = (&self.rig.plate, x.unwrap_or(0.0), y.unwrap_or(0.0));
        // A ball may stand out over the edge by its radius.
        let out_m = -self.rig.ball.radius_m();
        let fits = |unit: f64| plate.edge_distance_m(unit * x, unit * y) >= out_m;
        self.places.outside.take(!fits(1.0));
        self.places.far.take(!fits(1.0 / FAR_FACTOR));
        self.places.at_edge.take(plate.edge_distance_m(x, y) < self.rig.ball.radius_m());
        for (count, unit) in self.places.fit.iter_mut().zip(POSITION_UNITS) {
            count.take(fits(unit));
        }
    }

    fn size(&mut self, moment: &Moment) {
        let limit_rad = self.rig.servo.angle_limit_rad + ROUNDING_RAD;
        for command in Axis::ALL.into_iter().filter_map(|axis| moment.command[axis]) {
            let angle = command.abs();
            self.sizes.beyond.take(angle > limit_rad);
            self.sizes.steep.take(angle > STEEP_RAD);
            self.sizes.fit.take(angle * DEGREE <= limit_rad);
        }
    }

    /// Returns the contradictions, the worst first.
    #[must_use]
    pub fn misfits(&self) -> Vec<Misfit> {
        let mut found: Vec<Misfit> =
            [self.rate(), self.missing(), self.positions(), self.commands()]
                .into_iter()
                .flatten()
                .collect();
        if found.is_empty() {
            found.extend(
                [self.short(), self.held(), self.one_axis(), self.other_rate()]
                    .into_iter()
                    .flatten(),
            );
            found.extend(self.answers());
            found.extend([self.scale(), self.no_room()].into_iter().flatten());
        }
        found
    }

    /// The measured time between samples, s, and the stated rate.
    fn rates(&self) -> Option<(f64, f64)> {
        Some((self.periods.median_s(LEAST_COUNT)?, self.rig.sample_rate_hz))
    }

    fn rate(&self) -> Option<Misfit> {
        let (period_s, stated_hz) = self.rates()?;
        let fits = |per_second: f64| {
            let factor = period_s / per_second * stated_hz;
            (RATE_FACTOR.recip()..=RATE_FACTOR).contains(&factor)
        };
        let per_second = [1e3, 1e6].into_iter().find(|&unit| fits(unit));
        (!fits(1.0)).then_some(Misfit::Rate { period_s, stated_hz, per_second })
    }

    /// A rate that differs by less than [`RATE_FACTOR`], with which everything can be judged.
    fn other_rate(&self) -> Option<Misfit> {
        let (period_s, stated_hz) = self.rates()?;
        let differs = (period_s * stated_hz).ln().abs() > SAME_RATE_FACTOR.ln();
        differs.then_some(Misfit::OtherRate { period_s, stated_hz })
    }

    fn missing(&self) -> Option<Misfit> {
        let any = |of: fn(&SeenAxis) -> bool| Axis::ALL.iter().any(|&axis| of(&self.seen[axis]));
        if !any(|seen| seen.read) {
            return Some(Misfit::NoReadings);
        }
        if !any(|seen| seen.command.is_some()) {
            return Some(Misfit::NoCommands);
        }
        let whole = any(|seen| seen.read && seen.command.is_some());
        (!whole).then_some(Misfit::NoAxis)
    }

    fn positions(&self) -> Option<Misfit> {
        let share = self.places.outside.share().filter(|&share| share > MAJORITY)?;
        let PositionCounts { far, fit, .. } = &self.places;
        let units_m = core::array::from_fn(|i| {
            let fits = far.exceeds(MAJORITY) && fit[i].exceeds(FITTING_SHARE);
            fits.then_some(POSITION_UNITS[i] * self.rig.mapping.position_unit_m)
        });
        Some(Misfit::Positions { share, units_m })
    }

    fn commands(&self) -> Option<Misfit> {
        let share = self.sizes.beyond.share().filter(|&share| share > MAJORITY)?;
        let in_degrees =
            self.sizes.steep.exceeds(STEEP_SHARE) && self.sizes.fit.exceeds(FITTING_SHARE);
        let unit_rad = in_degrees.then_some(DEGREE * self.rig.mapping.command_unit_rad);
        Some(Misfit::Commands { share, limit_rad: self.rig.servo.angle_limit_rad, unit_rad })
    }

    fn short(&self) -> Option<Misfit> {
        let duration_s = self.span_s.map_or(0.0, |(first, newest)| newest - first);
        (duration_s < LEAST_SESSION_S).then_some(Misfit::Short { duration_s })
    }

    fn held(&self) -> Option<Misfit> {
        let enough = Axis::ALL.iter().any(|&axis| self.seen[axis].n_commands >= LEAST_COUNT);
        let changed = Axis::ALL.iter().any(|&axis| self.seen[axis].changed);
        (enough && !changed).then_some(Misfit::CommandsHeld)
    }

    /// A missing axis, unless the calibration lacks it, too.
    fn one_axis(&self) -> Option<Misfit> {
        let known = |axis: Axis| self.learnt.is_none_or(|learnt| learnt[axis].is_some());
        let lacks = |&axis: &Axis| {
            known(axis) && !(self.seen[axis].read && self.seen[axis].command.is_some())
        };
        Axis::ALL.into_iter().find(lacks).map(|axis| Misfit::OneAxis { axis })
    }

    /// Axes that are swapped or have the wrong sign, if the data show it clearly. Not for
    /// a learnt rig, whose axes are known: there it is a servo fault.
    fn answers(&self) -> Vec<Misfit> {
        if self.learnt.is_some() {
            return Vec::new();
        }
        let answers = PerAxis::from_fn(|axis| self.responses.answers(axis));
        let are =
            |wanted: AxisResponse| Axis::ALL.into_iter().filter(move |&a| answers[a] == wanted);
        let swap = self.rig.mapping.swap;
        if are(AxisResponse::Own).next().is_none() && are(AxisResponse::Against).next().is_none() {
            return are(AxisResponse::Other).map(|axis| Misfit::Swapped { axis, swap }).collect();
        }
        let sign = |axis: Axis| Misfit::WrongSign { axis, sign: self.rig.mapping.sign[axis] };
        are(AxisResponse::Against).map(sign).collect()
    }

    /// Positions that are too small by a power of ten: along each axis the ball responds to its own
    /// command that much less than it should.
    fn scale(&self) -> Option<Misfit> {
        if self.other_rate().is_some() {
            return None;
        }
        let asked = self.rig.ball.rolling_gravity();
        let mut ratios = Vec::new();
        for axis in Axis::ALL {
            let seen = &self.seen[axis];
            if seen.read && seen.changed {
                let gain = self.responses.slope_m_s2(axis)? / asked;
                ratios.push(gain / self.learnt_axis(axis).map_or(1.0, |learnt| learnt.gain));
            }
        }
        let scale = SCALES.iter().position(|factor| {
            let near = |ratio: &f64| (ratio * factor).ln().abs() <= SCALE_FACTOR.ln();
            !ratios.is_empty() && ratios.iter().all(near)
        })?;
        let mean = ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64;
        let smaller = Axis::ALL.map(|axis| self.scatter[axis].is_smaller(scale));
        let scattered = smaller.contains(&Some(true)) && !smaller.contains(&Some(false));
        let factor = SCALES[scale];
        let unit_m = self.rig.mapping.position_unit_m;
        Some(Misfit::Scale { ratio: mean.exp(), factor, unit_m, scattered })
    }

    /// Compares the level of each axis in this session with that of the rig's sessions; `offsets` are
    /// the accelerations that it causes, with their standard errors, m/s². Nothing without a
    /// calibration. An offset of a servo from the first sample on is such a level: nothing in the session
    /// tells them apart.
    pub fn levels(&self, offsets: &PerAxis<(f64, f64)>) -> impl Iterator<Item = Misfit> {
        Axis::ALL.into_iter().filter_map(|axis| {
            let learnt = self.learnt_axis(axis)?;
            let slope_m_s2 = learnt.gain * self.rig.ball.rolling_gravity();
            let (offset_m_s2, error_m_s2) = offsets[axis];
            let (off_rad, error_rad) = ((offset_m_s2 / slope_m_s2).abs(), error_m_s2 / slope_m_s2);
            let spread_rad = learnt.level_spread_rad;
            let is_off = off_rad > LEVEL_SPREADS * spread_rad.hypot(error_rad);
            is_off.then_some(Misfit::Level { axis, off_rad, spread_rad })
        })
    }

    fn learnt_axis(&self, axis: Axis) -> Option<CalibratedAxis> {
        self.learnt.and_then(|learnt| learnt[axis])
    }

    fn no_room(&self) -> Option<Misfit> {
        let share = self.places.at_edge.share().filter(|&share| share > MAJORITY)?;
        Some(Misfit::NoRoom { share, radius_m: self.rig.ball.radius_m() })
    }
}
