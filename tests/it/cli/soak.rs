use serde_json::Value;

use super::fixture::CliFixture;

/// Options for about an hour of one rig.
const HOUR: &str = "soak --rig-days 0.04 --jobs 1 --format json";

fn figures(cli: &CliFixture, line: &str) -> Value {
    cli.ok(&format!("{HOUR} {line}")).json().remove(0)
}

#[test]
fn equal_seeds_give_equal_results_and_each_rig_is_counted_once() {
    let cli = CliFixture::new();
    let first = figures(&cli, "--seed 3");
    assert_eq!(first, figures(&cli, "--seed 3"));
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
fn a_failed_calibration_is_reported_with_the_reason() {
    let cli = CliFixture::new();
    let done = cli.ok(&format!("{HOUR} --seed 45 --calibration-sessions 1"));
    let figures = &done.json()[0];
    assert_eq!((&figures["refused"], &figures["rigs"]), (&1.into(), &0.into()));
    let refusal = figures["refusals"][0].as_str().unwrap();
    assert!(refusal.contains(": x: ") || refusal.contains(": y: "), "{refusal}");
    assert!(done.stderr.contains(&format!("not watched: {refusal}")), "{}", done.stderr);
}

#[test]
fn invalid_values_are_rejected_with_their_option() {
    let cli = CliFixture::new();
    for (line, expected) in [
        ("--variety wild", "presets, real"),
        ("--calibration-sessions 0", "1..=30"),
        ("--rig-days 0", "--rig-days"),
    ] {
        assert!(cli.run(2, &format!("soak {line}")).stderr.contains(expected), "{line}");
    }
}
