//! Learning a rig from healthy sessions.
//!
//! In windows of a second or two the measured path of one axis is fitted by
//! `x₀ + v₀ t + k·z(t) + b t²/2`, where z is the twin's path under the recorded
//! commands: k (gain) and b (level) are the rig's, x₀ and v₀ the window's own.
//! Dead time and lag are searched for. The worst fifth of the windows is left
//! out (least trimmed squares, Rousseeuw 1984), so that hands pushing the ball
//! do not count. Fitting the path instead of its second difference explains
//! 94–98 % of real recordings where differences explain 10–60 %.

use nalgebra::{Matrix2, Vector2};

use super::Rig;
use super::frame::{Moment, moment};
use crate::diagnosis::{AxisCalibration, Calibration, OutlierGate};
use crate::maths::{SlidingQuadratic, median, quantile, robust_deviation};
use crate::plant::{RollingState, ServoModel, Twin, TwinAxis, TwinModel};
use crate::vocabulary::{Axis, PerAxis, Sample, SimTime};

/// Lengths of a window, s, the better first: a ball that sticks every other
/// second offers only short stretches of motion.
const WINDOWS_S: [f64; 2] = [1.2, 0.6];
/// Samples that a window must hold; it grows where that takes longer.
const WINDOW_SAMPLES: usize = 10;
/// A longer step between samples ends a window, s; and that many periods.
const GAP_S: f64 = 0.3;
const GAP_PERIODS: f64 = 4.0;
/// Windows that are kept, of all: the rest may hold pushes.
const KEPT: f64 = 0.8;
/// Least windows with a moving ball to learn from.
const LEAST_WINDOWS: usize = 6;
/// Largest relative standard error of the gain.
const WORST_GAIN_ERROR: f64 = 0.2;
/// Least share of the paths' variance that the fit must explain.
const LEAST_EXPLAINED: f64 = 0.5;
/// A ball whose readings span less than this over a while is at rest, m.
const REST_SPAN_M: f64 = 0.003;
/// A window counts as motion when the readings of each third span this, m: a
/// ball that sticks for part of it answers no gain.
const MOVING_M: f64 = 0.002;
/// Noise assumed by the outlier gate before anything is known, m.
const ASSUMED_NOISE_M: f64 = 2e-3;

/// Why nothing can be learnt.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CannotCalibrate {
    #[error("no axis has both commands and positions: nothing to learn from")]
    NoAxis,
    #[error(
        "{axis}: only {n_windows} stretches of motion of {length} s are usable, {LEAST_WINDOWS} are needed; \
         record at least a minute with the ball rolling about the middle of the plate",
        axis = axis.as_str(), length = WINDOWS_S[1]
    )]
    TooShort { axis: Axis, n_windows: usize },
    #[error(
        "{axis}: the commands of {command} move too little to tell the gain (it would be known to ±{percent:.0} %, \
         ±20 % is needed); record steps or circles of a few degrees",
        axis = axis.as_str(), command = axis.command()
    )]
    TooLittleExcitation { axis: Axis, percent: f64 },
    #[error(
        "{axis}: the ball moves against the command of {command} (gain {gain:.2}); \
         set the sign or the swap of the axes in the asset file",
        axis = axis.as_str(), command = axis.command()
    )]
    Reversed { axis: Axis, gain: f64 },
    #[error(
        "{axis}: the command of {command} explains only {percent:.0} % of the ball's motion; \
         check units and axis mapping, and that the recording is healthy",
        axis = axis.as_str(), command = axis.command()
    )]
    Unexplained { axis: Axis, percent: f64 },
}

/// A stretch of consecutive samples.
type Stretch = std::ops::Range<usize>;

