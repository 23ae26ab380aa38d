use std::io::Read;
use std::process::{Command, Stdio};

use super::fixture::CliFixture;

const COMMANDS: [&str; 14] = [
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
    "forward",
    "backup",
    "migrate",
    "check",
];

#[test]
fn the_help_of_each_command_has_an_example_and_fits_in_eighty_columns() {
    let cli = CliFixture::new();
    for command in COMMANDS {
        let help = cli.ok(&format!("{command} --help"));
        assert!(help.stdout.contains(&format!("  offbd {command} ")), "no example of {command}");
        let wide = help.stdout.lines().find(|line| line.chars().count() > 80);
        assert_eq!(wide, None);
        assert_eq!(help.stderr, "");
        // Of clap, where the other commands are described as "Prints …".
        assert!(!help.stdout.contains("Print this message"), "{command}");
    }
    assert!(cli.ok("--help").stdout.contains("Exit status"));
}

#[test]
fn the_service_and_the_output_have_the_same_options_everywhere() {
    let cli = CliFixture::new();
    for (option, commands) in [
        ("--url <", &["watch", "forward"][..]),
        ("-o, --output <", &["calibrate", "simulate", "backup", "export", "drive-cycle"]),
    ] {
        for command in commands {
            let help = cli.ok(&format!("{command} --help")).stdout;
            assert!(help.contains(option), "{command} lacks {option}: {help}");
        }
    }
}

#[test]
fn the_long_version_has_the_commit_and_the_features() {
    let cli = CliFixture::new();
    let version = concat!("offbd ", env!("CARGO_PKG_VERSION"), "\n");
    assert_eq!(cli.ok("-V").stdout, version);
    let long = cli.ok("--version").stdout;
    let lines: Vec<&str> = long.lines().collect();
    assert_eq!(lines[0], version.trim());
    assert!(lines[1].starts_with("commit: "), "{long}");
    assert!(lines[2].starts_with("features: lab"), "{long}");
}

#[test]
fn invalid_arguments_exit_with_2_and_a_hint() {
    let cli = CliFixture::new();
    for (line, expected) in [
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
        let done = cli.run(2, line);
        assert!(done.stderr.contains(expected), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

#[test]
fn unusable_input_exits_with_3_and_the_name_of_the_file() {
    let cli = CliFixture::new();
    cli.write("header.csv", "t_s,x_m\n0,0\n");
    cli.write("empty.csv", "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n");
    cli.write("radius.json", r#"{"name":"a","ball":{"radius_m":-1}}"#);
    cli.write("broken.json", "{");
    for folder in ["bad", "none"] {
        std::fs::create_dir(cli.path(folder)).unwrap();
    }
    cli.write("bad/header.csv", "t_s,x_m\n0,0\n");
    cli.write("bad/notes.txt", "monday\n");
    cli.ok("simulate --seconds 1 -o good.csv");
    for (line, expected) in [
        ("replay nowhere.csv", vec!["nowhere.csv"]),
        ("replay bad", vec!["bad/header.csv: ", "bad/notes.txt: "]),
        ("replay none", vec!["none: the folder has no files"]),
        ("replay header.csv", vec!["header.csv", "cmd_qx_rad"]),
        ("replay empty.csv", vec!["empty.csv", "no usable row"]),
        ("replay --asset radius.json good.csv", vec!["radius.json", "/ball/radius_m"]),
        ("replay --asset broken.json good.csv", vec!["broken.json"]),
        ("calibrate --asset nowhere.json good.csv -o o.json", vec!["nowhere.json"]),
        ("simulate --asset radius.json -o o.csv", vec!["/ball/radius_m"]),
        ("score .", vec!["labels.json"]),
    ] {
        let done = cli.run(3, line);
        assert!(expected.iter().all(|s| done.stderr.contains(s)), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

/// A session of two minutes is much larger than the buffer of a pipe.
#[test]
fn a_closed_stdout_pipe_is_not_an_error() {
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
