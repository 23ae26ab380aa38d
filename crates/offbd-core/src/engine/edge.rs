//! Whether the ball is at the edge of the plate, and since when.

use nalgebra::Vector2;

use super::Rig;
use super::frame::Moment;
use crate::plant::Plate;
use crate::vocabulary::{Axis, PerAxis, SimTime};
use serde::{Deserialize, Serialize};

/// The state of the ball relative to the edge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Edge {
    plate: Plate,
    /// Distance from the edge within which the edge may act on the ball, m.
    room_m: f64,
    /// Largest acceleration that the plate can give the ball, m/s².
    most_m_s2: f64,
    /// Whether the ball was last read within that distance, or may have been there
    /// between the last two readings.
    pub at_edge: bool,
    /// Time for which the ball has not been at the edge, s.
    pub clear_s: f64,
    /// The axis whose rim the ball is at, and for how long, s.
    pub rim: Option<Axis>,
    pub rim_s: f64,
    /// Time for which the plate has been taking the ball off every rim that it is at, s.
    pub off_rim_s: f32,
    /// Sum of the jumps of the readings, m: if the sensor is off, the ball lies this far back from where
    /// it is read. Zero again once no ball can be there.
    displaced_m: PerAxis<f64>,
    /// The last two readings, the newest last.
    recent: [Option<(SimTime, PerAxis<f64>)>; 2],
}

impl Edge {
    pub(super) fn new(rig: &Rig) -> Self {
        Self {
            plate: rig.plate,
            room_m: rig.contact_room_m(),
            most_m_s2: rig.ball.rolling_gravity() * rig.servo.angle_limit_rad,
            at_edge: false,
            clear_s: 0.0,
            rim: None,
            rim_s: 0.0,
            off_rim_s: 0.0,
            displaced_m: PerAxis::default(),
            recent: [None; 2],
        }
    }

    /// The readings have jumped by `by_m`: the sensor is off by as much from now on, or the ball was
    /// moved. Readings do not tell which.
    pub(super) fn displace(&mut self, by_m: Vector2<f64>) {
        self.displaced_m.x += by_m.x;
        self.displaced_m.y += by_m.y;
    }

    /// Forgets the past, as after a gap, but not that the sensor may be off.
    pub(super) fn restart(&mut self) {
        self.clear_s = 0.0;
        self.rim_s = 0.0;
        self.off_rim_s = 0.0;
        self.recent = [None; 2];
    }

    /// Whether the plate has no rim.
    pub(super) fn is_open(&self) -> bool {
        !self.plate.rim()
    }

    /// Whether the ball may have met a rim before `at`, by extrapolation of the last two
    /// readings with the largest acceleration of the plate: a slow sensor sees it before
    /// and after the bounce, but not at the rim.
    pub(super) fn may_have_bounced(&self, at: SimTime) -> bool {
        self.may_turn(at, None)
    }

    /// As [`Self::may_have_bounced`], but for the rim across the axis at which the ball `lies`.
    pub(super) fn may_turn(&self, at: SimTime, lies: Option<Axis>) -> bool {
        let [Some((earlier, from)), Some((newest, to))] = self.recent else { return false };
        let share = (at - newest) / (newest - earlier);
        let ahead = |axis: Axis| match lies == Some(axis) {
            true => 0.0,
            false => to[axis] + share * (to[axis] - from[axis]),
        };
        let hurried_m = self.most_m_s2 / 2.0 * (at - newest) * (at - earlier);
        let left_m = self.left_m(&PerAxis::from_fn(ahead));
        self.plate.rim() && left_m < self.room_m + hurried_m
    }

    /// Whether the readings of `moment` are farther beyond the edge than the edge is from
    /// the middle, although the ball had not left the plate: whatever the sensor sees
    /// there is no ball.
    pub(super) fn is_far_off(&self, moment: &Moment) -> bool {
        let PerAxis { x, y } = moment.position.map(Option::unwrap_or_default);
        let beyond_m = -self.plate.edge_distance_m(x, y);
        !self.at_edge && beyond_m > self.plate.edge_distance_m(0.0, 0.0)
    }

    /// Takes a moment, `dt` after the previous one; its readings count unless they were
    /// `refused`. An axis that is not measured does not count.
    pub(super) fn take(&mut self, moment: &Moment, dt: f64, refused: bool) {
        let PerAxis { x, y } = moment.position;
        if !refused && x.or(y).is_some() {
            let place = PerAxis { x: x.unwrap_or(0.0), y: y.unwrap_or(0.0) };
            let [_, other] = self.places(&place);
            if self.plate.edge_distance_m(other.x, other.y) < 0.0 {
                // No ball is there, not even its middle: it was moved, and the sensor is right.
                self.displaced_m = PerAxis::default();
            }
            self.at_edge = self.left_m(&place) < self.room_m || self.may_have_bounced(moment.at);
            let rim = self.rim_of(&place).filter(|_| self.plate.rim());
            self.rim_s = if rim.is_some() && rim == self.rim { self.rim_s + dt } else { 0.0 };
            self.rim = rim;
            self.recent = [self.recent[1], Some((moment.at, place))];
        }
        self.clear_s = if self.at_edge { 0.0 } else { self.clear_s + dt };
    }