/// Learns gain, dead time, lag, level, noise and breakaway of each axis from
/// healthy `sessions` of `rig`. `data_sha256` names the data, `made_at` says
/// when (RFC 3339); both are only noted.
///
/// An axis without commands or without positions is left out.
///
/// # Errors
/// [`CannotCalibrate`], which says what is missing.
pub fn calibrate(
    rig: &Rig,
    sessions: &[Vec<Sample>],
    data_sha256: &str,
    made_at: &str,
) -> Result<Calibration, CannotCalibrate> {
    let recordings: Vec<Recording> = sessions.iter().map(|s| Recording::new(rig, s)).collect();
    let learn = |axis: Axis| {
        let present = recordings.iter().any(|r| r.has(axis));
        present.then(|| learn_axis(rig, &recordings, axis)).transpose()
    };
    let axes = PerAxis { x: learn(Axis::X)?, y: learn(Axis::Y)? };
    if axes.x.is_none() && axes.y.is_none() {
        return Err(CannotCalibrate::NoAxis);
    }
    Ok(Calibration {
        axes,
        data_sha256: data_sha256.to_owned(),
        n_samples: sessions.iter().map(|s| s.len() as u64).sum(),
        duration_s: recordings.iter().map(Recording::duration_s).sum(),
        made_at: made_at.to_owned(),
    })
}

/// A session in the plate frame and in order.
struct Recording {
    moments: Vec<Moment>,
    gap_s: f64,
}

impl Recording {
    fn new(rig: &Rig, samples: &[Sample]) -> Self {
        let mut moments: Vec<Moment> =
            samples.iter().filter_map(|s| moment(&rig.mapping, s)).collect();
        moments.sort_by_key(|m| m.at);
        moments.dedup_by_key(|m| m.at);
        let mut steps: Vec<f64> = moments.windows(2).map(|w| w[1].at - w[0].at).collect();
        let period_s = median(&mut steps).unwrap_or(0.0);
        let mut recording = Self { moments, gap_s: GAP_S.max(GAP_PERIODS * period_s) };
        recording.drop_unusable(rig);
        recording
    }

    /// Takes away readings at the edge and outliers: no ball rolls there.
    fn drop_unusable(&mut self, rig: &Rig) {
        let mut gate = OutlierGate::default();
        let reach = rig.ball.radius_m() + 0.006;
        for m in
            self.moments.iter_mut().filter(|m| Axis::ALL.iter().any(|&a| m.position[a].is_some()))
        {
            let (x, y) = (m.position.x.unwrap_or(0.0), m.position.y.unwrap_or(0.0));
            let at_edge = rig.plate.edge_distance_m(x, y) < reach;
            let usable = gate.take(m.at.seconds(), m.position, ASSUMED_NOISE_M).usable();
            if at_edge || !usable {
                m.position = PerAxis::default();
            }
        }
    }

    fn has(&self, axis: Axis) -> bool {
        self.moments.iter().any(|m| m.position[axis].is_some())
            && self.moments.iter().any(|m| m.command[axis].is_some())
    }

    fn duration_s(&self) -> f64 {
        match (self.moments.first(), self.moments.last()) {
            (Some(first), Some(last)) => last.at - first.at,
            _ => 0.0,
        }
    }

