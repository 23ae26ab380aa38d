//! Tests against published figures, by counting, and on known drifts.

use super::*;
use proptest::prelude::*;

const GAIN: Band = Band { low: 0.7, nominal: 1.0, high: 1.3 };

/// Deterministic, approximately normal noise: the sum of twelve uniform numbers less six.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Sen 1968, section 6: times 1, 2, 3, 4, 10, 12, 18 and a slope of 4. The points of the
/// example are at unequal times; sessions without an estimate stand for the times
/// between.
#[test]
fn validate_sens_own_example() {
    let mut values = [f64::NAN; 18];
    for (t, y) in [(1, 9.0), (2, 15.0), (3, 19.0), (4, 20.0), (10, 45.0), (12, 55.0), (18, 78.0)] {
        values[t - 1] = y;
    }
    let trend = Trend::of(&values, 1.0).unwrap();
    assert_eq!((trend.slope, trend.n_sessions), (4.0, 7));
    assert!(trend.is_significant(), "{trend:?}");
}

/// Tables of Student's distribution, two-sided 99.9 % (Abramowitz & Stegun 1964, table
/// 26.10).
#[test]
fn validate_quantiles_of_student() {
    for (freedom, tabled) in [(10.0, 4.587), (12.0, 4.318), (20.0, 3.850), (60.0, 3.460)] {
        let found = student_quantile(freedom);
        assert!((found / tabled - 1.0).abs() < 3e-3, "{freedom}: {found}, not {tabled}");
    }
}

/// Sessions without a drift: as few have a significant slope as stated, where they scatter
/// as usual or less; where they scatter twice as much, not more than 1 %.
#[test]
fn validate_how_often_chance_makes_a_drift() {
    for (scatter, most) in [(0.01, 0.001_f64), (0.02, 0.001), (0.04, 0.01)] {
        for n in [LEAST_SESSIONS, 8, 12] {
            let drifts = (1..=10_000).filter(|&seed| {
                let mut noise = noise(seed);
                let values: Vec<f64> = (0..n).map(|_| scatter * noise()).collect();
                Trend::of(&values, 0.02).unwrap().is_significant()
            });
            let (drifts, most) = (drifts.count() as f64, 10_000.0 * most);
            // Plus four standard deviations of a binomial.
            assert!(drifts <= most + 4.0 * most.sqrt(), "{n} by {scatter}: {drifts}");
        }
    }
}

/// A gain that falls by 2 % a session is warned of with the sixth in most rigs that scatter
/// by 1 %.
#[test]
fn six_sessions_tell_a_drift_of_two_percent() {
    let warned = |seed: u64| {
        let mut noise = noise(seed);
        let values: Vec<f64> = (0..6).map(|i| 1.0 - 0.02 * f64::from(i) + 0.01 * noise()).collect();
        let trend = Trend::of(&values, 0.02).unwrap();
        matches!(warning(&trend, &GAIN, 20.0), Some(Warning::Crosses { .. }))
    };
    let n = (1..=200).filter(|&seed| warned(seed)).count();
    assert!(n > 100, "{n} of 200");
}

/// Healthy rigs: the fraction with a significant drift is as small as designed, and none
/// is warned of.
#[test]
fn validate_that_no_drift_is_not_a_warning() {
    let mut drifts = 0;
    for seed in 1..=1000 {
        let mut noise = noise(seed);
        let values: Vec<f64> = (0..30).map(|_| 1.0 + 0.02 * noise()).collect();
        let trend = Trend::of(&values, 0.02).unwrap();
        drifts += u32::from(trend.is_significant());
        assert_eq!(warning(&trend, &GAIN, 20.0), None, "{trend:?}");
    }
    // 0.1 % of 1000, plus four standard deviations of a binomial.
    assert!(drifts <= 5, "{drifts}");
}

/// The level at the last session over many runs with a known slope: the stated error
/// agrees with the observed one within a third.
#[test]
fn validate_the_error_of_the_level() {
    let (mut squares, mut stated) = (0.0, 0.0);
    for seed in 1..=500 {
        let mut noise = noise(seed);
        let values: Vec<f64> = (0..20).map(|i| 0.01 * f64::from(i) + 0.02 * noise()).collect();
        let trend = Trend::of(&values, 0.02).unwrap();
        squares += (trend.level - 0.19_f64).powi(2);
        stated += trend.level_error;
    }
    let (found, stated) = ((squares / 500.0_f64).sqrt(), stated / 500.0);
    assert!((stated / found - 1.0).abs() < 0.33, "found {found}, stated {stated}");
}

