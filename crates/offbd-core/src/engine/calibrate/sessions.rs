//! What differs from session to session: the mean over sessions and how far a
//! session lies from it, with a population of rigs behind it where sessions are
//! few.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// An estimate with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) error: f64,
}

/// Two independent estimates of the same.
pub(super) fn combined(a: Option<Estimate>, b: Option<Estimate>) -> Option<Estimate> {
    let (Some(a), Some(b)) = (a, b) else { return a.or(b) };
    let (p, q) = (a.error.powi(-2), b.error.powi(-2));
    Some(Estimate { value: (p * a.value + q * b.value) / (p + q), error: (p + q).sqrt().recip() })
}

/// A quantity that differs between sessions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Between {
    pub(super) mean: f64,
    /// Standard deviation from session to session.
    pub(super) deviation: f64,
}

/// The standard deviation between sessions that a population of rigs shows, and
/// how many sessions of the rig itself it counts as.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Population {
    pub(super) deviation: f64,
    pub(super) n_sessions: f64,
}

/// Mean and spread of `sessions`: method of moments (DerSimonian & Laird 1986),
/// the population counting as so many sessions more. None without a session.
pub(super) fn between(sessions: &[Estimate], population: &Population) -> Option<Between> {
    let usable = || sessions.iter().filter(|s| s.value.is_finite() && s.error.is_finite());
    let n = usable().count() as f64;
    if n == 0.0 {
        return None;
    }
    let prior = population.deviation * population.deviation;
    let mut variance = prior;
    let mut mean = 0.0;
    // The weights depend on the variance: a few rounds settle both.
    for _ in 0..10 {
        let weight = |s: &Estimate| 1.0 / (variance + s.error * s.error);
        let total: f64 = usable().map(weight).sum();
        mean = usable().map(|s| weight(s) * s.value).sum::<f64>() / total;
        let excess = |s: &Estimate| {
            // Shrunk to the mean by what its own error leaves open.
            let share = variance / (variance + s.error * s.error);
            let off = share * (s.value - mean);
            off * off + share * s.error * s.error
        };
        let sum: f64 = usable().map(excess).sum();
        variance = (population.n_sessions * prior + sum * (n - 1.0).max(0.0) / n)
            / (population.n_sessions + n - 1.0);
    }
    Some(Between { mean, deviation: variance.sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const POPULATION: Population = Population { deviation: 0.02, n_sessions: 1.0 };

    fn estimates(values: &[f64], error: f64) -> Vec<Estimate> {
        values.iter().map(|&value| Estimate { value, error }).collect()
    }

    #[test]
    fn one_session_leaves_the_population() {
        let found = between(&estimates(&[0.01], 1e-4), &POPULATION).unwrap();
        assert!((found.mean - 0.01).abs() < 1e-12 && (found.deviation - 0.02).abs() < 1e-12);
        assert_eq!(between(&[], &POPULATION), None);
    }

    #[test]
    fn many_sessions_speak_for_themselves() {
        let values: Vec<f64> = (0..40).map(|i| if i % 2 == 0 { 0.05 } else { -0.05 }).collect();
        let found = between(&estimates(&values, 1e-4), &POPULATION).unwrap();
        assert!(found.mean.abs() < 1e-12 && (found.deviation - 0.05).abs() < 2e-3, "{found:?}");
        let alike = between(&estimates(&[0.01; 40], 1e-4), &POPULATION).unwrap();
        assert!(alike.deviation < 0.005, "{alike:?}");
    }

    #[test]
    fn what_an_estimate_may_be_off_by_is_no_spread() {
        let values: Vec<f64> = (0..40).map(|i| if i % 2 == 0 { 0.05 } else { -0.05 }).collect();
        let found = between(&estimates(&values, 0.05), &POPULATION).unwrap();
        assert!(found.deviation < 0.03, "{found:?}");
    }
}
