//! `offbd trends`: the sessions of one rig, oldest first.

use super::fixture::CliFixture;

/// Writes a learnt rig and sessions in which its x servo loses 2 % of its gain each; returns
/// the names of the sessions.
fn drifting_sessions() -> (CliFixture, String) {
    let cli = CliFixture::new();
    cli.calibrated();
    let mut names = Vec::new();
    for i in 0..10 {
        let (name, gain) = (format!("s{i}.csv"), 1.0 - 0.02 * f64::from(i));
        let session = format!("simulate --reference lissajous --seed {} -o {name}", 100 + i);
        cli.ok(&format!("{session} --fault x_servo:gain={gain}@0"));
        names.push(name);
    }
    (cli, names.join(" "))
}

#[test]
fn a_drift_causes_a_warning() {
    let (cli, names) = drifting_sessions();
    let table = cli.ok(&format!("trends --asset calibrated.json {names}")).stdout;
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    let last: Vec<&str> = table.lines().filter(|line| line.starts_with("warning: ")).collect();
    assert_eq!(last.len(), 1, "{table}");
    assert!(last[0].starts_with("warning: x_servo: its gain is "), "{table}");

    let lines = cli.ok(&format!("trends --asset calibrated.json --format json {names}")).json();
    let [view] = &lines[..] else { panic!("one object") };
    assert_eq!((view["points"].as_array().unwrap().len(), &view["asset"]), (10, &"chapter".into()));
    let summary = view["trends"][0]["warning"]["summary"].as_str().unwrap();
    assert!(summary.contains("falls; at this slope it reaches"), "{summary}");
}

#[test]
fn too_few_sessions_and_a_missing_calibration_are_reported() {
    let (cli, _) = drifting_sessions();
    let few = cli.ok("trends --asset calibrated.json s0.csv s1.csv").stdout;
    assert!(few.contains("6 sessions with enough motion make a trend; only 2 so far"), "{few}");
    let refused = cli.run(3, "trends --asset rig.json s0.csv").stderr;
    assert!(refused.contains("it has no calibration"), "{refused}");
}
