use serde_json::Value;

use super::fixture::{CliFixture, CommandOutput};

const HEADER: &str = "t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s";
const G: f64 = 9.81;
const ANGLE: f64 = std::f64::consts::PI / 20.0;

/// Returns the single JSON object that the command printed.
fn object(done: &CommandOutput) -> Value {
    assert_eq!(done.stdout.lines().count(), 1);
    done.json().remove(0)
}

/// Returns the rows of a trajectory.
fn rows(cli: &CliFixture, name: &str) -> Vec<Vec<f64>> {
    let text = cli.read(name);
    assert_eq!(text.lines().next(), Some(HEADER));
    let numbers = |row: &str| row.split(',').map(|word| word.parse().unwrap()).collect();
    text.lines().skip(1).map(numbers).collect()
}

/// Returns the largest distance in x, y between two trajectories with the same times.
fn largest_distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let distance = |(a, b): (&Vec<f64>, &Vec<f64>)| {
        assert_eq!(a[0], b[0]);
        (a[1] - b[1]).hypot(a[2] - b[2])
    };
    a.iter().zip(b).map(distance).fold(0.0, f64::max)
}

fn exists(cli: &CliFixture, names: &[&str]) {
    for name in names {
        assert!(cli.path(name).exists(), "no {name}");
    }
}

#[test]
fn the_output_of_every_listed_scene_fits_in_eighty_columns() {
    let cli = CliFixture::new();
    let list = cli.ok("scene --list").stdout;
    let names: Vec<&str> = list
        .lines()
        .skip(1)
        .filter(|line| !line.starts_with(' '))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(names.len(), 12, "{list}");
    let listed = cli.ok("scene --list --format json").json();
    assert!(listed.iter().map(|entry| entry["scene"].as_str().unwrap()).eq(names.iter().copied()));
    assert!(listed.iter().all(|entry| entry["about"].as_str().is_some_and(|text| text.len() > 9)));
    for name in names {
        let result = cli.ok(&format!("scene {name}")).stdout;
        let wide = result.lines().find(|line| line.chars().count() > 80);
        assert_eq!(wide, None, "{name}");
        assert!(result.contains(name), "{result}");
        assert!(std::fs::read_dir(cli.path(".")).unwrap().next().is_none(), "{name} wrote");
    }
}

