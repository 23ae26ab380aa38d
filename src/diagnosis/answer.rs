//! How a servo answers its command: gain and offset of the measured over the
//! predicted acceleration, by least squares with fading memory.
//!
//! Tells the kinds apart: no answer (dead, held), a part of it (gain), the
//! wrong way round (reversed), all of it and a constant more (offset).

use crate::vocabulary::FaultKind;

/// Time constant of the memory, s: a few seconds of motion, so that a kind is
/// known when a fault is confirmed.
const MEMORY_S: f64 = 2.0;

/// Predicted acceleration below which a command excites nothing, m/s² (rms).
const LEAST_EXCITATION_M_S2: f64 = 0.1;

/// The answer of one axis over the last seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Answer {
    weight: f64,
    predicted: f64,
    measured: f64,
    predicted_squared: f64,
    product: f64,
}

impl Answer {
    /// Takes measured and predicted acceleration, m/s², `dt` after the last.
    pub fn update(&mut self, measured: f64, predicted: f64, dt: f64) {
        let fade = (-dt / MEMORY_S).exp();
        for (sum, value) in [
            (&mut self.weight, 1.0),
            (&mut self.predicted, predicted),
            (&mut self.measured, measured),
            (&mut self.predicted_squared, predicted * predicted),
            (&mut self.product, predicted * measured),
        ] {
            *sum = *sum * fade + dt * value;
        }
    }

    /// Gain and offset (m/s²) of measured = gain·predicted + offset; none
    /// while the command has excited too little.
    #[must_use]
    pub fn gain_and_offset(&self) -> Option<(f64, f64)> {
        if self.weight <= 0.0 {
            return None;
        }
        let (mean_p, mean_m) = (self.predicted / self.weight, self.measured / self.weight);
        let variance = self.predicted_squared / self.weight - mean_p * mean_p;
        if variance < LEAST_EXCITATION_M_S2 * LEAST_EXCITATION_M_S2 {
            return None;
        }
        let gain = (self.product / self.weight - mean_p * mean_m) / variance;
        Some((gain, mean_m - gain * mean_p))
    }

    /// The kind of servo fault that reads like this, beyond a deviation of
    /// `limit` m/s².
    #[must_use]
    pub fn kind(&self, limit: f64) -> Option<FaultKind> {
        let (gain, offset) = self.gain_and_offset()?;
        match gain {
            g if g < -0.3 => Some(FaultKind::Reversed),
            g if g.abs() <= 0.3 && offset.abs() < limit => Some(FaultKind::Dead),
            g if g.abs() <= 0.3 => Some(FaultKind::Held),
            g if (0.75..1.25).contains(&g) && offset.abs() >= limit / 2.0 => {
                Some(FaultKind::Offset)
            }
            g if (0.3..0.9).contains(&g) || g > 1.1 => Some(FaultKind::Gain),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(answer: impl Fn(f64) -> f64) -> Option<FaultKind> {
        let mut found = Answer::default();
        for i in 0..300 {
            let predicted = (f64::from(i) * 0.05).sin();
            found.update(answer(predicted), predicted, 0.01);
        }
        found.kind(0.2)
    }

    #[test]
    fn kinds_are_told_apart() {
        assert_eq!(after(|_| 0.0), Some(FaultKind::Dead));
        assert_eq!(after(|_| 0.5), Some(FaultKind::Held));
        assert_eq!(after(|p| 0.5 * p), Some(FaultKind::Gain));
        assert_eq!(after(|p| -p), Some(FaultKind::Reversed));
        assert_eq!(after(|p| p + 0.4), Some(FaultKind::Offset));
        assert_eq!(after(|p| p), None);
    }

    #[test]
    fn without_excitation_nothing_is_said() {
        let mut answer = Answer::default();
        for _ in 0..100 {
            answer.update(0.3, 0.0, 0.01);
        }
        assert_eq!(answer.kind(0.2), None);
    }
}
