//! Measures, while a rig runs, how much motion it has shown that it can be learnt from.
//!
//! Calibration cuts a recording into stretches in which the ball moves throughout; this
//! module counts the same seconds sample by sample. The ball must be read on the plate
//! without a gap, and the command must have moved recently: a ball that rolls without
//! being asked to tells nothing about its servo. The memory is bounded; independent of
//! what is learnt.

use super::calibrate::{MOVING_M, MOVING_RAD, WINDOWS_S};
use super::frame::moment;
use super::{AxisMapping, Rig};
use crate::diagnosis::Settings;
use crate::plant::Plate;
use crate::vocabulary::{Axis, PerAxis, Sample};
use serde::{Deserialize, Serialize};

/// Usable motion along an axis that suffices for learning, s. Calibration judges each
/// half by what was learnt from the other: half of this is 25 of its windows of 1.2 s; it
/// needs 6, with commands that determine the gain within 20 %. Of real recordings of 6 to
/// 40 s, 86 of 92 were refused.
pub const WANTED_MOTION_S: f64 = 60.0;

/// Length of a piece, s: a window of calibration has three, each with motion.
const PIECE_S: f64 = WINDOWS_S[0] / 3.0;
/// Consecutive pieces with motion that make a stretch.
const PIECES: u32 = 3;
/// Least readings in a piece. Chosen.
const PIECE_READINGS: u32 = 4;
/// Time for which a ball still responds to a change of its command, s: it takes about as
/// long to cross a plate at a tilt of one degree.
const ANSWER_S: f64 = 2.0;

/// Counts the seconds of usable motion along each axis of one session.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UsableMotion {
    mapping: AxisMapping,
    plate: Plate,
    /// Distance from the edge within which a ball does not count as on the plate, m.
    edge_m: f64,
    gap_s: f64,
    last_s: Option<f64>,
    axes: PerAxis<AxisMotion>,
}

impl UsableMotion {
    /// Builds a counter for `rig`, before its first sample.
    #[must_use]
    pub fn new(rig: &Rig) -> Self {
        Self {
            mapping: rig.mapping,
            plate: rig.plate,
            edge_m: rig.contact_room_m(),
            gap_s: Settings::default().gap_after_s(1.0 / rig.sample_rate_hz),
            last_s: None,
            axes: PerAxis::default(),
        }
    }

    /// Takes the next sample; one that is not later than the last is ignored.
    pub fn take(&mut self, sample: &Sample) {
        let Some(moment) = moment(&self.mapping, sample) else { return };
        let t_s = moment.at.seconds();
        let since_s = self.last_s.map_or(0.0, |last_s| t_s - last_s);
        if since_s <= 0.0 && self.last_s.is_some() {
            return;
        }
        self.last_s = Some(t_s);
        let at = |axis: Axis| moment.position[axis].unwrap_or(0.0);
        let on_plate = self.plate.edge_distance_m(at(Axis::X), at(Axis::Y)) >= self.edge_m;
        for axis in Axis::ALL {
            let along = &mut self.axes[axis];
            if since_s > self.gap_s || (!on_plate && moment.position[axis].is_some()) {
                along.end_stretch();
            }
            along.command(t_s, moment.command[axis]);
            along.read |= moment.position[axis].is_some();
            if let Some(position_m) = moment.position[axis].filter(|_| on_plate) {
                along.position(t_s, position_m, self.gap_s);
            }
        }
    }

    /// Returns the usable motion along each axis so far, s; `None` for an axis without
    /// commands or without positions, which cannot be learnt.
    #[must_use]
    pub fn seconds(&self) -> PerAxis<Option<f64>> {
        PerAxis::from_fn(|axis| {
            let along = &self.axes[axis];
            (along.read && along.anchor_rad.is_some()).then_some(along.counted_s)
        })
    }
}

/// The state of one axis.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct AxisMotion {
    /// Whether a position has been read.
    read: bool,
    /// The command from which the next move is measured, rad.
    anchor_rad: Option<f64>,
    /// Time at which the command last moved, s.
    moved_s: Option<f64>,
    piece: Option<Piece>,
    /// Number and duration, s, of the consecutive pieces with motion.
    n_pieces: u32,
    stretch_s: f64,
    counted_s: f64,
}

impl AxisMotion {
    fn command(&mut self, t_s: f64, command_rad: Option<f64>) {
        let Some(command_rad) = command_rad else { return };
        match self.anchor_rad {
            Some(anchor_rad) if (command_rad - anchor_rad).abs() <= MOVING_RAD => return,
            Some(_) => self.moved_s = Some(t_s),
            None => {}
        }
        self.anchor_rad = Some(command_rad);
    }

    fn position(&mut self, t_s: f64, position_m: f64, gap_s: f64) {
        if self.piece.is_some_and(|piece| t_s - piece.last_s > gap_s) {
            self.end_stretch();
        }
        let piece = self.piece.get_or_insert(Piece::at(t_s, position_m));
        piece.take(t_s, position_m);
        let piece = *piece;
        if t_s - piece.first_s >= PIECE_S && piece.n_readings >= PIECE_READINGS {
            self.count(&piece);
            self.piece = Some(Piece::at(t_s, position_m));
        }
    }

