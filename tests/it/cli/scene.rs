use serde_json::Value;

use super::bench::{Bench, Done};

const HEADER: &str = "t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s";
const G: f64 = 9.81;
const ANGLE: f64 = std::f64::consts::PI / 20.0;

/// The one object that the command printed.
fn object(done: &Done) -> Value {
    assert_eq!(done.stdout.lines().count(), 1);
    done.json().remove(0)
}

/// The rows of a trajectory.
fn rows(bench: &Bench, name: &str) -> Vec<Vec<f64>> {
    let text = bench.read(name);
    assert_eq!(text.lines().next(), Some(HEADER));
    let numbers = |row: &str| row.split(',').map(|word| word.parse().unwrap()).collect();
    text.lines().skip(1).map(numbers).collect()
}

/// The worst distance in x, y between two trajectories with the same times.
fn apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let distance = |(a, b): (&Vec<f64>, &Vec<f64>)| {
        assert_eq!(a[0], b[0]);
        (a[1] - b[1]).hypot(a[2] - b[2])
    };
    a.iter().zip(b).map(distance).fold(0.0, f64::max)
}

fn exists(bench: &Bench, names: &[&str]) {
    for name in names {
        assert!(bench.path(name).exists(), "no {name}");
    }
}

#[test]
fn every_scene_of_the_list_runs_within_eighty_columns() {
    let bench = Bench::new();
    let list = bench.ok("scene --list").stdout;
    let names: Vec<&str> = list
        .lines()
        .skip(1)
        .filter(|line| !line.starts_with(' '))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(names.len(), 12, "{list}");
    for name in names {
        let told = bench.ok(&format!("scene {name}")).stdout;
        let wide = told.lines().find(|line| line.chars().count() > 80);
        assert_eq!(wide, None, "{name}");
        assert!(told.contains(name), "{told}");
        assert!(std::fs::read_dir(bench.path(".")).unwrap().next().is_none(), "{name} wrote");
    }
}