    /// Takes what the plate demands of the ball at the moment that was taken last: an acceleration of
    /// `pull_m_s2`, of which the ball resists `least_m_s2`.
    pub(super) fn take_pull(&mut self, pull_m_s2: &PerAxis<f64>, least_m_s2: f64, dt: f64) {
        let takes_off = |place: &PerAxis<f64>| {
            let near =
                self.places(place).map(|at| self.plate.off_edge(&at, self.room_m, pull_m_s2));
            near.into_iter().flatten().reduce(f64::min).is_some_and(|off| off >= least_m_s2)
        };
        let place = self.recent[1].as_ref().map(|(_, place)| place);
        let off_rim = self.at_edge && self.plate.rim() && place.is_some_and(takes_off);
        self.off_rim_s = if off_rim { self.off_rim_s + dt as f32 } else { 0.0 };
    }

    /// The places where the ball may be if it is read at `place`.
    fn places(&self, place: &PerAxis<f64>) -> [PerAxis<f64>; 2] {
        [*place, PerAxis::from_fn(|axis| place[axis] - self.displaced_m[axis])]
    }

    /// The axis whose rim a ball is at that is read at `place`, wherever it may be.
    fn rim_of(&self, place: &PerAxis<f64>) -> Option<Axis> {
        let is_near = |at: &PerAxis<f64>| self.plate.edge_distance_m(at.x, at.y) < self.room_m;
        let near = self.places(place).into_iter().filter(is_near);
        let mut rims = near.map(|at| self.plate.edge_axis(at.x, at.y, self.room_m));
        let first = rims.next().flatten();
        first.filter(|_| rims.all(|rim| rim == first))
    }

    /// Least distance from the edge of a ball that is read at `place`, m.
    fn left_m(&self, place: &PerAxis<f64>) -> f64 {
        let [a, b] = self.places(place).map(|at| self.plate.edge_distance_m(at.x, at.y));
        a.min(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball along x on the chapter's plate, 0.38 m long, read at 10 Hz.
    fn moments(places: &[f64]) -> Vec<Moment> {
        let at = |i: usize| SimTime::new(0.1 * i as f64).unwrap();
        let moment = |(i, &x): (usize, &f64)| Moment {
            at: at(i),
            command: PerAxis::default(),
            position: PerAxis { x: Some(x), y: Some(0.0) },
        };
        places.iter().enumerate().map(moment).collect()
    }

    fn at_edge(rig: &Rig, places: &[f64]) -> bool {
        let mut edge = Edge::new(rig);
        moments(places).iter().for_each(|m| edge.take(m, 0.1, false));
        edge.at_edge
    }

    #[test]
    fn a_ball_that_would_have_met_the_rim_between_two_readings_may_have_bounced() {
        let rig = Rig::chapter("a");
        assert!(at_edge(&rig, &[0.08, 0.13, 0.14]), "it was at 0.18 m in between");
        assert!(!at_edge(&rig, &[0.08, 0.11, 0.10]), "it would have got to 0.14 m");
        let open = Plate::new(rig.plate.shape(), 0.02, false).unwrap();
        assert!(!at_edge(&Rig { plate: open, ..rig }, &[0.08, 0.13, 0.14]), "there is no rim");
    }

    /// After a jump of the readings the ball may be as far from where it is read.
    #[test]
    fn a_jump_of_the_readings_moves_the_rim() {
        let mut edge = Edge::new(&Rig::chapter("a"));
        let rest = moments(&[0.13, 0.13, 0.13]);
        rest.iter().for_each(|m| edge.take(m, 0.01, false));
        assert!(!edge.at_edge && edge.rim.is_none());
        edge.displace(Vector2::new(-0.05, 0.0));
        edge.take(&rest[2], 0.01, false);
        assert!(edge.at_edge && edge.rim == Some(Axis::X), "it may be at 0.18 m");
        edge.displace(Vector2::new(0.05, 0.0));
        edge.take(&rest[2], 0.01, false);
        assert!(!edge.at_edge, "it has jumped back");
        edge.displace(Vector2::new(-0.07, 0.0));
        edge.take(&rest[2], 0.01, false);
        assert!(!edge.at_edge, "it would be beyond the rim: the ball was moved by hand");
    }

    /// A ball leaves the rim at +x if the plate takes it inward.
    #[test]
    fn a_rim_holds_a_ball_that_is_not_taken_off_it() {
        let rig = Rig::chapter("a");
        let left = |rig: &Rig, place: f64, pull: f64| {
            let mut edge = Edge::new(rig);
            for moment in &moments(&[place; 3]) {
                edge.take(moment, 0.1, false);
                edge.take_pull(&PerAxis { x: pull, y: 9.0 }, 0.1, 0.1);
            }
            edge.off_rim_s > 0.25
        };
        assert!(!left(&rig, 0.05, 0.0), "it is clear of the rim");
        assert!(left(&rig, 0.18, -0.1) && left(&rig, -0.18, 0.1));
        assert!(!left(&rig, 0.18, -0.09) && !left(&rig, 0.18, 0.5));
        let open = Plate::new(rig.plate.shape(), 0.02, false).unwrap();
        assert!(!left(&Rig { plate: open, ..rig }, 0.19, -1.0));
    }

    #[test]
    fn a_restart_forgets_where_the_ball_was_going() {
        let mut edge = Edge::new(&Rig::chapter("a"));
        let moments = moments(&[0.08, 0.13, 0.14]);
        moments[..2].iter().for_each(|m| edge.take(m, 0.1, false));
        assert!(edge.may_have_bounced(moments[2].at));
        edge.restart();
        assert!(!edge.may_have_bounced(moments[2].at));
    }
}