/// A servo that loses half a percent of its gain per session crosses 0.7 in its sixtieth;
/// the warning comes within the horizon and predicts that session.
#[test]
fn validate_that_a_known_drift_is_warned_of_in_time() {
    for seed in 1..=200 {
        let mut noise = noise(seed);
        let values: Vec<f64> =
            (0..60).map(|i| 1.0 - 0.005 * f64::from(i) + 0.01 * noise()).collect();
        let warned = |n: usize| {
            let trend = Trend::of(&values[..n], 0.02)?;
            warning(&trend, &GAIN, 20.0)
        };
        assert_eq!(warned(15), None, "45 sessions ahead is beyond the horizon");
        let Some(Warning::Crosses { sessions }) = warned(50) else { panic!("{:?}", warned(50)) };
        // The line crosses where 0.005 (i + sessions) is 0.3.
        assert!((sessions - 11.0).abs() < 3.0, "seed {seed}: {sessions}");
        assert!(warned(45).is_some());
    }
}

#[test]
fn wild_sessions_do_not_move_the_line() {
    let mut values: Vec<f64> = (0..20).map(|i| 1.0 - 0.01 * f64::from(i)).collect();
    for i in [2, 9, 13, 18] {
        values[i] = 50.0;
    }
    let trend = Trend::of(&values, 0.02).unwrap();
    assert!((trend.slope + 0.01).abs() < 1e-3, "{trend:?}");
    assert!((trend.level - 0.81).abs() < 0.02, "{trend:?}");
}

#[test]
fn a_step_that_stays_is_a_drift_beyond_half_the_limit() {
    let trend = Trend::of(&[0.8; 12], 0.02).unwrap();
    assert_eq!((trend.slope, trend.is_significant()), (0.0, false));
    let Some(Warning::Drifted { share }) = warning(&trend, &GAIN, 20.0) else { panic!() };
    assert!((share - 2.0 / 3.0).abs() < 1e-12);
    let unsure = Trend { level_error: 0.05, ..trend };
    assert_eq!(warning(&unsure, &GAIN, 20.0), None, "not sure enough");
    let small = Trend::of(&[0.9; 12], 0.02).unwrap();
    assert_eq!(warning(&small, &GAIN, 20.0), None);
    assert_eq!(Trend::of(&[1.0; LEAST_SESSIONS - 1], 0.02), None);
}

proptest! {
    /// Scale and offset of the values transform the line accordingly; a negative scale
    /// mirrors it.
    #[test]
    fn the_line_goes_with_its_units(
        values in prop::collection::vec(-10.0..10.0_f64, LEAST_SESSIONS..40),
        scale in prop_oneof![-5.0..-0.1_f64, 0.1..5.0_f64],
        offset in -5.0..5.0_f64,
    ) {
        let trend = Trend::of(&values, 0.02).unwrap();
        let other: Vec<f64> = values.iter().map(|v| scale * v + offset).collect();
        let other = Trend::of(&other, 0.02 * scale.abs()).unwrap();
        prop_assert!((other.slope - scale * trend.slope).abs() < 1e-9);
        prop_assert!((other.level - scale * trend.level - offset).abs() < 1e-8);
        prop_assert_eq!(other.is_significant(), trend.is_significant());
        prop_assert!(trend.slope_low <= trend.slope && trend.slope <= trend.slope_high);
    }

    /// A predicted crossing occurs on the line at that session, and not before.
    #[test]
    fn a_warning_comes_true_along_the_line(
        slope in -0.05..0.05_f64,
        start in 0.8..1.2_f64,
    ) {
        let values: Vec<f64> = (0..10).map(|i| start + slope * f64::from(i)).collect();
        let trend = Trend::of(&values, 0.02).unwrap();
        let level = |ahead: f64| start + slope * (9.0 + ahead);
        if let Some(Warning::Crosses { sessions }) = warning(&trend, &GAIN, 20.0) {
            prop_assert!(sessions <= 20.0);
            let inside = |v: f64| (GAIN.low - 1e-9..=GAIN.high + 1e-9).contains(&v);
            prop_assert!(sessions == 0.0 || inside(level(sessions)), "{}", level(sessions));
            prop_assert!(!inside(level(sessions + 1e-3)) || slope.abs() < 1e-4);
        }
    }
}