#[test]
fn a_scene_file_is_run_and_its_files_are_written() {
    let bench = Bench::new();
    bench.write("my.json", r#"{"name":"mine","duration_s":0.1,"qy":[{"constant_rad":0.1}]}"#);
    let done = bench.ok("scene my.json -o out --format json");
    let told = object(&done);
    assert_eq!((&told["scene"], &told["model"]), (&"mine".into(), &"compliant".into()));
    assert!(told["error_m"].as_f64().unwrap() < 1e-4 && told["cpu_s"].as_f64().unwrap() > 0.0);
    exists(&bench, &["out/trajectory.csv", "out/position.svg", "out/position.png", "out/path.svg"]);
    // A 200th of the scene is shorter than 10 ms.
    assert_eq!(rows(&bench, "out/trajectory.csv").len(), 201);
    assert!(done.stderr.contains("trajectory.csv"));
    bench.ok("scene my.json -o coarse --sample 0.05");
    assert_eq!(rows(&bench, "coarse/trajectory.csv").len(), 3);
}

/// It leaves by the near side, y, when half of 5/7·g·sin(π/20)·t² is 0.12 m;
/// from then on gravity alone moves it.
#[test]
fn validate_the_tilted_plate_is_left_by_its_near_side() {
    let bench = Bench::new();
    let told =
        object(&bench.ok("scene tilt --model compliant --tolerance 1e-9 -o out --format json"));
    let leaves = (2.0 * 0.12 / (5.0 / 7.0 * G * ANGLE.sin())).sqrt();
    let events = told["events"].as_array().unwrap();
    assert_eq!(
        (events[0]["what"].as_str(), events[1]["what"].as_str()),
        (Some("rolls"), Some("falls"))
    );
    assert!((events[1]["t_s"].as_f64().unwrap() - leaves).abs() < 1e-3, "{events:?}");
    let rows = rows(&bench, "out/trajectory.csv");
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

/// The contract's worst distance, against a run of another model and method
/// that is tighter by far.
#[test]
fn validate_the_wanted_accuracy_is_kept() {
    let bench = Bench::new();
    let told = object(&bench.ok("scene sine --tolerance 1e-6 -o a --format json"));
    assert_ne!(told["method"], "rodas4");
    bench.ok("scene sine --model compliant --method rodas4 --tolerance 1e-10 -o b");
    let off = apart(&rows(&bench, "a/trajectory.csv"), &rows(&bench, "b/trajectory.csv"));
    assert!(off < 1e-6, "{off}");
}

/// v = v_thr·tan(angle)/μ along x; along y the normal force is smaller by
/// cos qy than what pulls.
#[test]
fn validate_the_block_creeps_as_its_friction_says() {
    let bench = Bench::new();
    bench.ok("scene block --model compliant --method rodas4 --tolerance 1e-9 -o out");
    let rows = rows(&bench, "out/trajectory.csv");
    let last = &rows[rows.len() - 1];
    let creep = 1e-4 * ANGLE.tan() / 0.6;
    assert!((last[4] - creep).abs() < 1e-4 * creep, "{} is not {creep}", last[4]);
    assert!((last[5] + creep / ANGLE.cos()).abs() < 1e-4 * creep, "{}", last[5]);
    exists(&bench, &["out/side-by-side.svg", "out/trajectory-tilt.csv"]);
}

#[test]
fn a_pushed_ball_comes_back_and_its_session_can_be_replayed() {
    let bench = Bench::new();
    let told = object(&bench.ok("scene pid-impulse -o out --format json"));
    let control = &told["control"];
    assert_eq!(control["back_by_17_s"], true);
    // Linear theory says 12.5 mm; see `crates/offbd-lab/src/scene/controlled/tests.rs`.
    assert!((control["farthest_m"].as_f64().unwrap() - 0.0125).abs() < 5e-4);
    exists(&bench, &["out/control.svg", "out/path.png"]);
    let replay = bench.ok("replay out/session.csv").stdout;
    assert!(replay.contains("3000") && replay.contains("session.csv"), "{replay}");
}

/// Application 3: the good asset reports nothing, the bad x servo x only.
#[test]
fn the_textbook_rule_finds_the_late_servo_and_no_other() {
    let bench = Bench::new();
    let codes = |scene: &str| -> Vec<Vec<String>> {
        let told = object(&bench.ok(&format!("scene {scene} --format json -o {scene}")));
        let of = |verdict: &Value| {
            let faults = verdict["faults"].as_array().unwrap().iter();
            faults.map(|fault| fault["code"].as_str().unwrap().to_owned()).collect()
        };
        told["verdicts"].as_array().unwrap().iter().map(of).collect()
    };
    let nothing: [Vec<String>; 2] = Default::default();
    assert_eq!(codes("good-asset"), nothing);
    assert_eq!(codes("bad-x-servo")[0], ["x_servo"]);
    exists(&bench, &["bad-x-servo/deviation.svg", "good-asset/session.csv"]);
    let line = "replay --asset bad-x-servo/asset.json --profile textbook bad-x-servo/session.csv";
    assert!(bench.ok(line).stdout.contains("x_servo at"));
}

#[test]
fn what_does_not_fit_together_exits_with_2_and_a_reason() {
    let bench = Bench::new();
    for (line, said) in [
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
        let done = bench.run(2, line);
        assert!(done.stderr.contains(said), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

#[test]
fn a_bad_scene_file_exits_with_3_and_names_its_element() {
    let bench = Bench::new();
    bench.write("friction.json", r#"{"contact":{"friction":-1}}"#);
    bench.write("term.json", r#"{"qx":[{"sine":{"amplitude_rad":"x","frequency_hz":1}}]}"#);
    bench.write("key.json", r#"{"durations":1}"#);
    bench.write("broken.json", "{");
    for (line, said) in [
        ("scene friction.json", ["friction.json", "/contact/friction"]),
        ("scene term.json", ["term.json", "/qx/0/sine/amplitude_rad"]),
        ("scene key.json", ["key.json", "/durations"]),
        ("scene broken.json", ["broken.json", "line 1"]),
        ("scene nowhere.json", ["nowhere.json", ""]),
    ] {
        let done = bench.run(3, line);
        assert!(said.iter().all(|s| done.stderr.contains(s)), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

#[test]
fn a_run_that_fails_says_when_and_keeps_what_it_had() {
    let bench = Bench::new();
    let euler = "--model compliant --method euler --step 0.001";
    let done = bench.run(1, &format!("scene steep {euler} -o out --sample 0.001"));
    assert!(done.stderr.contains("no number any more"), "{}", done.stderr);
    assert!(done.stdout.contains("failed"), "{}", done.stdout);
    let rows = rows(&bench, "out/trajectory.csv");
    assert!(!rows.is_empty() && rows.iter().flatten().all(|value| value.is_finite()));
    exists(&bench, &["out/position.png"]);
}

#[test]
fn out_of_reach_is_said_in_a_sentence() {
    let bench = Bench::new();
    let done = bench.run(1, "scene steep --tolerance 1e-12");
    assert!(done.stderr.contains("no model and method meets 1e-12 m"), "{}", done.stderr);
    assert!(done.stderr.contains("rodas4"), "{}", done.stderr);
    assert_eq!(done.stdout, "");
}

#[test]
fn a_model_out_of_its_range_is_warned_of() {
    let bench = Bench::new();
    let slips = bench.ok("scene steep --model rolling").stderr;
    assert!(
        slips.contains("warning: the rolling model does not hold here: the ball slips"),
        "{slips}"
    );
    let falls = bench.ok("scene tilt --model creeping").stderr;
    assert!(falls.contains("the ball falls at 0.4679 s"), "{falls}");
    assert_eq!(bench.ok("scene slope --model rolling").stderr, "");
    assert_eq!(bench.ok("scene steep").stderr, "");
}

/// What is left open is filled in so that it runs.
#[test]
fn half_an_answer_is_enough() {
    let bench = Bench::new();
    for (options, model, method) in [
        ("--model planar", "planar", "zoh"),
        ("--model rolling --method rk4", "rolling", "rk4"),
        ("--model compliant", "compliant", "rodas4"),
        ("--model compliant --step 1e-4", "compliant", "contact-step"),
        ("--model compliant --method rk4", "compliant", "rk4"),
        ("--model sliding", "sliding", "dopri5"),
        ("--method rk4", "compliant", "rk4"),
        ("--method rodas3", "compliant", "rodas3"),
        ("--method zoh", "planar", "zoh"),
        ("--step 0.002", "compliant", "contact-step"),
    ] {
        let told = object(&bench.ok(&format!("scene slope {options} --format json")));
        assert_eq!((&told["model"], &told["method"]), (&model.into(), &method.into()), "{options}");
        // 5/7·g·cos(qx)·sin(qy)·t²/2, less for the creep.
        let x = told["end"]["position_m"][0].as_f64().unwrap();
        assert!((x - 0.086_61).abs() < 2e-3, "{options}: {x}");
    }
}
