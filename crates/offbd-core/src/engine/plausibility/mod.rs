//! Whether a rig's description and its data can be of one rig: rate, units,
//! plate, commands and axes, held against each other before anything is judged
//! or learnt.
//!
//! One idea: what does not fit is named with its numbers, and a cause is only
//! suggested where it makes the numbers fit. One pass over the samples as they
//! were sent, those included that the engine refuses; bounded memory.

mod period;
mod response;
#[cfg(test)]
mod tests;

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use period::Periods;
use response::{Answers, Responses};

use super::Rig;
use super::frame::{Moment, moment};
use crate::vocabulary::{Axis, PerAxis, Sample};

/// Samples, readings or commands from which on a share of them says anything:
/// fewer come in a fraction of a second.
const LEAST: u32 = 20;
/// Factor by which a rate may be off: a log that leaves out two samples of three
/// is thin, but it is the same clock.
const RATE_FACTOR: f64 = 3.0;
/// Share that counts as most.
const MOST: f64 = 0.5;
/// Share that must fit under another unit for that to be suggested.
const FITS: f64 = 0.9;
/// How many times too small a plate must be entered for positions on it to count
/// as far off: a plate measured wrong by as much is less likely than another unit.
const FAR: f64 = 5.0;
/// What a command may exceed its limit by: half a degree of rounding, rad.
const ROUNDING_RAD: f64 = 0.009;
/// Angle that no plate is tilted by, rad: at 45° nothing rolls back.
const STEEP_RAD: f64 = core::f64::consts::FRAC_PI_4;
/// Share of steep commands from which on they are not in radians.
const SOME: f64 = 0.25;
/// Length below which "no fault" says nothing, s: a window must fill, and what
/// fails must last, before most faults are confirmed (1 to 2 s, by `calibrate`'s own
/// forecast on the chapter's rig).
const LEAST_S: f64 = 3.0;
/// Units of a position other than the stated one, in it: centimetres and
/// millimetres for metres.
const POSITION_UNITS: [f64; 2] = [0.01, 0.001];
/// A degree for a radian.
const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// Something in which a rig's description and its data do not fit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Misfit {
    #[error("no position was read: there is no ball to judge by")]
    NoReadings,
    #[error("there are no commands: neither the servos nor the ball can be judged")]
    NoCommands,
    #[error("no axis has both commands and positions: x needs qy, y needs qx")]
    NoAxis,
    #[error("{duration_s:.1} s are too short to be judged; record at least {LEAST_S} s")]
    Short { duration_s: f64 },
    #[error(
        "a sample comes every {} s, by the asset file's sample_rate_hz of {stated_hz} every {} s: {}",
        digits(*period_s), digits(stated_hz.recip()), clock_hint(*per_second)
    )]
    Rate {
        /// Median time between samples.
        period_s: f64,
        stated_hz: f64,
        /// Units of the device's clock in a second, where that explains it.
        per_second: Option<f64>,
    },
    #[error(
        "{:.0} % of the positions lie outside the plate of the asset file{}",
        100.0 * share, unit_hint("axes.position_unit_m", units_m)
    )]
    Positions {
        /// Of the positions, those outside.
        share: f64,
        /// Units under which they would lie on it, m.
        units_m: [Option<f64>; POSITION_UNITS.len()],
    },
    #[error(
        "{:.0} % of the commands are beyond servo.angle_limit_rad, {limit_rad} rad{}",
        100.0 * share, unit_hint("axes.command_unit_rad", &[*unit_rad])
    )]
    Commands {
        /// Of the commands, those beyond.
        share: f64,
        limit_rad: f64,
        /// The unit under which they would be within, rad.
        unit_rad: Option<f64>,
    },
    #[error("the commands never change: nothing shows how the servos answer")]
    CommandsHeld,
    #[error(
        "{axis} has no commands or no positions: nothing is said of the servo of {command}",
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
}

impl Misfit {
    /// One word for programs.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NoReadings => "no_readings",
            Self::NoCommands => "no_commands",
            Self::NoAxis => "no_axis",
            Self::Short { .. } => "short",
            Self::Rate { .. } => "rate",
            Self::Positions { .. } => "positions",
            Self::Commands { .. } => "commands",
            Self::CommandsHeld => "commands_held",
            Self::OneAxis { .. } => "one_axis",
            Self::Swapped { .. } => "swapped",
            Self::WrongSign { .. } => "wrong_sign",
        }
    }

    /// Whether "no fault" would be a verdict from nothing.
    #[must_use]
    pub const fn prevents_judging(self) -> bool {
        !matches!(
            self,
            Self::CommandsHeld
                | Self::OneAxis { .. }
                | Self::Swapped { .. }
                | Self::WrongSign { .. }
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
        )
    }
}

/// Three significant digits.
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

/// A number out of another.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    n: u32,
    of: u32,
}

impl Count {
    fn take(&mut self, counts: bool) {
        self.n = self.n.saturating_add(counts.into());
        self.of = self.of.saturating_add(1);
    }

    /// None where there are too few to say.
    fn share(self) -> Option<f64> {
        (self.of >= LEAST).then(|| f64::from(self.n) / f64::from(self.of))
    }

    fn exceeds(self, share: f64) -> bool {
        self.share().is_some_and(|s| s > share)
    }
}

/// Where the positions lie.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    outside: Count,
    far: Count,
    /// On the plate under each of [`POSITION_UNITS`].
    fit: [Count; POSITION_UNITS.len()],
}