    /// Stretches of one window each in which `axis` is measured and the ball
    /// moves throughout, found from the left without overlap.
    fn stretches(&self, axis: Axis, window_s: f64) -> Vec<Stretch> {
        let mut found = Vec::new();
        let mut start = 0;
        for i in 0..self.moments.len() {
            let broken = i > start && self.moments[i].at - self.moments[i - 1].at > self.gap_s;
            if broken {
                start = i;
            }
            if self.moments[i].position[axis].is_none() {
                start = i + 1;
                continue;
            }
            let span_s = self.moments[i].at - self.moments[start].at;
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

    /// The twin's free path along `axis` at every moment.
    fn twin_path(&self, model: &TwinModel, axis: Axis) -> Vec<f64> {
        let mut twin = Twin::new(*model);
        let mut before: Option<SimTime> = None;
        let step = |m: &Moment| {
            if before.is_some_and(|b| m.at - b > self.gap_s) {
                twin.restart();
            }
            before = Some(m.at);
            let at = |a: Axis| m.position[a].unwrap_or(0.0);
            let observed = RollingState {
                position: Vector2::new(at(Axis::X), at(Axis::Y)),
                ..RollingState::default()
            };
            twin.advance(m.at, m.command, &observed);
            twin.motion().position[axis as usize]
        };
        self.moments.iter().map(step).collect()
    }
}

/// One window with its straight line taken away: measured path, twin's path
/// and the parabola t²/2, orthogonal to 1 and t.
struct Window {
    yy: f64,
    normal: Matrix2<f64>,
    right: Vector2<f64>,
    n: usize,
}

impl Window {
    fn new(moments: &[Moment], path: &[f64], axis: Axis) -> Self {
        let t0 = moments[0].at;
        let times: Vec<f64> = moments.iter().map(|m| m.at - t0).collect();
        let straighten = |values: Vec<f64>| without_line(&times, values);
        let y = straighten(moments.iter().map(|m| m.position[axis].unwrap_or(0.0)).collect());
        let z = straighten(path.to_vec());
        let p = straighten(times.iter().map(|t| t * t / 2.0).collect());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let cross = dot(&z, &p);
        Self {
            yy: dot(&y, &y),
            normal: Matrix2::new(dot(&z, &z), cross, cross, dot(&p, &p)),
            right: Vector2::new(dot(&z, &y), dot(&p, &y)),
            n: moments.len(),
        }
    }

    /// Mean square of what gain and level leave unexplained, m².
    fn unexplained(&self, c: &Vector2<f64>) -> f64 {
        let squares = self.yy - 2.0 * c.dot(&self.right) + c.dot(&(self.normal * c));
        squares.max(0.0) / self.n as f64
    }
}

/// `values` less their least-squares straight line over `times`.
fn without_line(times: &[f64], mut values: Vec<f64>) -> Vec<f64> {
    let n = times.len() as f64;
    let (mean_t, mean_v) = (times.iter().sum::<f64>() / n, values.iter().sum::<f64>() / n);
    let (mut tt, mut tv) = (0.0, 0.0);
    for (t, v) in times.iter().zip(&values) {
        tt += (t - mean_t) * (t - mean_t);
        tv += (t - mean_t) * (v - mean_v);
    }
    let slope = if tt > 0.0 { tv / tt } else { 0.0 };
    for (t, v) in times.iter().zip(values.iter_mut()) {
        *v -= mean_v + slope * (t - mean_t);
    }
    values
}

/// Gain and level (as an acceleration) that explain the windows best.
#[derive(Clone, Copy, Debug)]
struct Explained {
    gain: f64,
    offset_m_s2: f64,
    /// Mean square left over in the kept windows, m².
    left: f64,
    /// Share of the variance explained.
    share: f64,
    /// Standard error of the gain.
    gain_error: f64,
}

/// How much an unlikely gain costs: a gain off by a factor of e weighs like
/// half as much again left over. It only decides where the data hardly do;
/// gains from 0.5 to 2 have been seen on real rigs.
const GAIN_PRIOR: f64 = 0.5;

impl Explained {
    fn cost(&self) -> f64 {
        let unlikely = self.gain.abs().ln();
        self.left * (1.0 + GAIN_PRIOR * unlikely * unlikely)
    }
}

/// Least trimmed squares over windows: fit, drop the worst, fit again.
fn explain(windows: &mut [Window]) -> Option<Explained> {
    let keep = ((windows.len() as f64 * KEPT).ceil() as usize).min(windows.len());
    let mut kept = windows.len();
    let mut c = Vector2::zeros();
    for _ in 0..4 {
        let (normal, right) = windows[..kept]
            .iter()
            .fold((Matrix2::zeros(), Vector2::zeros()), |(n, r), w| (n + w.normal, r + w.right));
        c = normal.try_inverse()? * right;
        windows.sort_by(|a, b| a.unexplained(&c).total_cmp(&b.unexplained(&c)));
        kept = keep;
    }
    let kept = &windows[..kept];
    let n: usize = kept.iter().map(|w| w.n).sum();
    let left = kept.iter().map(|w| w.unexplained(&c) * w.n as f64).sum::<f64>() / n as f64;
    let total = kept.iter().map(|w| w.yy).sum::<f64>() / n as f64;
    let normal = kept.iter().fold(Matrix2::zeros(), |sum, w| sum + w.normal);
    // What is left over is coloured: it counts as one reading a window, not n.
    let gain_error = (left * n as f64 / kept.len() as f64 * normal.try_inverse()?[(0, 0)]).sqrt();
    Some(Explained { gain: c.x, offset_m_s2: c.y, left, share: 1.0 - left / total, gain_error })
}

/// Step of dead time and lag at which the search ends, s.
const FINEST_STEP_S: f64 = 0.001;
/// Where the search looks next: dead time and lag trade off against each
/// other along a narrow valley, so it also looks across both.
const DIRECTIONS: [(f64, f64); 10] = [
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (1.0, -1.0),
    (-1.0, 1.0),
    (2.0, -1.0),
    (-2.0, 1.0),
    (1.0, -2.0),
    (-1.0, 2.0),
];

/// The recordings of one axis, ready to be fitted.
struct Fitter<'a> {
    rig: &'a Rig,
    recordings: &'a [Recording],
    stretches: Vec<Vec<Stretch>>,
    axis: Axis,
}

impl Fitter<'_> {
    /// Windows in which the ball moves.
    fn n_windows(&self) -> usize {
        self.stretches.iter().map(Vec::len).sum()
    }

