use serde_json::Value;

use super::fixture::CliFixture;

#[test]
fn a_calibration_is_near_the_true_parameters() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig rig.json --reference lissajous --seconds 90 --seed 7 -o healthy.csv");
    let done = cli.ok("calibrate --asset rig.json healthy.csv -o calibrated.json");
    assert!(done.stderr.contains("gain") && done.stdout.is_empty());
    let table = done.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(table.contains("fewer than 2.5 a day"), "{table}");
    assert!(table.contains("from simulated rigs"), "{table}");
    let asset: Value = serde_json::from_str(&cli.read("calibrated.json")).unwrap();
    let learnt = &asset["calibration"];
    // Parameters of the preset: gain 1 and 0.96, level 8 mrad and −5 mrad; play and drag make
    // the estimate of the gain less accurate.
    let number = |axis: &str, name: &str| learnt[axis][name].as_f64().unwrap();
    assert!((number("x", "level_rad") - 0.008).abs() < 1e-3);
    assert!((number("y", "level_rad") + 0.005).abs() < 1e-3);
    assert!((number("x", "gain") - 1.0).abs() < 0.05);
    assert!((number("y", "gain") - 0.96).abs() < 0.05);
    assert_eq!(
        learnt["samples"].as_u64(),
        Some(cli.read("healthy.csv").lines().count() as u64 - 1)
    );
}

#[test]
fn several_sessions_can_be_calibrated_to_stdout() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig rig.json --seconds 40 -o a.csv");
    cli.ok("simulate --seconds 40 --seed 2 -o b.csv");
    let done = cli.ok("calibrate --asset rig.json a.csv b.csv -o -");
    let asset: Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(asset["calibration"]["data_sha256"].as_str().unwrap().len(), 64);
}

/// For a quarter of a second at 30 s the touch panel loses contact and reads its corner. What
/// was left out is still named when the asset file is read again.
#[test]
fn a_moment_in_which_the_readings_jump_is_named_and_widens_no_noise() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig rig.json --reference lissajous --seconds 60 --seed 7 -o healthy.csv");
    let lost = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
        [t, qx, qy, _, _] if (30.0..30.24).contains(&t.parse().unwrap_or(0.0)) => {
            format!("{t},{qx},{qy},-0.17,-0.1")
        }
        _ => line.to_owned(),
    };
    cli.write(
        "lost.csv",
        &cli.read("healthy.csv").lines().map(lost).collect::<Vec<_>>().join("\n"),
    );
    cli.ok("calibrate --asset rig.json healthy.csv -o healthy.json");
    let done = cli.ok("calibrate --asset rig.json lost.csv -o lost.json");
    assert!(done.stderr.contains("session 1, 30.0"), "{}", done.stderr);
    assert!(done.stderr.contains("readings jumped"), "{}", done.stderr);
    cli.ok("calibrate --asset lost.json healthy.csv -o again.json");
    let calibration = |file: &str| -> Value {
        serde_json::from_str::<Value>(&cli.read(file)).unwrap()["calibration"].take()
    };
    let [healthy, lost] = ["healthy.json", "lost.json"].map(calibration);
    assert_eq!(lost["left_out"][0]["reason"], "jumped");
    assert!(healthy.get("left_out").is_none(), "{healthy}");
    let noise_m = |learnt: &Value| learnt["x"]["noise_m"].as_f64().unwrap();
    assert!((noise_m(&lost) / noise_m(&healthy) - 1.0).abs() < 0.1, "{lost}");
}

/// Writes a healthy session with its columns `t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m` multiplied by
/// `factors`.
fn write_scaled(cli: &CliFixture, name: &str, factors: [f64; 5]) {
    cli.ok("simulate --rig rig.json --reference lissajous --seconds 30 --seed 7 -o healthy.csv");
    let text = cli.read("healthy.csv");
    let cell = |(field, factor): (&str, f64)| {
        field.parse::<f64>().map_or_else(|_| field.to_owned(), |v| (v * factor).to_string())
    };
    let row = |line: &str| line.split(',').zip(factors).map(cell).collect::<Vec<_>>().join(",");
    cli.write(name, &text.lines().map(row).collect::<Vec<_>>().join("\n"));
}

#[test]
fn implausible_units_are_rejected_with_a_suggestion() {
    let cli = CliFixture::new();
    for (factors, words) in [
        ([1e3, 1.0, 1.0, 1.0, 1.0], "is t_s in ms?"),
        ([1.0, 57.3, 57.3, 1.0, 1.0], "is axes.command_unit_rad 0.0175?"),
        ([1.0, 1.0, 1.0, 1e3, 1e3], "is axes.position_unit_m 0.001?"),
        ([1.0, 1.0, 1.0, 0.1, 0.1], "(axes.position_unit_m 10 instead of 1)?"),
    ] {
        write_scaled(&cli, "other.csv", factors);
        let refused = cli.run(3, "calibrate --asset rig.json other.csv -o out.json");
        assert!(refused.stderr.contains(words), "{}", refused.stderr);
    }
    assert!(!cli.path("out.json").exists());
}

/// Readings a tenth of what they should be move and scatter a tenth as much: that is a unit, and not
/// a fault of both servos.
#[test]
fn a_wrong_unit_on_a_learnt_rig_is_not_a_dead_servo() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig rig.json --reference lissajous --seconds 60 --seed 7 -o first.csv");
    cli.ok("calibrate --asset rig.json first.csv -o calibrated.json");
    write_scaled(&cli, "small.csv", [1.0, 1.0, 1.0, 0.1, 0.1]);
    let text = cli.ok("replay --asset calibrated.json small.csv").stdout;
    assert!(text.contains("cannot tell a wrong unit from x_servo"), "{text}");
    let json = cli.ok("replay --asset calibrated.json --format json small.csv").stdout;
    let summary: Value = serde_json::from_str(json.lines().last().unwrap()).unwrap();
    assert_eq!(summary["outcome"], "cannot tell", "{summary}");
    let warning = &summary["warnings"][0];
    assert_eq!(warning["code"], "scale", "{summary}");
    let words = "and the readings scatter as much less: are the positions 10 times as large";
    assert!(warning["message"].as_str().unwrap().contains(words), "{warning}");
}

/// A ball that mostly rests shows nothing of the servos.
#[test]
fn a_calibration_that_would_find_nothing_is_refused() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig-seed 3 --seed 1 --reference steps --seconds 90 --rig rig.json -o r.csv");
    let refused = cli.run(3, "calibrate --asset rig.json r.csv -o out.json");
    assert!(refused.stderr.contains("the calibration would be blind"), "{}", refused.stderr);
    assert!(!cli.path("out.json").exists());
}

#[test]
fn a_failed_calibration_gives_a_reason_and_writes_no_file() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig rig.json --seconds 8 -o short.csv");
    let too_short = cli.run(3, "calibrate --asset rig.json short.csv -o out.json");
    assert!(too_short.stderr.contains("cannot calibrate"), "{}", too_short.stderr);
    assert!(too_short.stderr.contains("needed"), "{}", too_short.stderr);
    assert!(!cli.path("out.json").exists());
}