/// How large the commands are.
#[derive(Clone, Copy, Debug, Default)]
struct Sizes {
    beyond: Count,
    steep: Count,
    /// Within the limit if they are in degrees.
    fit: Count,
}

/// What has been seen of one axis.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    read: bool,
    command: Option<f64>,
    changed: bool,
    n_commands: u32,
}

/// The samples of one session held against the description of its rig.
#[derive(Clone, Debug)]
pub struct Plausibility {
    rig: Rig,
    /// The axes that the rig's calibration knows, if there is one.
    learnt: Option<PerAxis<bool>>,
    span_s: Option<(f64, f64)>,
    periods: Periods,
    places: Places,
    sizes: Sizes,
    seen: PerAxis<Seen>,
    responses: Responses,
}

impl Plausibility {
    /// Nothing seen yet of `rig`.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            responses: Responses::new(rig.sample_rate_hz),
            learnt: rig.calibration.as_ref().map(|c| c.axes.map(|axis| axis.is_some())),
            rig: Rig { calibration: None, ..rig.clone() },
            span_s: None,
            periods: Periods::default(),
            places: Places::default(),
            sizes: Sizes::default(),
            seen: PerAxis::default(),
        }
    }

    /// All that was found of a whole session.
    #[must_use]
    pub fn of(rig: &Rig, samples: &[Sample]) -> Self {
        let mut plausibility = Self::new(rig);
        samples.iter().for_each(|sample| plausibility.take(sample));
        plausibility
    }

    /// Takes the next sample as it was sent, in whatever order they come.
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
        self.places.far.take(!fits(1.0 / FAR));
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

    /// What does not fit, the worst first.
    #[must_use]
    pub fn misfits(&self) -> Vec<Misfit> {
        let mut found: Vec<Misfit> =
            [self.rate(), self.missing(), self.positions(), self.commands()]
                .into_iter()
                .flatten()
                .collect();
        if found.is_empty() {
            found.extend([self.short(), self.held(), self.one_axis()].into_iter().flatten());
            found.extend(self.answers());
        }
        found
    }

    fn rate(&self) -> Option<Misfit> {
        let (period_s, stated_hz) = (self.periods.median_s(LEAST)?, self.rig.sample_rate_hz);
        let fits = |per_second: f64| {
            let factor = period_s / per_second * stated_hz;
            (RATE_FACTOR.recip()..=RATE_FACTOR).contains(&factor)
        };
        let per_second = [1e3, 1e6].into_iter().find(|&unit| fits(unit));
        (!fits(1.0)).then_some(Misfit::Rate { period_s, stated_hz, per_second })
    }

    fn missing(&self) -> Option<Misfit> {
        let any = |of: fn(&Seen) -> bool| Axis::ALL.iter().any(|&axis| of(&self.seen[axis]));
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
        let share = self.places.outside.share().filter(|&share| share > MOST)?;
        let Places { far, fit, .. } = &self.places;
        let units_m = core::array::from_fn(|i| {
            let fits = far.exceeds(MOST) && fit[i].exceeds(FITS);
            fits.then_some(POSITION_UNITS[i] * self.rig.mapping.position_unit_m)
        });
        Some(Misfit::Positions { share, units_m })
    }

    fn commands(&self) -> Option<Misfit> {
        let share = self.sizes.beyond.share().filter(|&share| share > MOST)?;
        let in_degrees = self.sizes.steep.exceeds(SOME) && self.sizes.fit.exceeds(FITS);
        let unit_rad = in_degrees.then_some(DEGREE * self.rig.mapping.command_unit_rad);
        Some(Misfit::Commands { share, limit_rad: self.rig.servo.angle_limit_rad, unit_rad })
    }

    fn short(&self) -> Option<Misfit> {
        let duration_s = self.span_s.map_or(0.0, |(first, newest)| newest - first);
        (duration_s < LEAST_S).then_some(Misfit::Short { duration_s })
    }

    fn held(&self) -> Option<Misfit> {
        let enough = Axis::ALL.iter().any(|&axis| self.seen[axis].n_commands >= LEAST);
        let changed = Axis::ALL.iter().any(|&axis| self.seen[axis].changed);
        (enough && !changed).then_some(Misfit::CommandsHeld)
    }

    /// An axis that is not there, unless the rig is known to lack it.
    fn one_axis(&self) -> Option<Misfit> {
        let known = |axis: Axis| self.learnt.is_none_or(|learnt| learnt[axis]);
        let lacks = |&axis: &Axis| {
            known(axis) && !(self.seen[axis].read && self.seen[axis].command.is_some())
        };
        Axis::ALL.into_iter().find(lacks).map(|axis| Misfit::OneAxis { axis })
    }

    /// Axes that are swapped or have the wrong sign, where the data say so
    /// clearly. Of a rig that is learnt it is known: there it is the servo.
    fn answers(&self) -> Vec<Misfit> {
        if self.learnt.is_some() {
            return Vec::new();
        }
        let answers = PerAxis::from_fn(|axis| self.responses.answers(axis));
        let are = |wanted: Answers| Axis::ALL.into_iter().filter(move |&a| answers[a] == wanted);
        let swap = self.rig.mapping.swap;
        if are(Answers::Own).next().is_none() && are(Answers::Against).next().is_none() {
            return are(Answers::Other).map(|axis| Misfit::Swapped { axis, swap }).collect();
        }
        let sign = |axis: Axis| Misfit::WrongSign { axis, sign: self.rig.mapping.sign[axis] };
        are(Answers::Against).map(sign).collect()
    }
}
