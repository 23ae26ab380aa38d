//! `offbd trends`: the sessions of one rig, oldest first.

use super::bench::Bench;

/// A learnt rig, and sessions in which its x servo loses 2 % of its gain each.
fn bench() -> (Bench, String) {
    let bench = Bench::new();
    bench.calibrated();
    let mut names = Vec::new();
    for i in 0..10 {
        let (name, gain) = (format!("s{i}.csv"), 1.0 - 0.02 * f64::from(i));
        let session = format!("simulate --reference lissajous --seed {} -o {name}", 100 + i);
        bench.ok(&format!("{session} --fault x_servo:gain={gain}@0"));
        names.push(name);
    }
    (bench, names.join(" "))
}

#[test]
fn a_drift_is_shown_and_warned_of() {
    let (bench, names) = bench();
    let table = bench.ok(&format!("trends --asset learnt.json {names}")).stdout;
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    let last: Vec<&str> = table.lines().filter(|line| line.starts_with("warning: ")).collect();
    assert_eq!(last.len(), 1, "{table}");
    assert!(last[0].starts_with("warning: x_servo: its gain is "), "{table}");

    let lines = bench.ok(&format!("trends --asset learnt.json --format json {names}")).json();
    let [view] = &lines[..] else { panic!("one object") };
    assert_eq!((view["points"].as_array().unwrap().len(), &view["asset"]), (10, &"chapter".into()));
    let summary = view["trends"][0]["warning"]["summary"].as_str().unwrap();
    assert!(summary.contains("falls; at this slope it reaches"), "{summary}");
}

#[test]
fn too_few_sessions_and_a_rig_that_is_not_learnt_are_told() {
    let (bench, _) = bench();
    let few = bench.ok("trends --asset learnt.json s0.csv s1.csv").stdout;
    assert!(few.contains("7 sessions with enough motion make a trend; there are fewer"), "{few}");
    let refused = bench.run(3, "trends --asset rig.json s0.csv").stderr;
    assert!(refused.contains("it has no calibration"), "{refused}");
}
