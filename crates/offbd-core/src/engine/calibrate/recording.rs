//! Prepares a healthy session for learning: in the plate frame, in order of time, without
//! outliers and readings at the edge, cut into stretches of motion.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::ops::Range;

use nalgebra::Vector2;

use crate::diagnosis::{OutlierGate, Settings};
use crate::engine::Rig;
use crate::engine::edge::Edge;
use crate::engine::frame::{Moment, Repeats, moment};
use crate::maths::median;
use crate::plant::{RollingState, Twin, TwinModel, resistance_share};
use crate::vocabulary::{Axis, PerAxis, Sample, SimTime};

/// Least samples in a window, which is extended if necessary. Chosen.
const WINDOW_SAMPLES: usize = 10;
/// Sample periods without a reading that end a window. Chosen.
const MISSING_PERIODS: f64 = 2.5;
/// Ratio of the time between different readings to the sample period from which on a
/// sensor is slower than its log. Chosen.
const SLOWER: f64 = 1.4;
/// Span of the readings in each third of a window that counts as motion, m: a ball that
/// sticks for part of it tells no gain. Chosen.
pub(in crate::engine) const MOVING_M: f64 = 0.002;
/// Time over which a velocity is measured as the slope of the path, s. Chosen.
const SLOPE_S: f64 = 0.16;
/// Noise assumed by the outlier gate before the rig is learnt, m: that of a coarse
/// camera.
const GATE_NOISE_M: f64 = 2e-3;

/// A stretch of consecutive samples.
pub(super) type Stretch = Range<usize>;

/// A session in the plate frame and in order.
pub(super) struct Recording {
    pub(super) moments: Vec<Moment>,
    pub(super) gap_s: f64,
    /// The ball's velocity at each moment, m/s.
    velocity: Vec<Vector2<f64>>,
    /// The path that a rolling resistance of 1 m/s² adds at each moment, m.
    pub(super) resisted: PerAxis<Vec<f64>>,
    /// Longest time for which readings were bit-identical, s.
    pub(super) longest_repeat_s: PerAxis<f64>,
    /// Whether the ball was read at the edge, or may have met a rim since the previous
    /// reading.
    bounced: Vec<bool>,
    /// Time between two readings of a sensor that is slower than its log, s; zero
    /// otherwise.
    pub(super) refresh_s: f64,
    /// Median time between samples, s.
    pub(super) period_s: f64,
}

impl Recording {
    pub(super) fn new(rig: &Rig, samples: &[Sample]) -> Self {
        let mut moments: Vec<Moment> =
            samples.iter().filter_map(|s| moment(&rig.mapping, s)).collect();
        moments.sort_by_key(|m| m.at);
        moments.dedup_by_key(|m| m.at);
        let mut steps: Vec<f64> = moments.windows(2).map(|w| w[1].at - w[0].at).collect();
        let period_s = median(&mut steps).unwrap_or(0.0);
        let gap_s = Settings::default().gap_after_s(period_s);
        let (velocity, resisted, bounced) = Default::default();
        let longest_repeat_s = PerAxis::from_fn(|axis| longest_repeat_s(&moments, axis, gap_s));
        let refresh_s = refresh_s(&moments, period_s);
        let mut recording = Self {
            moments,
            gap_s,
            velocity,
            resisted,
            longest_repeat_s,
            bounced,
            refresh_s,
            period_s,
        };
        recording.drop_repeats();
        recording.drop_unusable(rig);
        recording.velocity = recording.velocities();
        recording.resisted = PerAxis::from_fn(|axis| recording.resisted_path(axis));
        recording
    }

    /// Removes readings that only repeat the previous one, of a sensor that is slower
    /// than its log.
    fn drop_repeats(&mut self) {
        let mut repeats = Repeats::new(self.refresh_s);
        for m in &mut self.moments {
            if repeats.is_repeat(m.at, &m.position) {
                m.position = PerAxis::default();
            }
        }
    }

