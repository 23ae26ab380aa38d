//! Whether the ball of a recording moves as its commands ask: a wrong unit, sign or axis shows
//! there. A ball that rolls without slipping on a plate tilted by q accelerates by 5/7 g sin q.

use offbd_core::vocabulary::Sample;

/// Acceleration of a rolling solid ball for each radian of tilt, m/s²: 5/7 of 9.81 m/s².
pub(super) const ASKED_M_S2: f64 = 5.0 / 7.0 * 9.81;

/// Half the length of the window in which an acceleration is fitted, s. Chosen: long enough for
/// readings of a millimetre, short enough for a motion of a second.
const HALF_S: f64 = 0.3;

/// Delays of the plate that are tried, s, and their number. Chosen: those of servos of hobby rigs.
const DELAY_STEP_S: f64 = 0.05;
const N_DELAYS: usize = 9;

/// Fewest readings in a window, and fewest windows.
const MIN_READINGS: usize = 5;
const MIN_WINDOWS: usize = 10;

/// How the acceleration along one axis follows one command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Following {
    /// Acceleration for each unit of the command, m/s².
    pub(super) slope: f64,
    /// Coefficient of correlation.
    pub(super) correlation: f64,
}

/// The fits of both axes: `[x, y]` by `[qx, qy]`; `None` without enough data.
pub(super) type Motion = [[Option<Following>; 2]; 2];

/// Compares the motion along each axis with each command.
pub(super) fn compare(samples: &[Sample]) -> Motion {
    let positions = [series(samples, |s| s.x_m), series(samples, |s| s.y_m)];
    let commands = [series(samples, |s| s.cmd_qx_rad), series(samples, |s| s.cmd_qy_rad)];
    positions.map(|position| {
        let accelerations = accelerations(&position);
        [0, 1].map(|i| following(&accelerations, &commands[i]))
    })
}

fn series(samples: &[Sample], value: impl Fn(&Sample) -> Option<f64>) -> Vec<(f64, f64)> {
    samples.iter().filter_map(|sample| Some((sample.t_s, value(sample)?))).collect()
}

/// Returns the times and the accelerations of windows, by least squares of a parabola.
fn accelerations(position: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let Some((mut center, end)) =
        position.first().zip(position.last()).map(|(a, b)| (a.0 + HALF_S, b.0))
    else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut first = 0;
    // A gap of hours is crossed in one step.
    while center + HALF_S <= end && first < position.len() {
        first += position[first..].iter().take_while(|(t, _)| *t < center - HALF_S).count();
        let window = position[first..].iter().take_while(|(t, _)| *t <= center + HALF_S);
        let window: Vec<(f64, f64)> = window.map(|(t, value)| (t - center, *value)).collect();
        if let Some(acceleration) = curvature(&window) {
            found.push((center, acceleration));
        }
        let next = position.get(first).map_or(end, |(t, _)| *t);
        let next_center = (center + HALF_S).max(next);
        // Times so large that they do not differ by half a window.
        if next_center <= center {
            break;
        }
        center = next_center;
    }
    found
}

/// Returns the second derivative of a parabola through the points.
fn curvature(points: &[(f64, f64)]) -> Option<f64> {
    let (first, last) = (points.first()?.0, points.last()?.0);
    if points.len() < MIN_READINGS || last - first < HALF_S {
        return None;
    }
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(f64, f64) -> f64| points.iter().map(|(t, x)| f(*t, *x)).sum::<f64>() / n;
    let t1 = mean(&|t, _| t);
    // Orthogonal polynomials about the mean time.
    let variance = mean(&|t, _| (t - t1).powi(2));
    let skew = mean(&|t, _| (t - t1).powi(3));
    let bend = |t: f64| (t - t1).powi(2) - variance - skew / variance * (t - t1);
    let size = mean(&|t, _| bend(t).powi(2));
    let curve = mean(&|t, x| bend(t) * x) / size;
    (2.0 * curve).is_finite().then_some(2.0 * curve)
}

