use std::io::Read;
use std::process::{Command, Stdio};

use super::bench::Bench;

const COMMANDS: [&str; 12] = [
    "simulate",
    "calibrate",
    "replay",
    "score",
    "soak",
    "scene",
    "chart",
    "demo",
    "serve",
    "watch",
    "migrate",
    "check",
];

#[test]
fn help_teaches_with_examples_within_eighty_columns() {
    let bench = Bench::new();
    for command in COMMANDS {
        let help = bench.ok(&format!("{command} --help"));
        assert!(help.stdout.contains(&format!("  offbd {command} ")), "no example of {command}");
        let wide = help.stdout.lines().find(|line| line.chars().count() > 80);
        assert_eq!(wide, None);
        assert_eq!(help.stderr, "");
    }
    assert!(bench.ok("--help").stdout.contains("Exit status"));
}

#[test]
fn bad_arguments_exit_with_2_and_say_what_would_be_right() {
    let bench = Bench::new();
    for (line, said) in [
        ("", "Usage"),
        ("dance", "dance"),
        ("replay", "SESSION.csv"),
        ("replay --format xml a.csv", "table, json"),
        ("replay --profile best a.csv", "default, textbook"),
        ("simulate --fault x_servo:tired@3", "intermittent"),
        ("simulate --fault x_servo@3", "CODE:KIND"),
        ("simulate --seconds -1", "--seconds"),
        ("simulate --preset moon", "pingpong"),
        ("simulate --gap 5-4", "12-14"),
        ("calibrate a.csv -o b.json", "--asset"),
        ("chart pie", "estimators"),
    ] {
        let done = bench.run(2, line);
        assert!(done.stderr.contains(said), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

#[test]
fn unusable_input_exits_with_3_and_is_named() {
    let bench = Bench::new();
    bench.write("header.csv", "t_s,x_m\n0,0\n");
    bench.write("empty.csv", "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n");
    bench.write("radius.json", r#"{"name":"a","ball":{"radius_m":-1}}"#);
    bench.write("broken.json", "{");
    bench.ok("simulate --seconds 1 -o good.csv");
    for (line, said) in [
        ("replay nowhere.csv", vec!["nowhere.csv"]),
        ("replay .", vec![".: "]),
        ("replay header.csv", vec!["header.csv", "cmd_qx_rad"]),
        ("replay empty.csv", vec!["empty.csv", "no usable row"]),
        ("replay --asset radius.json good.csv", vec!["radius.json", "/ball/radius_m"]),
        ("replay --asset broken.json good.csv", vec!["broken.json"]),
        ("calibrate --asset nowhere.json good.csv -o o.json", vec!["nowhere.json"]),
        ("simulate --asset radius.json -o o.csv", vec!["/ball/radius_m"]),
        ("score .", vec!["labels.json"]),
    ] {
        let done = bench.run(3, line);
        assert!(said.iter().all(|s| done.stderr.contains(s)), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

/// A session of two minutes is far more than a pipe holds.
#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("offbd"))
        .args(["simulate", "--seconds", "120"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let mut stderr = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
    assert_eq!((child.wait().unwrap().code(), stderr.as_str()), (Some(0), ""));
}