    /// Removes outliers and readings at the edge, where no ball rolls freely.
    fn drop_unusable(&mut self, rig: &Rig) {
        let (mut gate, mut edge) = (OutlierGate::default(), Edge::new(rig));
        self.bounced = vec![false; self.moments.len()];
        let is_read = |m: &Moment| Axis::ALL.iter().any(|&a| m.position[a].is_some());
        let read = self.moments.iter_mut().zip(&mut self.bounced).filter(|(m, _)| is_read(m));
        for (m, bounced) in read {
            let usable = gate.take(m.at.seconds(), m.position, GATE_NOISE_M).usable();
            edge.take(m, 0.0, !usable);
            *bounced = edge.at_edge;
            if edge.at_edge || !usable {
                m.position = PerAxis::default();
            }
        }
    }

    /// Returns velocities as slopes over [`SLOPE_S`], the previous one where nothing is
    /// read; zero along an axis that is not measured.
    fn velocities(&self) -> Vec<Vector2<f64>> {
        let is_read = |m: &&Moment| m.position != PerAxis::default();
        let read: Vec<&Moment> = self.moments.iter().filter(is_read).collect();
        let (mut early, mut late) = (0, 0);
        let mut slope = |i: usize| {
            while read[i].at - read[early].at > SLOPE_S / 2.0 {
                early += 1;
            }
            while late + 1 < read.len() && read[late].at - read[i].at < SLOPE_S / 2.0 {
                late += 1;
            }
            let (a, b) = (read[early], read[late.max(i)]);
            let along = |axis: Axis| match (a.position[axis], b.position[axis]) {
                (Some(from), Some(to)) if b.at > a.at => (to - from) / (b.at - a.at),
                _ => 0.0,
            };
            Vector2::new(along(Axis::X), along(Axis::Y))
        };
        let (mut n_read, mut velocity) = (0, Vector2::zeros());
        let mut at = |m: &Moment| {
            if is_read(&m) {
                velocity = slope(n_read);
                n_read += 1;
            }
            velocity
        };
        self.moments.iter().map(&mut at).collect()
    }

    fn resisted_path(&self, axis: Axis) -> Vec<f64> {
        let (mut position, mut speed, mut before) = (0.0, 0.0, None);
        let step = |(m, v): (&Moment, &Vector2<f64>)| {
            let dt = before.replace(m.at).map_or(0.0, |b: SimTime| m.at - b);
            let a = -resistance_share(v[axis as usize]);
            position += dt * (speed + dt * a / 2.0);
            speed += dt * a;
            position
        };
        self.moments.iter().zip(&self.velocity).map(step).collect()
    }

    pub(super) fn has(&self, axis: Axis) -> bool {
        self.moments.iter().any(|m| m.position[axis].is_some())
            && self.moments.iter().any(|m| m.command[axis].is_some())
    }

    /// Standard deviation of the commands of `axis`, rad.
    pub(super) fn swing_rad(&self, axis: Axis) -> f64 {
        let commands = || self.moments.iter().filter_map(|m| m.command[axis]);
        let n = commands().count().max(1) as f64;
        let mean = commands().sum::<f64>() / n;
        (commands().map(|c| (c - mean) * (c - mean)).sum::<f64>() / n).sqrt()
    }

    pub(super) fn duration_s(&self) -> f64 {
        match (self.moments.first(), self.moments.last()) {
            (Some(first), Some(last)) => last.at - first.at,
            _ => 0.0,
        }
    }

    /// Returns stretches of one window each in which `axis` is measured and the ball
    /// moves throughout, from the start, without overlap.
    pub(super) fn stretches(&self, axis: Axis, window_s: f64) -> Vec<Stretch> {
        let mut found = Vec::new();
        let (mut start, mut last) = (0, None);
        for i in 0..self.moments.len() {
            if self.bounced[i] {
                last = None;
            }
            if self.moments[i].position[axis].is_none() {
                continue;
            }
            let at = self.moments[i].at;
            if last.replace(at).is_none_or(|l: SimTime| at - l > self.break_s()) {
                start = i;
            }
            let span_s = at - self.moments[start].at;
            if span_s >= window_s && i - start >= WINDOW_SAMPLES {
                let third = (i + 1 - start).div_ceil(3);
                let moves = |c: &[Moment]| span_m(c, axis) > MOVING_M;
                if self.moments[start..=i].chunks(third).all(moves) {
                    found.push(start..i + 1);
                    start = i + 1;
                } else {
                    start += third;
                }
            }
        }
        found
    }

    /// Longest time without a reading in a stretch, s.
    fn break_s(&self) -> f64 {
        MISSING_PERIODS * self.period_s.max(self.refresh_s)
    }

