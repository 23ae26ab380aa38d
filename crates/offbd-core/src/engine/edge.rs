//! Whether the ball is at the edge of the plate, and since when.

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
            recent: [None; 2],
        }
    }

    /// Forgets the past, as after a gap.
    pub(super) fn restart(&mut self) {
        self.clear_s = 0.0;
        self.rim_s = 0.0;
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
        let [Some((earlier, from)), Some((newest, to))] = self.recent else { return false };
        let share = (at - newest) / (newest - earlier);
        let ahead = |axis: Axis| to[axis] + share * (to[axis] - from[axis]);
        let hurried_m = self.most_m_s2 / 2.0 * (at - newest) * (at - earlier);
        let left_m = self.plate.edge_distance_m(ahead(Axis::X), ahead(Axis::Y));
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
            self.at_edge = self.is_near(place.x, place.y) || self.may_have_bounced(moment.at);
            let rim = self.plate.edge_axis(place.x, place.y, self.room_m);
            let rim = rim.filter(|_| self.plate.rim());
            self.rim_s = if rim.is_some() && rim == self.rim { self.rim_s + dt } else { 0.0 };
            self.rim = rim;
            self.recent = [self.recent[1], Some((moment.at, place))];
        }
        self.clear_s = if self.at_edge { 0.0 } else { self.clear_s + dt };
    }

    fn is_near(&self, x_m: f64, y_m: f64) -> bool {
        self.plate.edge_distance_m(x_m, y_m) < self.room_m
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
