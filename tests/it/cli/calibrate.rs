use serde_json::Value;

use super::bench::Bench;

#[test]
fn a_rig_is_learnt_near_its_truth() {
    let bench = Bench::new();
    bench.ok("simulate --rig rig.json --reference lissajous --seconds 90 --seed 7 -o healthy.csv");
    let told = bench.ok("calibrate --asset rig.json healthy.csv -o learnt.json");
    assert!(told.stderr.contains("gain") && told.stdout.is_empty());
    let asset: Value = serde_json::from_str(&bench.read("learnt.json")).unwrap();
    let learnt = &asset["calibration"];
    // The preset's truth: gain 1 and 0.96, level 8 mrad and −5 mrad; play and
    // drag blur the gain.
    let number = |axis: &str, name: &str| learnt[axis][name].as_f64().unwrap();
    assert!((number("x", "level_rad") - 0.008).abs() < 1e-3);
    assert!((number("y", "level_rad") + 0.005).abs() < 1e-3);
    assert!((number("x", "gain") - 1.0).abs() < 0.05);
    assert!((number("y", "gain") - 0.96).abs() < 0.05);
    assert_eq!(
        learnt["samples"].as_u64(),
        Some(bench.read("healthy.csv").lines().count() as u64 - 1)
    );
}

#[test]
fn stdout_and_several_sessions_will_do() {
    let bench = Bench::new();
    bench.ok("simulate --rig rig.json --seconds 40 -o a.csv");
    bench.ok("simulate --seconds 40 --seed 2 -o b.csv");
    let done = bench.ok("calibrate --asset rig.json a.csv b.csv -o -");
    let asset: Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(asset["calibration"]["data_sha256"].as_str().unwrap().len(), 64);
}

/// A healthy session with its columns changed: `t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m`.
fn changed(bench: &Bench, name: &str, factors: [f64; 5]) {
    bench.ok("simulate --rig rig.json --reference lissajous --seconds 30 --seed 7 -o healthy.csv");
    let text = bench.read("healthy.csv");
    let cell = |(field, factor): (&str, f64)| {
        field.parse::<f64>().map_or_else(|_| field.to_owned(), |v| (v * factor).to_string())
    };
    let row = |line: &str| line.split(',').zip(factors).map(cell).collect::<Vec<_>>().join(",");
    bench.write(name, &text.lines().map(row).collect::<Vec<_>>().join("\n"));
}

#[test]
fn units_that_cannot_be_are_refused_and_suggested() {
    let bench = Bench::new();
    for (factors, words) in [
        ([1e3, 1.0, 1.0, 1.0, 1.0], "is t_s in ms?"),
        ([1.0, 57.3, 57.3, 1.0, 1.0], "is axes.command_unit_rad 0.0175?"),
        ([1.0, 1.0, 1.0, 1e3, 1e3], "is axes.position_unit_m 0.001?"),
    ] {
        changed(&bench, "other.csv", factors);
        let refused = bench.run(3, "calibrate --asset rig.json other.csv -o out.json");
        assert!(refused.stderr.contains(words), "{}", refused.stderr);
    }
    assert!(!bench.path("out.json").exists());
}

#[test]
fn what_cannot_be_learnt_is_refused_with_a_sentence_and_nothing_written() {
    let bench = Bench::new();
    bench.ok("simulate --rig rig.json --seconds 8 -o short.csv");
    let too_short = bench.run(3, "calibrate --asset rig.json short.csv -o out.json");
    assert!(too_short.stderr.contains("cannot calibrate"), "{}", too_short.stderr);
    assert!(too_short.stderr.contains("needed"), "{}", too_short.stderr);
    assert!(!bench.path("out.json").exists());
}
