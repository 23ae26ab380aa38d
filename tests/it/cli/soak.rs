use serde_json::Value;

use super::bench::Bench;

/// An hour of one rig.
const HOUR: &str = "soak --rig-days 0.04 --jobs 1 --format json";

fn figures(bench: &Bench, line: &str) -> Value {
    bench.ok(&format!("{HOUR} {line}")).json().remove(0)
}

#[test]
fn equal_seeds_come_to_equal_figures_and_a_rig_is_watched_or_refused() {
    let bench = Bench::new();
    let first = figures(&bench, "--seed 3");
    assert_eq!(first, figures(&bench, "--seed 3"));
    let count = |key: &str| first[key].as_u64().unwrap();
    assert_eq!(count("rigs") + count("refused"), 1);
    assert_eq!(first["refusals"].as_array().unwrap().len() as u64, count("refused"));
    let alarms = first["alarms"].as_array().unwrap().len() as f64;
    let rates = first["alarms_per_rig_day"].as_object().unwrap().values();
    let per_hour = rates.map(|rate| rate.as_f64().unwrap() / 24.0).sum::<f64>();
    assert!((per_hour - alarms).abs() < 1e-9, "{per_hour} an hour are not {alarms}");
}

/// In these two minutes the ball hardly moves.
#[test]
fn a_rig_that_cannot_be_learnt_is_named_with_the_reason() {
    let bench = Bench::new();
    let done = bench.ok(&format!("{HOUR} --seed 45 --calibration-sessions 1"));
    let figures = &done.json()[0];
    assert_eq!((&figures["refused"], &figures["rigs"]), (&1.into(), &0.into()));
    let said = figures["refusals"][0].as_str().unwrap();
    assert!(said.contains(": x: ") || said.contains(": y: "), "{said}");
    assert!(done.stderr.contains(&format!("not watched: {said}")), "{}", done.stderr);
}

#[test]
fn bad_numbers_are_refused_by_their_option() {
    let bench = Bench::new();
    for (line, said) in [
        ("--variety wild", "presets, real"),
        ("--calibration-sessions 0", "1..=30"),
        ("--rig-days 0", "--rig-days"),
    ] {
        assert!(bench.run(2, &format!("soak {line}")).stderr.contains(said), "{line}");
    }
}
