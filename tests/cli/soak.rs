use serde_json::Value;

use crate::bench::Bench;

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
    assert_ne!(first, figures(&bench, "--seed 3 --calibration-sessions 1"));
}

/// Nothing can be learnt from a ball that is never asked to move.
#[test]
fn a_rig_that_cannot_be_learnt_is_named_with_the_reason() {
    let bench = Bench::new();
    let done =
        (1..40).map(|seed| bench.ok(&format!("{HOUR} --seed {seed} --calibration-sessions 1")));
    let refused = done.into_iter().find(|done| done.json()[0]["refused"] == 1).unwrap();
    let said = refused.json()[0]["refusals"][0].as_str().unwrap().to_owned();
    assert!(said.contains(": x: ") || said.contains(": y: "), "{said}");
    assert!(refused.stderr.contains(&format!("not watched: {said}")), "{}", refused.stderr);
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
