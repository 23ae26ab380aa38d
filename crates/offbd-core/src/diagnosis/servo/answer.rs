//! The effective parameters of a servo, and the kinds of fault that match them.
//!
//! Each kind is a distribution of the parameters: a slipped horn answers its command in full
//! (gain 1, no delay) with any offset, a dead servo not at all (gain 0) without an offset. The
//! likelihood of a kind is that of the readings, integrated over its distribution, so that a kind
//! with a free parameter, which fits whatever comes, needs more evidence than one without
//! (MacKay 1992, "Bayesian interpolation").

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::filter::{PARAMETERS, ServoFilter};
use crate::vocabulary::FaultKind;

/// Number of kinds that can be told from the parameters.
pub(super) const KINDS: usize = 6;

/// Mean and standard deviation of offset, gain change and delay for a kind of fault.
type KindSignature = [(f64, f64); PARAMETERS];

/// Standard deviations of parameters that a kind fixes: offset m/s², gain change 1, delay s.
/// Chosen: no real fault matches its definition exactly.
const FIXED: [f64; PARAMETERS] = [0.05, 0.1, 0.03];
/// Offsets of a held angle or a slipped horn, m/s²: 0.3 is 2.5 degrees.
const ANY_OFFSET: (f64, f64) = (0.0, 0.3);

/// The kinds that can be told from the parameters. A servo whose lag is τ answers a motion of ω with
/// the gain 1/(1 + ω²τ²), late by τ/(1 + ω²τ²) of the command: with ω of 2 rad/s and τ from 0.2 to
/// 1 s, 0.86 to 0.2 and 0.17 to 0.25 s; of a command that changes its mean it makes an offset for as
/// long.
const SIGNATURES: [(FaultKind, KindSignature); KINDS] = [
    (FaultKind::Dead, [(0.0, FIXED[0]), (-1.0, FIXED[1]), (0.0, FIXED[2])]),
    (FaultKind::Held, [ANY_OFFSET, (-1.0, FIXED[1]), (0.0, FIXED[2])]),
    (FaultKind::Reversed, [(0.0, FIXED[0]), (-2.0, FIXED[1]), (0.0, FIXED[2])]),
    (FaultKind::Gain, [(0.0, FIXED[0]), (-0.5, 0.3), (0.0, FIXED[2])]),
    (FaultKind::Offset, [ANY_OFFSET, (0.0, FIXED[1]), (0.0, FIXED[2])]),
    (FaultKind::Slow, [(0.0, 0.15), (-0.45, 0.3), (0.15, 0.1)]),
];

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
    /// slow; they sum to one, or are all zero while nothing speaks for a fault.
    pub likelihoods: [f64; KINDS],
}

impl ServoAnswer {
    /// The parameters of `filter`, without likelihoods.
    pub(super) fn of(filter: &ServoFilter) -> Self {
        let [offset, gain, delay] = core::array::from_fn(|k| filter.parameter(k));
        Self {
            offset_m_s2: offset.0,
            offset_error_m_s2: offset.1.sqrt(),
            gain: 1.0 + gain.0,
            gain_error: gain.1.sqrt(),
            delay_s: delay.0,
            delay_error_s: delay.1.sqrt(),
            likelihoods: [0.0; KINDS],
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

/// Returns the likelihoods of the kinds for the parameters of `filter`.
pub(super) fn likelihoods(filter: &ServoFilter) -> [f64; KINDS] {
    let spread = filter.spread();
    let Some(known) = Matrix3::from_fn(|i, j| spread[i][j]).try_inverse() else {
        return [0.0; KINDS];
    };
    let found = core::array::from_fn(|k| filter.parameter(k).0);
    let began = filter.prior().deviation.map(|deviation| 1.0 / (deviation * deviation));
    // What the readings tell, without what the filter began with.
    let told = known - Matrix3::from_diagonal(&Vector3::from(began));
    of_readings(&told, &(known * Vector3::from(found)))
}

/// Returns the likelihoods of the kinds if that of the readings is exp(moment·θ − θ·told·θ/2).
fn of_readings(told: &Matrix3<f64>, moment: &Vector3<f64>) -> [f64; KINDS] {
    let nats = SIGNATURES.map(|(_, signature)| integrated(told, moment, &signature));
    let most = nats.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = nats.iter().map(|n| (n - most).exp()).sum();
    nats.map(|n| (n - most).exp() / sum)
}

/// The logarithm of the likelihood exp(moment·θ − θ·told·θ/2), integrated over the distribution of
/// a kind, up to a constant.
fn integrated(told: &Matrix3<f64>, moment: &Vector3<f64>, signature: &KindSignature) -> f64 {
    let (mean, information) = (
        Vector3::from(signature.map(|(mean, _)| mean)),
        Vector3::from(signature.map(|(_, deviation)| 1.0 / (deviation * deviation))),
    );
    let both = told + Matrix3::from_diagonal(&information);
    let pull = moment + information.component_mul(&mean);
    let (Some(inverse), determinant) = (both.try_inverse(), both.determinant()) else {
        return f64::NEG_INFINITY;
    };
    let prior: f64 = (0..PARAMETERS)
        .map(|k| 0.5 * (information[k].ln() - information[k] * mean[k] * mean[k]))
        .sum();
    prior + 0.5 * (pull.dot(&(inverse * pull)) - determinant.max(f64::MIN_POSITIVE).ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The kind for an estimate whose parameters have the same error, each by itself.
    fn kind(found: [f64; 3], error: f64) -> Option<FaultKind> {
        let told = Matrix3::identity() / (error * error);
        let likelihoods = of_readings(&told, &(told * Vector3::from(found)));
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
        assert_eq!(kind([0.0, -0.4, 0.2], 0.02), Some(FaultKind::Slow));
    }

    #[test]
    fn what_is_not_known_is_not_named() {
        assert_eq!(kind([0.1, -0.5, 0.05], 2.0), None);
    }

    /// The integral over one parameter after the other, by the rectangle rule.
    #[test]
    fn validate_the_integral_by_quadrature() {
        let (told, moment) = ([150.0, 20.0, 400.0], [30.0, -12.0, 25.0]);
        for (kind, signature) in SIGNATURES {
            let by_sums: f64 = (0..PARAMETERS)
                .map(|k| {
                    let ((mean, deviation), n) = (signature[k], 20_000);
                    let step = 16.0 * deviation / f64::from(n);
                    let at = |i| mean - 8.0 * deviation + step * (f64::from(i) + 0.5);
                    let density = |x: f64| {
                        let z = (x - mean) / deviation;
                        let nats = moment[k] * x - told[k] * x * x / 2.0 - z * z / 2.0;
                        nats.exp() / (deviation * core::f64::consts::TAU.sqrt())
                    };
                    ((0..n).map(|i| density(at(i))).sum::<f64>() * step).ln()
                })
                .sum();
            let told = Matrix3::from_diagonal(&Vector3::from(told));
            let found = integrated(&told, &Vector3::from(moment), &signature);
            assert!((found - by_sums).abs() < 1e-9, "{kind}: {found}, not {by_sums}");
        }
    }
}