    /// Counts a piece, with its predecessors once they make a stretch.
    fn count(&mut self, piece: &Piece) {
        let asked = self.moved_s.is_some_and(|moved_s| piece.last_s - moved_s <= ANSWER_S);
        if !asked || piece.high_m - piece.low_m <= MOVING_M {
            return self.end_stretch();
        }
        self.n_pieces += 1;
        self.stretch_s += piece.last_s - piece.first_s;
        if self.n_pieces >= PIECES {
            self.counted_s += core::mem::take(&mut self.stretch_s);
        }
    }

    fn end_stretch(&mut self) {
        (self.piece, self.n_pieces, self.stretch_s) = (None, 0, 0.0);
    }
}

/// Consecutive readings.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Piece {
    first_s: f64,
    last_s: f64,
    low_m: f64,
    high_m: f64,
    n_readings: u32,
}

impl Piece {
    const fn at(t_s: f64, position_m: f64) -> Self {
        Self { first_s: t_s, last_s: t_s, low_m: position_m, high_m: position_m, n_readings: 0 }
    }

    const fn take(&mut self, t_s: f64, position_m: f64) {
        self.last_s = t_s;
        self.low_m = self.low_m.min(position_m);
        self.high_m = self.high_m.max(position_m);
        self.n_readings += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball that circles with `radius_m` at 100 Hz for `seconds` under commands of
    /// `command_rad`.
    fn circles(seconds: f64, radius_m: f64, command_rad: f64) -> Vec<Sample> {
        let sample = |i: u32| {
            let t_s = f64::from(i) / 100.0;
            let (sin, cos) = (2.0 * t_s).sin_cos();
            Sample {
                t_s,
                cmd_qx_rad: Some(command_rad * sin),
                cmd_qy_rad: Some(command_rad * cos),
                x_m: Some(radius_m * cos),
                y_m: Some(radius_m * sin),
                ..Sample::default()
            }
        };
        (0..(100.0 * seconds) as u32).map(sample).collect()
    }

    fn counted(samples: impl IntoIterator<Item = Sample>) -> PerAxis<Option<f64>> {
        let mut motion = UsableMotion::new(&Rig::chapter("a"));
        samples.into_iter().for_each(|sample| motion.take(&sample));
        motion.seconds()
    }

    /// The seconds counted along x, for an axis with commands and positions.
    fn x_s(samples: impl IntoIterator<Item = Sample>) -> f64 {
        counted(samples).x.unwrap()
    }

    #[test]
    fn a_ball_that_circles_counts_and_one_that_rests_does_not() {
        let whole = counted(circles(30.0, 0.05, 0.03));
        for seconds in [whole.x.unwrap(), whole.y.unwrap()] {
            // Except for the unfinished piece at the end.
            assert!((29.0..=30.0).contains(&seconds), "{seconds}");
        }
        assert_eq!(x_s(circles(30.0, 0.0005, 0.03)), 0.0, "the ball rests");
        assert_eq!(x_s(circles(30.0, 0.05, 0.001)), 0.0, "nobody asked it to roll");
    }

    #[test]
    fn what_was_not_on_the_plate_or_not_there_does_not_count() {
        let samples = circles(30.0, 0.05, 0.03);
        let far = samples.iter().map(|s| Sample { x_m: s.x_m.map(|x| 10.0 * x), ..*s });
        assert!(x_s(far) < 10.0, "mostly beyond the edge");
        let gaps = samples.iter().filter(|s| s.t_s.rem_euclid(1.4) < 1.0).copied();
        assert_eq!(x_s(gaps), 0.0, "no stretch without a gap is long enough");
        let unseen = samples.iter().map(|s| match s.t_s.rem_euclid(1.4) < 1.0 {
            true => *s,
            false => Sample { x_m: None, y_m: None, ..*s },
        });
        assert_eq!(x_s(unseen), 0.0, "nor one without readings");
        let twice = samples.iter().flat_map(|s| [*s, *s]);
        assert_eq!(x_s(twice), x_s(samples.clone()), "a sample counts once");
    }

    #[test]
    fn an_axis_without_commands_or_positions_is_none() {
        let samples = circles(10.0, 0.05, 0.03);
        let one = counted(samples.iter().map(|s| Sample { cmd_qx_rad: None, ..*s }));
        assert!(one.x.is_some() && one.y.is_none());
        let none = counted(samples.iter().map(|s| Sample { x_m: None, ..*s }));
        assert!(none.x.is_none() && none.y.is_some());
        assert_eq!(counted([]), PerAxis::default());
    }

    #[test]
    fn a_slow_camera_counts_as_a_fast_one() {
        let slow = circles(30.0, 0.05, 0.03).into_iter().step_by(20);
        let mut motion = UsableMotion::new(&Rig { sample_rate_hz: 5.0, ..Rig::chapter("a") });
        slow.for_each(|sample| motion.take(&sample));
        assert!(motion.seconds().x.unwrap() > 27.0, "{:?}", motion.seconds());
    }
}