    fn model(&self, dead_time_s: f64, lag_s: f64, gain: f64, level_rad: f64) -> Option<TwinModel> {
        let spec = &self.rig.servo;
        let servo = ServoModel::new(spec.angle_limit_rad, lag_s, spec.rate_limit_rad_s).ok()?;
        let axis = TwinAxis { servo, dead_time_s, gain, level_rad };
        Some(TwinModel::new(&self.rig.ball, &self.rig.plate, axis))
    }

    fn explain(&self, dead_time_s: f64, lag_s: f64) -> Option<Explained> {
        let model = self.model(dead_time_s, lag_s, 1.0, 0.0)?;
        let mut windows = Vec::with_capacity(self.n_windows());
        for (recording, stretches) in self.recordings.iter().zip(&self.stretches) {
            let path = recording.twin_path(&model, self.axis);
            windows.extend(
                stretches.iter().map(|s| {
                    Window::new(&recording.moments[s.clone()], &path[s.clone()], self.axis)
                }),
            );
        }
        explain(&mut windows)
    }

    /// Dead time and lag that leave the least: a coarse grid, then a pattern
    /// search that halves its steps.
    fn search(&self) -> Option<(f64, f64, Explained)> {
        let mut best: Option<(f64, f64, Explained)> = None;
        let try_at = |dead: f64, lag: f64, best: &mut Option<(f64, f64, Explained)>| {
            if dead < 0.0 || lag < 0.0 {
                return;
            }
            let Some(found) = self.explain(dead, lag) else { return };
            if best.is_none_or(|(.., b)| found.cost() < b.cost()) {
                *best = Some((dead, lag, found));
            }
        };
        for dead in [0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3] {
            for lag in [0.01, 0.03, 0.06, 0.1, 0.15, 0.22] {
                try_at(dead, lag, &mut best);
            }
        }
        let mut step = 0.02;
        while step >= FINEST_STEP_S {
            let (dead, lag, before) = best?;
            for (d, l) in DIRECTIONS {
                try_at(dead + d * step, lag + l * step, &mut best);
            }
            if best.is_some_and(|(.., after)| after.cost() == before.cost()) {
                step /= 2.0;
            }
        }
        best
    }
}

/// Learns from long windows, or from short ones where there are too few.
fn learn_axis(
    rig: &Rig,
    recordings: &[Recording],
    axis: Axis,
) -> Result<AxisCalibration, CannotCalibrate> {
    let [long_s, short_s] = WINDOWS_S;
    learn_in_windows(rig, recordings, axis, long_s)
        .or_else(|_| learn_in_windows(rig, recordings, axis, short_s))
}

