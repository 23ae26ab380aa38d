//! Differences between sessions: mean and standard deviation over sessions, with a
//! population of rigs as the prior if sessions are few.

#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// An estimate with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) error: f64,
}

/// Combines two independent estimates of one quantity, weighted by their precision.
pub(super) fn combined(a: Option<Estimate>, b: Option<Estimate>) -> Option<Estimate> {
    let (Some(a), Some(b)) = (a, b) else { return a.or(b) };
    let (p, q) = (a.error.powi(-2), b.error.powi(-2));
    Some(Estimate { value: (p * a.value + q * b.value) / (p + q), error: (p + q).sqrt().recip() })
}

/// Mean and standard deviation of a quantity that differs between sessions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SessionSpread {
    pub(super) mean: f64,
    /// Standard deviation from session to session.
    pub(super) deviation: f64,
}

/// The standard deviation between sessions in a population of rigs, and the number of
/// sessions that it counts as.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Population {
    pub(super) deviation: f64,
    pub(super) n_sessions: f64,
}

/// Rounds in which weights and variance converge. Chosen.
const ROUNDS: usize = 10;

/// Returns mean and spread of `sessions` by the method of moments (DerSimonian & Laird
/// 1986), with the population as additional sessions. `None` without a session.
pub(super) fn session_spread(
    sessions: &[Estimate],
    population: &Population,
) -> Option<SessionSpread> {
    let usable = || sessions.iter().filter(|s| s.value.is_finite() && s.error.is_finite());
    let n = usable().count() as f64;
    if n == 0.0 {
        return None;
    }
    let prior = population.deviation * population.deviation;
    let mut variance = prior;
    let mut mean = 0.0;
    // The weights depend on the variance: a few rounds converge.
    for _ in 0..ROUNDS {
        let weight = |s: &Estimate| 1.0 / (variance + s.error * s.error);
        let total: f64 = usable().map(weight).sum();
        mean = usable().map(|s| weight(s) * s.value).sum::<f64>() / total;
        let excess = |s: &Estimate| {
            // Shrunk towards the mean by the uncertainty of the estimate.
            let share = variance / (variance + s.error * s.error);
            let off = share * (s.value - mean);
            off * off + share * s.error * s.error
        };
        let sum: f64 = usable().map(excess).sum();
        variance = (population.n_sessions * prior + sum * (n - 1.0).max(0.0) / n)
            / (population.n_sessions + n - 1.0);
    }
    Some(SessionSpread { mean, deviation: variance.sqrt() })
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
        let found = session_spread(&estimates(&[0.01], 1e-4), &POPULATION).unwrap();
        assert!((found.mean - 0.01).abs() < 1e-12 && (found.deviation - 0.02).abs() < 1e-12);
        assert_eq!(session_spread(&[], &POPULATION), None);
    }

    #[test]
    fn many_sessions_speak_for_themselves() {
        let values: Vec<f64> = (0..40).map(|i| if i % 2 == 0 { 0.05 } else { -0.05 }).collect();
        let found = session_spread(&estimates(&values, 1e-4), &POPULATION).unwrap();
        assert!(found.mean.abs() < 1e-12 && (found.deviation - 0.05).abs() < 2e-3, "{found:?}");
        let alike = session_spread(&estimates(&[0.01; 40], 1e-4), &POPULATION).unwrap();
        assert!(alike.deviation < 0.005, "{alike:?}");
    }

    #[test]
    fn what_an_estimate_may_be_off_by_is_not_a_spread() {
        let values: Vec<f64> = (0..40).map(|i| if i % 2 == 0 { 0.05 } else { -0.05 }).collect();
        let found = session_spread(&estimates(&values, 0.05), &POPULATION).unwrap();
        assert!(found.deviation < 0.03, "{found:?}");
    }
}
