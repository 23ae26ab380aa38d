//! What a servo's effective parameters are, and which kinds of fault answer
//! like that.
//!
//! Each kind fixes some of the parameters and leaves others free: a horn that
//! slipped answers its command in full (gain 1, no delay) with any offset, a
//! dead servo not at all (gain 0) with none. How far the estimate is from that,
//! in its own covariance, is how unlikely the kind is; each free parameter that
//! it needs costs one nat (Akaike 1974).

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use nalgebra::{Matrix3, Vector3};

use super::filter::{Filter, PARAMETERS};
use crate::vocabulary::FaultKind;

/// What a kind says of offset, gain change and delay: none where it leaves
/// them open.
type Claim = [Option<f64>; PARAMETERS];

/// The kinds that a moment's answer can tell.
const CLAIMS: [(FaultKind, Claim); 6] = [
    (FaultKind::Dead, [Some(0.0), Some(-1.0), Some(0.0)]),
    (FaultKind::Held, [None, Some(-1.0), Some(0.0)]),
    (FaultKind::Reversed, [Some(0.0), Some(-2.0), Some(0.0)]),
    (FaultKind::Gain, [Some(0.0), None, Some(0.0)]),
    (FaultKind::Offset, [None, Some(0.0), Some(0.0)]),
    (FaultKind::Slow, [Some(0.0), Some(0.0), None]),
];

/// How near to a claim counts as there: m/s², 1, s. No fault is as clean as
/// its name.
const TOLERANCE: [f64; PARAMETERS] = [0.05, 0.1, 0.03];

/// What a free parameter costs, nats.
const FREE_NATS: f64 = 1.0;

/// Evidence from which it is asked of which kind a fault would be, nats.
const ASKED_NATS: f64 = 4.0;

/// Likelihood of a kind, among all, from which it is named.
const NAMED: f64 = 0.5;

/// A servo's effective parameters of late, against the twin's, with their
/// standard errors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Answer {
    /// Acceleration that no command explains, m/s².
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    /// Share of the command that the ball answers; 1 is healthy.
    pub gain: f64,
    pub gain_error: f64,
    /// Delay beyond the twin's, s.
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Likelihoods of the kinds of fault that answer like this, in the order
    /// dead, held, reversed, gain, offset, slow; they sum to one, or are all
    /// zero while hardly anything speaks for a fault.
    pub likelihoods: [f64; CLAIMS.len()],
}

impl Answer {
    /// What `filter` has found while `nats` speak for a fault.
    pub(super) fn new(filter: &Filter, nats: f64) -> Self {
        let [offset, gain, delay] = core::array::from_fn(|k| filter.parameter(k));
        Self {
            offset_m_s2: offset.0,
            offset_error_m_s2: offset.1.sqrt(),
            gain: 1.0 + gain.0,
            gain_error: gain.1.sqrt(),
            delay_s: delay.0,
            delay_error_s: delay.1.sqrt(),
            likelihoods: match nats >= ASKED_NATS {
                true => likelihoods([offset.0, gain.0, delay.0], &filter.spread()),
                false => Default::default(),
            },
        }
    }

    /// The kinds of fault that answer like this and how likely each is.
    pub fn kinds(&self) -> impl Iterator<Item = (FaultKind, f64)> {
        CLAIMS.iter().map(|&(kind, _)| kind).zip(self.likelihoods)
    }

    /// The kind of fault that answers like this; none where it could as well
    /// be another.
    #[must_use]
    pub fn kind(&self) -> Option<FaultKind> {
        self.kinds().find(|&(_, likelihood)| likelihood > NAMED).map(|(kind, _)| kind)
    }
}

fn likelihoods(
    found: [f64; PARAMETERS],
    spread: &[[f64; PARAMETERS]; PARAMETERS],
) -> [f64; CLAIMS.len()] {
    let nats = CLAIMS.map(|(_, claim)| -distance_nats(found, spread, &claim));
    let most = nats.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = nats.iter().map(|n| (n - most).exp()).sum();
    nats.map(|n| (n - most).exp() / sum)
}

/// How far the estimate is from the claim, nats. A parameter left open counts
/// with an error without bounds.
fn distance_nats(
    found: [f64; PARAMETERS],
    spread: &[[f64; PARAMETERS]; PARAMETERS],
    claim: &Claim,
) -> f64 {
    const OPEN: f64 = 1e6;
    let mut covariance = Matrix3::from_fn(|i, j| spread[i][j]);
    let mut off = Vector3::zeros();
    let mut price = 0.0;
    for k in 0..PARAMETERS {
        covariance[(k, k)] += TOLERANCE[k] * TOLERANCE[k];
        match claim[k] {
            Some(claimed) => off[k] = found[k] - claimed,
            None => {
                covariance[(k, k)] += OPEN;
                price += FREE_NATS;
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
        Answer { likelihoods, ..Answer::default() }.kind()
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