fn learn_in_windows(
    rig: &Rig,
    recordings: &[Recording],
    axis: Axis,
    window_s: f64,
) -> Result<AxisCalibration, CannotCalibrate> {
    let stretches: Vec<Vec<Stretch>> =
        recordings.iter().map(|r| r.stretches(axis, window_s)).collect();
    let fitter = Fitter { rig, recordings, stretches, axis };
    let n_windows = fitter.n_windows();
    if n_windows < LEAST_WINDOWS {
        return Err(CannotCalibrate::TooShort { axis, n_windows });
    }
    let still = CannotCalibrate::TooLittleExcitation { axis, percent: f64::INFINITY };
    let (dead_time_s, lag_s, found) = fitter.search().ok_or(still)?;
    let error = found.gain_error / found.gain.abs();
    if error.is_nan() || error > WORST_GAIN_ERROR {
        return Err(CannotCalibrate::TooLittleExcitation { axis, percent: 100.0 * error });
    }
    if found.gain <= 0.0 {
        return Err(CannotCalibrate::Reversed { axis, gain: found.gain });
    }
    if found.share < LEAST_EXPLAINED {
        return Err(CannotCalibrate::Unexplained { axis, percent: 100.0 * found.share });
    }
    let slope = axis.drive_sign() * rig.ball.rolling_gravity();
    let level_rad = found.offset_m_s2 / (found.gain * slope);
    let healthy = healthy_spread(&fitter, dead_time_s, lag_s, found.gain, level_rad);
    Ok(AxisCalibration {
        gain: found.gain,
        dead_time_s,
        lag_s,
        level_rad,
        noise_m: healthy.noise_m.max(1e-5),
        breakaway_rad: healthy.breakaway_rad,
        residual_m_s2: healthy.residual_m_s2.max(1e-4),
    })
}

/// From the smallest to the largest reading, m.
fn span_m(moments: &[Moment], axis: Axis) -> f64 {
    let readings = moments.iter().filter_map(|m| m.position[axis]);
    let (low, high) = readings.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
    high - low
}

/// How a healthy rig scatters about the twin.
struct Healthy {
    noise_m: f64,
    residual_m_s2: f64,
    breakaway_rad: f64,
}

/// Window of the residual, s: the one that the default profile judges by.
const RESIDUAL_WINDOW_S: f64 = 0.5;
/// Rest after which the plate's tilt counts as withstood, s.
const REST_S: f64 = 0.5;
/// Share of the withstood tilts that the breakaway angle covers.
const REST_SHARE: f64 = 0.95;

fn healthy_spread(fitter: &Fitter, dead: f64, lag: f64, gain: f64, level: f64) -> Healthy {
    let (mut scatters, mut residuals, mut withstood) = (Vec::new(), Vec::new(), Vec::new());
    let axis = fitter.axis;
    for recording in fitter.recordings {
        let Some(model) = fitter.model(dead, lag, gain, level) else { continue };
        let path = recording.twin_path(&model, axis);
        let mut filter = SlidingQuadratic::default();
        for (m, &z) in recording.moments.iter().zip(&path) {
            let stale = filter.newest().is_some_and(|n| m.at.seconds() - n > recording.gap_s);
            if stale {
                filter.clear();
            }
            let Some(position) = m.position[axis] else { continue };
            filter.push(m.at.seconds(), position, z, RESIDUAL_WINDOW_S);
            let Some(fit) = filter.fit().filter(|f| f.span_s > 0.8 * RESIDUAL_WINDOW_S) else {
                continue;
            };
            scatters.push(fit.scatter);
            residuals.push(fit.deviation.acceleration);
        }
        withstood.extend(tilts_at_rest(recording, axis, level, dead + lag));
    }
    Healthy {
        noise_m: median(&mut scatters).unwrap_or(0.0),
        residual_m_s2: robust_deviation(&mut residuals).unwrap_or(0.0),
        breakaway_rad: quantile(&mut withstood, REST_SHARE).unwrap_or(0.0),
    }
}