/// Fits the accelerations by the mean command in their windows, at the delay that explains most.
fn following(accelerations: &[(f64, f64)], command: &[(f64, f64)]) -> Option<Following> {
    let fits = (0..N_DELAYS).filter_map(|i| {
        let pairs = pairs(accelerations, command, i as f64 * DELAY_STEP_S);
        regression(&pairs)
    });
    fits.max_by(|a, b| a.correlation.abs().total_cmp(&b.correlation.abs()))
}

fn pairs(accelerations: &[(f64, f64)], command: &[(f64, f64)], delay_s: f64) -> Vec<(f64, f64)> {
    let mut first = 0;
    let mut pairs = Vec::new();
    for (t, acceleration) in accelerations {
        let center = t - delay_s;
        first += command[first..].iter().take_while(|(t, _)| *t < center - HALF_S).count();
        let window = command[first..].iter().take_while(|(t, _)| *t <= center + HALF_S);
        let (n, sum) = window.fold((0, 0.0), |(n, sum), (_, value)| (n + 1, sum + value));
        if n >= MIN_READINGS {
            pairs.push((sum / f64::from(n as u32), *acceleration));
        }
    }
    pairs
}

fn regression(pairs: &[(f64, f64)]) -> Option<Following> {
    if pairs.len() < MIN_WINDOWS {
        return None;
    }
    let n = pairs.len() as f64;
    let (sum_u, sum_a) = pairs.iter().fold((0.0, 0.0), |(u, a), pair| (u + pair.0, a + pair.1));
    let (mean_u, mean_a) = (sum_u / n, sum_a / n);
    let moment = |f: &dyn Fn(f64, f64) -> f64| {
        pairs.iter().map(|(u, a)| f(u - mean_u, a - mean_a)).sum::<f64>()
    };
    let (uu, ua, aa) = (moment(&|u, _| u * u), moment(&|u, a| u * a), moment(&|_, a| a * a));
    let (slope, correlation) = (ua / uu, ua / (uu * aa).sqrt());
    correlation.is_finite().then_some(Following { slope, correlation })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_too_large_to_differ_have_no_acceleration() {
        let position: Vec<_> =
            (0..20).map(|i| (1e17 + f64::from(i) * 100.0, f64::from(i))).collect();
        assert_eq!(accelerations(&position), []);
        assert_eq!(accelerations(&[(0.0, 1.0), (0.1, 1.0), (1e300, 1.0)]), []);
    }

    /// A frictionless ball on a plate that tilts by a sine: x = −7 q₀/ω² sin ωt by twice
    /// integrating the equation of motion.
    #[test]
    fn validate_a_sine_gives_the_acceleration_of_a_rolling_ball() {
        let sample = |i: u32| {
            let t_s = f64::from(i) * 0.01;
            let qy = 0.05 * (2.0 * t_s).sin();
            let x = -ASKED_M_S2 * qy / 4.0;
            Sample {
                t_s: 1e6 + t_s,
                cmd_qx_rad: Some(0.02 * (3.1 * t_s).cos()),
                cmd_qy_rad: Some(qy),
                x_m: (i % 50 > 2).then_some(x),
                ..Sample::default()
            }
        };
        let samples: Vec<Sample> = (0..3000).map(sample).collect();
        let [[other, own], y] = compare(&samples);
        let own = own.unwrap();
        // A parabola over 0.6 s sees 1 − (ωT)²/14 = 0.97 of a sine's curvature, the mean of the
        // command 1 − (ωT)²/6 = 0.94 (expansion in ωT = 0.6).
        assert!((own.slope / ASKED_M_S2 - 1.03).abs() < 0.02, "{own:?}");
        assert!(own.correlation > 0.99 && other.unwrap().correlation.abs() < 0.5);
        assert_eq!(y, [None, None]);
    }

    #[test]
    fn a_recording_with_a_gap_of_years_ends() {
        let at =
            |t_s: f64| Sample { t_s, x_m: Some(0.0), cmd_qy_rad: Some(0.0), ..Sample::default() };
        let samples: Vec<Sample> =
            (0..100).map(|i| at(f64::from(i) * 0.01 + if i > 50 { 1e9 } else { 0.0 })).collect();
        assert!(compare(&samples).iter().flatten().all(Option::is_none));
    }
}