#[test]
fn running_a_scene_file_writes_its_output_files() {
    let cli = CliFixture::new();
    cli.write("my.json", r#"{"name":"mine","duration_s":0.1,"qy":[{"constant_rad":0.1}]}"#);
    let done = cli.ok("scene my.json -o out --format json");
    let result = object(&done);
    assert_eq!((&result["scene"], &result["model"]), (&"mine".into(), &"rolling".into()));
    assert!(result["error_m"].as_f64().unwrap() < 1e-4 && result["cpu_s"].as_f64().unwrap() > 0.0);
    exists(&cli, &["out/trajectory.csv", "out/position.svg", "out/position.png", "out/path.svg"]);
    // The sampling interval is a 200th of the scene, as this is shorter than 10 ms.
    assert_eq!(rows(&cli, "out/trajectory.csv").len(), 201);
    assert!(done.stderr.contains("trajectory.csv"));
    cli.ok("scene my.json -o coarse --sample 0.05");
    assert_eq!(rows(&cli, "coarse/trajectory.csv").len(), 3);
}

/// The ball leaves the plate along y, the shorter side, when 5/7·g·sin(π/20)·t²/2 is 0.12 m;
/// then only gravity acts on it.
#[test]
fn validate_the_ball_leaves_a_tilted_plate_by_the_near_side() {
    let cli = CliFixture::new();
    let result =
        object(&cli.ok("scene tilt --model compliant --tolerance 1e-9 -o out --format json"));
    let leaves = (2.0 * 0.12 / (5.0 / 7.0 * G * ANGLE.sin())).sqrt();
    let events = result["events"].as_array().unwrap();
    assert_eq!(
        (events[0]["what"].as_str(), events[1]["what"].as_str()),
        (Some("rolls"), Some("falls"))
    );
    assert!((events[1]["t_s"].as_f64().unwrap() - leaves).abs() < 1e-3, "{events:?}");
    let rows = rows(&cli, "out/trajectory.csv");
    let last_on = rows.iter().rfind(|row| row[0] < leaves - 1e-3).unwrap();
    assert!(last_on[2] > -0.12 && last_on[1] < 0.19 && last_on[3] > 0.0226);
    let free: Vec<&Vec<f64>> = rows.iter().filter(|row| row[0] > leaves + 2e-3).collect();
    let (first, last) = (free[0], free[free.len() - 1]);
    let gravity = [G * ANGLE.cos() * ANGLE.sin(), -G * ANGLE.sin(), -G * ANGLE.cos().powi(2)];
    for (i, g) in gravity.into_iter().enumerate() {
        let t = last[0] - first[0];
        let wanted = first[1 + i] + first[4 + i] * t + g * t * t / 2.0;
        assert!((last[1 + i] - wanted).abs() < 1e-6, "{i}: {} is not {wanted}", last[1 + i]);
        assert!((last[4 + i] - first[4 + i] - g * t).abs() < 1e-5, "{i}");
    }
}

/// The largest distance from a run with another model and method and a much smaller tolerance
/// is below the requested tolerance.
#[test]
fn validate_the_requested_tolerance_is_kept() {
    let cli = CliFixture::new();
    let result = object(&cli.ok("scene sine --tolerance 1e-6 -o a --format json"));
    assert_ne!(result["method"], "rodas4");
    cli.ok("scene sine --model compliant --method rodas4 --tolerance 1e-10 -o b");
    let off = largest_distance(&rows(&cli, "a/trajectory.csv"), &rows(&cli, "b/trajectory.csv"));
    assert!(off < 1e-6, "{off}");
}

/// A landing within a fixed step of an implicit method, which a single step answers with
/// metres, is divided; a tolerance is kept through it.
#[test]
fn an_implicit_method_takes_a_landing() {
    let cli = CliFixture::new();
    cli.ok("scene steep --tolerance 1e-7 -o truth --sample 0.002");
    let truth = rows(&cli, "truth/trajectory.csv");
    let rodas = "scene steep --model compliant --method rodas4 --sample 0.002";
    for (pace, within) in [("--step 0.001", 2e-3), ("--tolerance 1e-3", 1e-3)] {
        let done = cli.ok(&format!("{rodas} {pace} -o out --format json"));
        let off = largest_distance(&rows(&cli, "out/trajectory.csv"), &truth);
        assert!(off < within, "{pace}: {off} m");
        assert!(!done.stderr.contains("warning"), "{pace}: {}", done.stderr);
        let divided = object(&done)["divided"].as_u64().unwrap();
        assert_eq!(divided > 1, pace.contains("step"), "{pace}: {divided} steps divided");
    }
    let rolls = "scene slope --model compliant --method rodas4 --step 0.001 --format json";
    assert_eq!(object(&cli.ok(rolls))["divided"], 0);
    let said = cli.ok(&format!("{rodas} --step 0.001")).stdout;
    assert!(said.contains("divided, where the contact changes"), "{said}");
    let said = cli.ok(&format!("{rodas} --tolerance 1e-3")).stdout;
    assert!(said.contains("the smaller tolerance is to keep 0.001 m"), "{said}");
}

/// The limits are those of the chapter's slope (docs/benchmarks.md), at the weight of a level
/// plate.
#[test]
fn a_step_that_is_not_stable_causes_a_warning() {
    let cli = CliFixture::new();
    let warned = |line: &str| cli.ok(&format!("scene slope --model compliant {line}")).stderr;
    let chatters = warned("--method rk4 --step 5e-5");
    assert!(chatters.contains("rk4 above 1.352e-5 s lets the slip chatter"), "{chatters}");
    let thrown = warned("--method rk4 --step 1.6e-4");
    assert!(thrown.contains("rk4 above 1.481e-4 s is not stable"), "{thrown}");
    assert_eq!(warned("--method rk4 --step 1e-5"), "");
    assert_eq!(warned("--method contact-step --step 0.01"), "");
}

/// v = v_thr·tan(angle)/μ along x; along y it is larger by the factor 1/cos(qy), because the
/// normal force is smaller.
#[test]
fn validate_the_creep_of_the_block_against_its_friction_law() {
    let cli = CliFixture::new();
    cli.ok("scene block --model compliant --method rodas4 --tolerance 1e-9 -o out");
    let rows = rows(&cli, "out/trajectory.csv");
    let last = &rows[rows.len() - 1];
    let creep = 1e-4 * ANGLE.tan() / 0.6;
    assert!((last[4] - creep).abs() < 1e-4 * creep, "{} is not {creep}", last[4]);
    assert!((last[5] + creep / ANGLE.cos()).abs() < 1e-4 * creep, "{}", last[5]);
    exists(&cli, &["out/side-by-side.svg", "out/trajectory-tilt.csv"]);
}

#[test]
fn a_pushed_ball_returns_and_the_session_can_be_replayed() {
    let cli = CliFixture::new();
    let result = object(&cli.ok("scene pid-impulse -o out --format json"));
    let control = &result["control"];
    assert_eq!(control["back_by_17_s"], true);
    // Linear theory says 12.5 mm; see `crates/offbd-lab/src/scene/controlled/tests.rs`.
    assert!((control["farthest_m"].as_f64().unwrap() - 0.0125).abs() < 5e-4);
    exists(&cli, &["out/control.svg", "out/path.png"]);
    let replay = cli.ok("replay out/session.csv").stdout;
    assert!(replay.contains("3000") && replay.contains("session.csv"), "{replay}");
}

/// Application 3 of the chapter: the good asset has no fault, the bad x servo only one of x.
#[test]
fn the_textbook_rule_finds_only_the_slow_servo() {
    let cli = CliFixture::new();
    let codes = |scene: &str| -> Vec<Vec<String>> {
        let result = object(&cli.ok(&format!("scene {scene} --format json -o {scene}")));
        let of = |verdict: &Value| {
            let faults = verdict["faults"].as_array().unwrap().iter();
            faults.map(|fault| fault["code"].as_str().unwrap().to_owned()).collect()
        };
        result["verdicts"].as_array().unwrap().iter().map(of).collect()
    };
    let nothing: [Vec<String>; 2] = Default::default();
    assert_eq!(codes("good-asset"), nothing);
    assert_eq!(codes("bad-x-servo")[0], ["x_servo"]);
    exists(&cli, &["bad-x-servo/deviation.svg", "good-asset/session.csv"]);
    let line = "replay --asset bad-x-servo/asset.json --profile textbook bad-x-servo/session.csv";
    assert!(cli.ok(line).stdout.contains("x_servo at"));
}

#[test]
fn incompatible_options_exit_with_2_and_a_reason() {
    let cli = CliFixture::new();
    for (line, expected) in [
        ("scene", "NAME|FILE.json"),
        ("scene dance", "pid-impulse"),
        ("scene tilt --model moon", "creeping"),
        ("scene tilt --method rk9", "contact-step"),
        ("scene tilt --model rolling --method rodas4", "semi-implicit-euler"),
        ("scene tilt --model rolling --method rk4 --tolerance 1e-4", "fixed steps"),
        ("scene tilt --model sliding --step 0.001", "--step"),
        ("scene tilt --step 0.001 --tolerance 1e-4", "cannot be used with"),
        ("scene tilt --step 100", "--step"),
        ("scene tilt --step NaN", "above 0"),
        ("scene tilt --tolerance -1", "above 0"),
        ("scene tilt --tolerance 10", "--tolerance"),
        ("scene tilt --sample 1e-9", "--sample"),
        ("scene block --model rolling", "a block slides"),
        ("scene good-asset --model rolling", "--model"),
    ] {
        let done = cli.run(2, line);
        assert!(done.stderr.contains(expected), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

#[test]
fn an_invalid_scene_file_exits_with_3_and_names_the_element() {
    let cli = CliFixture::new();
    cli.write("friction.json", r#"{"contact":{"friction":-1}}"#);
    cli.write("term.json", r#"{"qx":[{"sine":{"amplitude_rad":"x","frequency_hz":1}}]}"#);
    cli.write("key.json", r#"{"durations":1}"#);
    cli.write("broken.json", "{");
    for (line, expected) in [
        ("scene friction.json", ["friction.json", "/contact/friction"]),
        ("scene term.json", ["term.json", "/qx/0/sine/amplitude_rad"]),
        ("scene key.json", ["key.json", "/durations"]),
        ("scene broken.json", ["broken.json", "line 1"]),
        ("scene nowhere.json", ["nowhere.json", ""]),
    ] {
        let done = cli.run(3, line);
        assert!(expected.iter().all(|s| done.stderr.contains(s)), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

#[test]
fn a_failed_run_reports_the_time_and_keeps_its_results() {
    let cli = CliFixture::new();
    let euler = "--model compliant --method euler --step 0.001";
    let done = cli.run(1, &format!("scene steep {euler} -o out --sample 0.001"));
    assert!(done.stderr.contains("the state is not a number"), "{}", done.stderr);
    assert!(done.stdout.contains("failed"), "{}", done.stdout);
    let rows = rows(&cli, "out/trajectory.csv");
    assert!(!rows.is_empty() && rows.iter().flatten().all(|value| value.is_finite()));
    exists(&cli, &["out/position.png"]);
}

#[test]
fn an_unreachable_tolerance_is_explained() {
    let cli = CliFixture::new();
    let one_pass = cli.run(1, "scene steep --tolerance 1e-12").stderr;
    assert!(one_pass.contains("no model stays within 1e-12 m here: "), "{one_pass}");
    let done = cli.run(1, "scene steep --tolerance 1e-12 --search");
    assert!(done.stderr.contains("no model and method meets 1e-12 m"), "{}", done.stderr);
    assert!(done.stderr.contains("rodas4"), "{}", done.stderr);
    assert_eq!(done.stdout, "");
    let too_fine = "scene steep --model compliant --method rodas4 --tolerance 1e-12";
    let done = cli.run(2, too_fine);
    assert!(
        done.stderr.contains("--tolerance: must be at least 2e-11 m to be kept"),
        "{}",
        done.stderr
    );
}

#[test]
fn a_model_outside_its_range_causes_a_warning() {
    let cli = CliFixture::new();
    let slips = cli.ok("scene steep --model rolling").stderr;
    assert!(
        slips.contains("warning: the rolling model does not hold here: the ball slips"),
        "{slips}"
    );
    let falls = cli.ok("scene tilt --model creeping").stderr;
    assert!(falls.contains("the ball falls at 0.4679 s"), "{falls}");
    assert_eq!(cli.ok("scene slope --model rolling").stderr, "");
    assert_eq!(cli.ok("scene steep").stderr, "");
}

/// Model, method and step that are not given are chosen such that the scene runs.
#[test]
fn missing_options_are_filled_in() {
    let cli = CliFixture::new();
    for (options, model, method) in [
        ("--model planar", "planar", "zoh"),
        ("--model rolling --method rk4", "rolling", "rk4"),
        ("--model compliant", "compliant", "rodas4"),
        ("--model compliant --step 1e-4", "compliant", "contact-step"),
        ("--model compliant --method rk4", "compliant", "rk4"),
        ("--model sliding", "sliding", "dopri5"),
        ("--method rk4", "rolling", "rk4"),
        ("--method rodas3", "compliant", "rodas3"),
        ("--method zoh", "planar", "zoh"),
        ("--step 0.002", "rolling", "rk4"),
    ] {
        let result = object(&cli.ok(&format!("scene slope {options} --format json")));
        assert_eq!(
            (&result["model"], &result["method"]),
            (&model.into(), &method.into()),
            "{options}"
        );
        // 5/7·g·cos(qx)·sin(qy)·t²/2; slightly less with creep.
        let x = result["end"]["position_m"][0].as_f64().unwrap();
        assert!((x - 0.086_61).abs() < 2e-3, "{options}: {x}");
    }
}

/// The plate follows the recorded command by the exponential of the servo, after its dead time;
/// the ball starts where it was measured.
#[test]
fn validate_a_twin_under_recorded_commands() {
    let cli = CliFixture::new();
    cli.write(
        "rig.json",
        r#"{"name":"slow","servo":{"dead_time_s":0.1,"lag_s":0.2,"angle_limit_rad":0.2}}"#,
    );
    let mut session = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0,0.03,-0.02\n".to_owned();
    (1..=100).for_each(|i| session += &format!("{},0,0.1,,\n", f64::from(i) / 100.0));
    cli.write("my.csv", &session);
    let line = "scene --commands my.csv --asset rig.json -o out --format json";
    let result = object(&cli.ok(line));
    assert_eq!((&result["asset"], &result["samples"]), (&"slow".into(), &101.into()));
    assert_eq!(result["farthest_from_measured_m"], 0.0);
    // 5/7·g·0.1 rad, twice integrated from 0.11 s on, is 0.16 m, from 0.03 m to the edge at 0.19 m.
    let leaves_s = result["leaves_plate_s"].as_f64().unwrap();
    assert!((leaves_s - 0.96).abs() < 0.011, "{leaves_s}");
    let text = cli.read("out/trajectory.csv");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("t_s,x_m,y_m,vx_m_s,vy_m_s,qx_rad,qy_rad"));
    assert_eq!(lines.next(), Some("0,0.03,-0.02,0,0,0,0"));
    let last: Vec<f64> = lines.last().unwrap().split(',').map(|w| w.parse().unwrap()).collect();
    let wanted = 0.1 * (1.0 - (-(1.0 - 0.01 - 0.1) / 0.2_f64).exp());
    assert!((last[6] - wanted).abs() < 1e-12, "{last:?}");
    assert_eq!((last[2], last[5]), (-0.02, 0.0));
    exists(&cli, &["out/position.svg", "out/position.png"]);
    assert!(cli.ok("scene --commands my.csv").stdout.contains("the twin of chapter"));
}

#[test]
fn what_does_not_fit_recorded_commands_is_refused() {
    let cli = CliFixture::new();
    cli.write("empty.csv", "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n");
    for (code, line, expected) in [
        (2, "scene tilt --commands empty.csv", "cannot be used with"),
        (2, "scene --commands empty.csv --model rolling", "cannot be used with"),
        (2, "scene tilt --asset rig.json", "cannot be used with"),
        (2, "scene --asset rig.json", "--commands"),
        (2, "scene --commands empty.csv --step 0.5", "--step: 0.5 is outside 0.002 to 0.01"),
        (3, "scene --commands empty.csv", "empty.csv: has no usable sample"),
    ] {
        let reason = cli.run(code, line).stderr;
        assert!(reason.contains(expected), "{line}: {reason}");
    }
}
