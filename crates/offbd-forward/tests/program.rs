//! The program `offbd-forward`, as a process.

use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_offbd-forward"));
    command.args(arguments).output().expect("the program starts")
}

#[test]
fn the_help_names_the_program_itself() {
    let help = String::from_utf8(run(&["--help"]).stdout).expect("UTF-8");
    assert!(help.starts_with("Keeps telemetry on this machine"), "{help}");
    assert!(help.contains("offbd-forward list --spool spool.sqlite"), "{help}");
    assert!(!help.contains("offbd forward"), "{help}");
}

#[test]
fn errors_have_their_exit_codes() {
    let directory = tempfile::tempdir().expect("a directory");
    let missing = directory.path().join("missing.sqlite");
    let missing = missing.to_str().expect("UTF-8");
    for (arguments, code) in
        [(&["list", "--spool", missing][..], 3), (&["--to", "no address"], 2), (&["--unknown"], 2)]
    {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(code), "{output:?}");
        assert!(!output.stderr.is_empty());
    }
}
