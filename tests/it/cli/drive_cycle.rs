//! `offbd drive-cycle`: the motion in which every monitor has a result.

use serde_json::Value;

use super::fixture::CliFixture;

#[test]
fn the_drive_cycle_of_a_learnt_rig_is_written_in_every_format() {
    let cli = CliFixture::new();
    cli.calibrated();
    let table = cli.ok("drive-cycle --asset calibrated.json").stdout;
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    for word in ["chapter: ", "x_servo", "the ball is stuck", "no ball is seen", "to each side"] {
        assert!(table.contains(word), "{word}: {table}");
    }

    let done = cli.ok("drive-cycle --asset calibrated.json --format json -o drive-cycle.json");
    assert!(done.stdout.is_empty() && done.stderr.starts_with("chapter: "), "{}", done.stderr);
    let cycle: Value = serde_json::from_str(&cli.read("drive-cycle.json")).unwrap();
    let n = cycle["rows"]["t_s"].as_array().unwrap().len();
    let seconds = cycle["duration_s"].as_f64().unwrap();
    assert_eq!(n, (100.0 * seconds).ceil() as usize + 1);

    let csv = cli.ok("drive-cycle --asset calibrated.json --format csv").stdout;
    assert_eq!(csv.lines().next(), Some("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m"));
    assert_eq!(csv.lines().count(), n + 1);
    let program = cli.ok("drive-cycle --asset calibrated.json --format python").stdout;
    assert!(program.contains("def read_rig():") && program.contains("drive-cycle.json"));
}

#[test]
fn a_missing_drive_cycle_is_explained() {
    let cli = CliFixture::new();
    cli.calibrated();
    let refused = cli.run(3, "drive-cycle --asset rig.json").stderr;
    assert!(refused.contains("rig.json: /calibration: the rig is not calibrated"), "{refused}");
    let mut tiny: Value = serde_json::from_str(&cli.read("calibrated.json")).unwrap();
    tiny["plate"]["width_m"] = 0.03.into();
    cli.write("tiny.json", &tiny.to_string());
    let refused = cli.run(3, "drive-cycle --asset tiny.json").stderr;
    assert!(refused.contains("/plate: the ball has 0.0 mm to roll along y"), "{refused}");
}