/// Tilts, rad, that a ball at rest has withstood: the command of a delay ago
/// plus the level, while the readings stay within [`REST_SPAN_M`].
fn tilts_at_rest(recording: &Recording, axis: Axis, level: f64, delay_s: f64) -> Vec<f64> {
    let moments = &recording.moments;
    let mut tilts = Vec::new();
    let (mut anchor, mut anchor_at, mut delayed) = (f64::INFINITY, None, 0);
    for m in moments {
        let Some(position) = m.position[axis] else { continue };
        if (position - anchor).abs() > REST_SPAN_M / 2.0 {
            (anchor, anchor_at) = (position, Some(m.at));
        }
        while delayed + 1 < moments.len() && m.at - moments[delayed + 1].at >= delay_s {
            delayed += 1;
        }
        let rested = anchor_at.is_some_and(|since| m.at - since > REST_S);
        if let (true, Some(command)) = (rested, moments[delayed].command[axis]) {
            tilts.push((command + level).abs());
        }
    }
    tilts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vocabulary::Sample;

    /// A rig with known gain, dead time, lag and level under a sum of sines,
    /// made by the twin itself: the ball never rests and never leaves.
    fn session(seconds: f64, amplitude: f64, gain: f64) -> Vec<Sample> {
        let rig = Rig::chapter("a");
        let servo = ServoModel::new(0.2, 0.05, 100.0).unwrap();
        let axis = TwinAxis { servo, dead_time_s: 0.06, gain, level_rad: 0.01 };
        let mut twin = Twin::new(TwinModel::new(&rig.ball, &rig.plate, axis));
        let times: Vec<f64> = (0..(seconds / 0.01) as u32).map(|i| f64::from(i) * 0.01).collect();
        // The level is compensated, as a controller would.
        let command = |w: f64, t: f64| -0.01 + amplitude * ((w * t).cos() + (2.7 * w * t).sin());
        let (mut commands, mut paths) = (Vec::new(), [Vec::new(), Vec::new()]);
        for &t in &times {
            let now = PerAxis { x: Some(command(3.0, t)), y: Some(command(3.5, t)) };
            twin.advance(SimTime::new(t).unwrap(), now, &RollingState::default());
            commands.push(now);
            paths[0].push(twin.motion().position.x);
            paths[1].push(twin.motion().position.y);
        }
        let [x, y] = paths.map(|path| without_line(&times, path));
        // A reading in whole tenths of a millimetre.
        let read = |position: f64| Some((position * 1e4).round() * 1e-4);
        (0..times.len())
            .map(|i| Sample {
                seq: None,
                t_s: times[i],
                cmd_qx_rad: commands[i].y,
                cmd_qy_rad: commands[i].x,
                x_m: read(x[i]),
                y_m: read(y[i]),
            })
            .collect()
    }

    #[test]
    fn validate_that_what_was_put_in_is_learnt() {
        let rig = Rig::chapter("a");
        let learnt = calibrate(&rig, &[session(60.0, 0.03, 0.85)], "", "").unwrap();
        for axis in Axis::ALL {
            let found = learnt.axes[axis].unwrap();
            assert!((found.gain - 0.85).abs() < 0.01, "{axis:?} {found:?}");
            assert!((found.level_rad - 0.01).abs() < 1e-3, "{axis:?} {found:?}");
            let delay = found.dead_time_s + found.lag_s;
            assert!((delay - 0.11).abs() < 0.01, "{axis:?} {found:?}");
            assert!(found.noise_m < 1e-4, "{axis:?} {found:?}");
        }
    }

    #[test]
    fn refusals_say_what_is_missing() {
        let rig = Rig::chapter("a");
        let refused = |s: Vec<Sample>| calibrate(&rig, &[s], "", "").unwrap_err();
        assert!(matches!(refused(session(4.0, 0.03, 1.0)), CannotCalibrate::TooShort { .. }));
        assert!(matches!(refused(session(60.0, 0.03, -1.0)), CannotCalibrate::Reversed { .. }));
        let mut blind = session(60.0, 0.03, 1.0);
        for s in &mut blind {
            (s.x_m, s.cmd_qx_rad) = (None, None);
        }
        assert_eq!(refused(blind), CannotCalibrate::NoAxis);
    }

    #[test]
    fn an_axis_without_readings_is_left_out() {
        let mut one_sided = session(60.0, 0.03, 1.0);
        one_sided.iter_mut().for_each(|s| s.y_m = None);
        let learnt = calibrate(&Rig::chapter("a"), &[one_sided], "", "").unwrap();
        assert!(learnt.axes.x.is_some() && learnt.axes.y.is_none());
    }
}
