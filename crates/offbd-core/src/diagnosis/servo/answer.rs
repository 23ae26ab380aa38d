//! The effective parameters of a servo, and the kinds of fault that match them.
//!
//! Each kind fixes some parameters and leaves others free: a slipped horn answers its
//! command in full (gain 1, no delay) with any offset, a dead servo not at all (gain 0)
//! without an offset. The distance of the estimate from these values, in its own
//! covariance, is the log-likelihood of the kind; each free parameter costs one nat
//! (Akaike 1974).

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::filter::{PARAMETERS, ServoFilter};
use crate::vocabulary::FaultKind;

/// The values of offset, gain change and delay for a kind of fault; `None` if free.
type KindSignature = [Option<f64>; PARAMETERS];

/// The kinds that can be told from the parameters at one moment.
const SIGNATURES: [(FaultKind, KindSignature); 6] = [
    (FaultKind::Dead, [Some(0.0), Some(-1.0), Some(0.0)]),
    (FaultKind::Held, [None, Some(-1.0), Some(0.0)]),
    (FaultKind::Reversed, [Some(0.0), Some(-2.0), Some(0.0)]),
    (FaultKind::Gain, [Some(0.0), None, Some(0.0)]),
    (FaultKind::Offset, [None, Some(0.0), Some(0.0)]),
    (FaultKind::Slow, [Some(0.0), Some(0.0), None]),
];

/// Tolerance of the values in [`SIGNATURES`]: offset m/s², gain change 1, delay s.
/// Chosen: no real fault matches its definition exactly.
const TOLERANCE: [f64; PARAMETERS] = [0.05, 0.1, 0.03];

/// Cost of a free parameter, nats (Akaike 1974).
const FREE_PARAMETER_NATS: f64 = 1.0;

/// Evidence from which on the kind of fault is determined, nats. Chosen: well below what
/// makes a servo suspected.
const CLASSIFIED_NATS: f64 = 4.0;

/// Likelihood from which on a kind is named. Chosen: likelier than all others together.
const NAMED_LIKELIHOOD: f64 = 0.5;

/// The recent effective parameters of a servo relative to the twin's, with their standard
/// errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ServoAnswer {
    /// Acceleration that no command explains, m/s².
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    /// Fraction of the command that the ball answers; 1 is healthy.
    pub gain: f64,
    pub gain_error: f64,
    /// Delay beyond the twin's, s.
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Likelihoods of the kinds of fault in the order dead, held, reversed, gain, offset,
    /// slow; they sum to one, or are all zero while there is hardly any evidence for a
    /// fault.
    pub likelihoods: [f64; SIGNATURES.len()],
}

impl ServoAnswer {
    /// Evaluates `filter`, with evidence `nats` for a fault.
    pub(super) fn new(filter: &ServoFilter, nats: f64) -> Self {
        let [offset, gain, delay] = core::array::from_fn(|k| filter.parameter(k));
        Self {
            offset_m_s2: offset.0,
            offset_error_m_s2: offset.1.sqrt(),
            gain: 1.0 + gain.0,
            gain_error: gain.1.sqrt(),
            delay_s: delay.0,
            delay_error_s: delay.1.sqrt(),
            likelihoods: match nats >= CLASSIFIED_NATS {
                true => likelihoods([offset.0, gain.0, delay.0], &filter.spread()),
                false => Default::default(),
            },
        }
    }

    /// The kinds of fault and their likelihoods.
    pub fn kinds(&self) -> impl Iterator<Item = (FaultKind, f64)> {
        SIGNATURES.iter().map(|&(kind, _)| kind).zip(self.likelihoods)
    }

    /// Returns the kind of fault if one is likelier than all others together.
    #[must_use]
    pub fn kind(&self) -> Option<FaultKind> {
        self.kinds().find(|&(_, likelihood)| likelihood > NAMED_LIKELIHOOD).map(|(kind, _)| kind)
    }
}

fn likelihoods(
    found: [f64; PARAMETERS],
    spread: &[[f64; PARAMETERS]; PARAMETERS],
) -> [f64; SIGNATURES.len()] {
    let nats = SIGNATURES.map(|(_, signature)| -distance_nats(found, spread, &signature));
    let most = nats.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = nats.iter().map(|n| (n - most).exp()).sum();
    nats.map(|n| (n - most).exp() / sum)
}

/// Distance of the estimate from the signature, nats. A free parameter is given a
/// practically unbounded variance.
fn distance_nats(
    found: [f64; PARAMETERS],
    spread: &[[f64; PARAMETERS]; PARAMETERS],
    signature: &KindSignature,
) -> f64 {
    const UNBOUNDED_VARIANCE: f64 = 1e6;
    let mut covariance = Matrix3::from_fn(|i, j| spread[i][j]);
    let mut off = Vector3::zeros();
    let mut price = 0.0;
    for k in 0..PARAMETERS {
        covariance[(k, k)] += TOLERANCE[k] * TOLERANCE[k];
        match signature[k] {
            Some(claimed) => off[k] = found[k] - claimed,
            None => {
                covariance[(k, k)] += UNBOUNDED_VARIANCE;
                price += FREE_PARAMETER_NATS;
            }
        }
    }
    let inverse = covariance.try_inverse().unwrap_or_else(Matrix3::zeros);
    price + 0.5 * off.dot(&(inverse * off))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind(found: [f64; 3], error: f64) -> Option<FaultKind> {
        let mut spread = [[0.0; 3]; 3];
        for (k, row) in spread.iter_mut().enumerate() {
            row[k] = error * error;
        }
        let likelihoods = likelihoods(found, &spread);
        assert!((likelihoods.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        ServoAnswer { likelihoods, ..ServoAnswer::default() }.kind()
    }

    #[test]
    fn kinds_are_told_apart() {
        assert_eq!(kind([0.0, -0.97, 0.01], 0.02), Some(FaultKind::Dead));
        assert_eq!(kind([0.4, -1.02, 0.0], 0.02), Some(FaultKind::Held));
        assert_eq!(kind([0.02, -2.1, 0.0], 0.02), Some(FaultKind::Reversed));
        assert_eq!(kind([0.0, -0.5, 0.0], 0.02), Some(FaultKind::Gain));
        assert_eq!(kind([-0.3, 0.05, 0.0], 0.02), Some(FaultKind::Offset));
        assert_eq!(kind([0.0, 0.0, 0.2], 0.02), Some(FaultKind::Slow));
    }

    #[test]
    fn what_is_not_known_is_not_named() {
        assert_eq!(kind([0.1, -0.5, 0.05], 2.0), None);
    }
}
