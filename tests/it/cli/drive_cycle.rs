//! `offbd drive-cycle`: the motion in which every monitor comes to a result.

use serde_json::Value;

use super::bench::Bench;

#[test]
fn a_learnt_rig_has_a_cycle_in_every_form() {
    let bench = Bench::new();
    bench.calibrated();
    let table = bench.ok("drive-cycle --asset learnt.json").stdout;
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    for word in ["chapter: ", "x_servo", "the ball is stuck", "no ball is seen", "to each side"] {
        assert!(table.contains(word), "{word}: {table}");
    }

    let done = bench.ok("drive-cycle --asset learnt.json --format json -o drive-cycle.json");
    assert!(done.stdout.is_empty() && done.stderr.starts_with("chapter: "), "{}", done.stderr);
    let cycle: Value = serde_json::from_str(&bench.read("drive-cycle.json")).unwrap();
    let n = cycle["rows"]["t_s"].as_array().unwrap().len();
    let seconds = cycle["duration_s"].as_f64().unwrap();
    assert_eq!(n, (100.0 * seconds).ceil() as usize + 1);

    let csv = bench.ok("drive-cycle --asset learnt.json --format csv").stdout;
    assert_eq!(csv.lines().next(), Some("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m"));
    assert_eq!(csv.lines().count(), n + 1);
    let program = bench.ok("drive-cycle --asset learnt.json --format python").stdout;
    assert!(program.contains("def read_rig():") && program.contains("drive-cycle.json"));
}

#[test]
fn a_rig_without_a_cycle_is_told_why() {
    let bench = Bench::new();
    bench.calibrated();
    let refused = bench.run(3, "drive-cycle --asset rig.json").stderr;
    assert!(refused.contains("rig.json: /calibration: the rig is not learnt"), "{refused}");
    let mut tiny: Value = serde_json::from_str(&bench.read("learnt.json")).unwrap();
    tiny["plate"]["width_m"] = 0.03.into();
    bench.write("tiny.json", &tiny.to_string());
    let refused = bench.run(3, "drive-cycle --asset tiny.json").stderr;
    assert!(refused.contains("/plate: it leaves the ball 0.0 mm along y"), "{refused}");
}
