//! The test signal of the estimators, in closed form: the motion of a controlled ball.

use std::f64::consts::TAU;

/// Amplitude of the acceleration (m/s²), frequency (Hz) and phase (rad) of the slow
/// part. Chosen as typical of a controlled ball: 0.25 m/s² rms, up to 1.5 Hz.
const SINES: [(f64, f64, f64); 3] = [(0.25, 0.37, 0.4), (0.2, 0.83, 1.9), (0.15, 1.49, 4.1)];

/// Height of a step of acceleration, m/s²: that of a plate at 2.5°.
const STEP: f64 = 0.3;

/// Lag of the servo that shapes the steps, s; chosen: that of the preset `chapter`.
const LAG_S: f64 = 0.05;

/// Period of the sequence of steps, s; chosen.
const CYCLE_S: f64 = 6.0;

/// Starts within a cycle, s, and heights in units of [`STEP`]. Chosen so that the velocity
/// returns to zero after each half of the cycle, and the position after the second.
const STEPS: [(f64, f64); 6] =
    [(0.5, 1.0), (1.2, -2.0), (1.9, 1.0), (3.4, -1.0), (4.1, 2.0), (4.8, -1.0)];

/// Returns the true acceleration at `t` (s), m/s².
pub(super) fn acceleration(t: f64) -> f64 {
    let sine = |&(a, f, phase): &(f64, f64, f64)| a * (TAU * f * t + phase).sin();
    SINES.iter().map(sine).sum::<f64>() + steps(t, |u| 1.0 - (-u / LAG_S).exp())
}

/// Returns the true position at `t` (s), m.
pub(super) fn position(t: f64) -> f64 {
    let sine =
        |&(a, f, phase): &(f64, f64, f64)| -a * (TAU * f * t + phase).sin() / (TAU * f).powi(2);
    let step = |u: f64| u * u / 2.0 - LAG_S * u + LAG_S * LAG_S * (1.0 - (-u / LAG_S).exp());
    SINES.iter().map(sine).sum::<f64>() + steps(t, step)
}

/// Returns the sum of the steps of the current cycle, each shaped by `response` of the
/// time since its start. Transients of earlier cycles, over 1.2 s or 24 lags old, are
/// negligible.
fn steps(t: f64, response: impl Fn(f64) -> f64) -> f64 {
    let within = t.rem_euclid(CYCLE_S);
    let begun = STEPS.iter().take_while(|(start, _)| *start <= within);
    begun.map(|(start, height)| STEP * height * response(within - start)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The central difference of fourth order at a spacing h has an error of
    /// h⁴/90·x⁽⁶⁾ ≈ 1e-9 where the signal is smooth, and a rounding error of
    /// 1e-16·0.2/h² ≈ 2e-11.
    #[test]
    fn validate_acceleration_is_the_second_derivative_of_position() {
        let h = 1e-3;
        for k in 0..4000 {
            let t = 0.011 + 0.005 * f64::from(k);
            let x = |j: f64| position(t + j * h);
            let found = (-x(-2.0) + 16.0 * x(-1.0) - 30.0 * x(0.0) + 16.0 * x(1.0) - x(2.0))
                / (12.0 * h * h);
            let wanted = acceleration(t);
            // At the start of a step the slope jumps by STEP/LAG_S.
            let kink = STEPS.iter().any(|(s, _)| (t.rem_euclid(CYCLE_S) - s).abs() < 3.0 * h);
            let tolerance = if kink { 0.05 } else { 1e-6 };
            assert!((found - wanted).abs() < tolerance, "{t}: {found} {wanted}");
        }
    }

    #[test]
    fn the_ball_stays_on_a_plate() {
        let far = (0..6000).map(|k| position(0.01 * f64::from(k)).abs()).fold(0.0, f64::max);
        assert!((0.05..0.25).contains(&far), "{far}");
    }
}
