//! A temporary directory in which the tests of the command line run `offbd`.

use std::path::PathBuf;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// Runs commands in a temporary directory.
pub struct CliFixture {
    dir: TempDir,
}

/// The output of a command.
pub struct CommandOutput {
    pub stdout: String,
    pub stderr: String,
}

impl CliFixture {
    pub fn new() -> Self {
        Self { dir: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    pub fn write(&self, name: &str, text: &str) -> &Self {
        std::fs::write(self.path(name), text).unwrap();
        self
    }

    /// Runs `offbd` with the arguments in `line` and expects the exit code `code`.
    pub fn run(&self, code: i32, line: &str) -> CommandOutput {
        self.args(code, &line.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs `offbd` with arguments that may have blanks.
    pub fn args(&self, code: i32, args: &[&str]) -> CommandOutput {
        let mut command = Command::cargo_bin("offbd").unwrap();
        command.args(args).current_dir(self.dir.path());
        // Temporary files also go to the directory, so that tests can check for them.
        let output = command.env("TMPDIR", self.dir.path()).output().unwrap();
        let done = CommandOutput {
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        };
        assert_eq!(output.status.code(), Some(code), "offbd {args:?}\n{}", done.stderr);
        done
    }

    /// Runs `offbd` with this environment and expects success; returns stdout.
    pub fn with(&self, environment: &[(&str, &str)], line: &str) -> String {
        let mut command = Command::cargo_bin("offbd").unwrap();
        command.args(line.split_whitespace()).current_dir(self.dir.path());
        let done = command.envs(environment.iter().copied()).assert().success();
        String::from_utf8(done.get_output().stdout.clone()).unwrap()
    }

    /// Runs `offbd` and expects success.
    pub fn ok(&self, line: &str) -> CommandOutput {
        self.run(0, line)
    }

    /// Writes the asset file of a calibrated rig to `calibrated.json`.
    pub fn calibrated(&self) -> &Self {
        self.ok(
            "simulate --rig rig.json --reference lissajous --seconds 90 --seed 7 -o healthy.csv",
        );
        self.ok("calibrate --asset rig.json healthy.csv -o calibrated.json");
        self
    }
}

impl CommandOutput {
    /// Returns stdout, which has one JSON object per line.
    pub fn json(&self) -> Vec<Value> {
        self.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// Returns the summary lines of stdout.
    pub fn summaries(&self) -> Vec<Value> {
        self.json().into_iter().filter(|line| line["type"] == "summary").collect()
    }
}