    /// Returns the twin's free path along `axis` at each moment.
    pub(super) fn twin_path(&self, model: &TwinModel, axis: Axis) -> Vec<f64> {
        self.twin_path_within(&(0..self.moments.len()), model, axis)
    }

    /// Returns the free path along `axis` at each moment of `stretch`, of a twin that
    /// begins there.
    pub(super) fn twin_path_within(
        &self,
        stretch: &Stretch,
        model: &TwinModel,
        axis: Axis,
    ) -> Vec<f64> {
        let mut twin = Twin::new(*model);
        let mut before: Option<SimTime> = None;
        let mut last = PerAxis::from_fn(|_| 0.0);
        let step = |(m, velocity): (&Moment, &Vector2<f64>)| {
            if before.is_some_and(|b| m.at - b > self.gap_s) {
                twin.restart();
            }
            before = Some(m.at);
            last = PerAxis::from_fn(|a: Axis| m.position[a].unwrap_or(last[a]));
            let at = |a: Axis| last[a];
            let observed = RollingState {
                position: Vector2::new(at(Axis::X), at(Axis::Y)),
                velocity: *velocity,
                spin: 0.0,
            };
            twin.advance(m.at, m.command, &observed);
            twin.motion().position[axis as usize]
        };
        let of = stretch.clone();
        self.moments[of.clone()].iter().zip(&self.velocity[of]).map(step).collect()
    }
}

/// Returns the time between two different readings, s, if it is longer than the sample
/// period; zero otherwise.
fn refresh_s(moments: &[Moment], period_s: f64) -> f64 {
    let mut last: Option<&Moment> = None;
    let mut steps = Vec::new();
    for m in moments.iter().filter(|m| m.position != PerAxis::default()) {
        match last {
            Some(l) if l.position == m.position => continue,
            Some(l) => steps.push(m.at - l.at),
            None => {}
        }
        last = Some(m);
    }
    median(&mut steps).filter(|&step_s| step_s > SLOWER * period_s).unwrap_or(0.0)
}

/// Longest time for which readings of `axis` were bit-identical, s.
fn longest_repeat_s(moments: &[Moment], axis: Axis, gap_s: f64) -> f64 {
    let (mut longest_s, mut repeated_s): (f64, f64) = (0.0, 0.0);
    for pair in moments.windows(2) {
        let dt = pair[1].at - pair[0].at;
        let (Some(a), Some(b)) = (pair[0].position[axis], pair[1].position[axis]) else {
            repeated_s = 0.0;
            continue;
        };
        let same = a.to_bits() == b.to_bits() && dt <= gap_s;
        repeated_s = if same { repeated_s + dt } else { 0.0 };
        longest_s = longest_s.max(repeated_s);
    }
    longest_s
}

/// Difference between the largest and the smallest reading, m.
fn span_m(moments: &[Moment], axis: Axis) -> f64 {
    let readings = moments.iter().filter_map(|m| m.position[axis]);
    let (low, high) = readings.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball that crosses a plate of 0.38 m along x at 0.5 m/s, read at 25 Hz: it is
    /// read before and after the rim, but not at it.
    #[test]
    fn a_window_ends_where_the_ball_may_have_met_a_rim() {
        let rig = Rig::chapter("a");
        let sample = |i: u32| {
            let t = f64::from(i) / 25.0;
            let along = (0.5 * t - 0.15).rem_euclid(0.68);
            let x = if along < 0.34 { along - 0.17 } else { 0.51 - along };
            Sample {
                t_s: t,
                cmd_qx_rad: Some(0.0),
                cmd_qy_rad: Some(0.0),
                x_m: Some(x),
                y_m: Some(0.0),
                ..Sample::default()
            }
        };
        let samples: Vec<Sample> = (0..250).map(sample).collect();
        let recording = Recording::new(&rig, &samples);
        let stretches = recording.stretches(Axis::X, 0.3);
        assert!(stretches.len() > 3);
        for stretch in stretches {
            let xs: Vec<f64> =
                recording.moments[stretch].iter().filter_map(|m| m.position.x).collect();
            let rises = xs.windows(2).filter(|w| w[1] > w[0]).count();
            assert!(rises == 0 || rises == xs.len() - 1, "{xs:?}");
        }
    }
}
