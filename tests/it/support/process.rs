//! The service as a separate process, which can be killed.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::Client;

pub struct Process {
    pub child: Child,
    pub client: Client,
}

impl Process {
    pub fn start(data: &Path) -> Self {
        Self::start_with(data, &[])
    }

    /// Starts the service with additional environment variables.
    pub fn start_with(data: &Path, environment: &[(&str, &Path)]) -> Self {
        let mut child = command(data).envs(environment.iter().copied()).spawn().unwrap();
        let mut log = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
        let mut output = String::new();
        let address = log.find_map(|line| {
            output.push_str(&line);
            let line: serde_json::Value = serde_json::from_str(&line).ok()?;
            (line["message"] == "serving").then(|| line["address"].as_str().unwrap().to_owned())
        });
        let address = address.unwrap_or_else(|| panic!("the service does not start: {output}"));
        std::thread::spawn(move || log.for_each(drop));
        Self { child, client: Client::new(address) }
    }

    /// Starts a service and kills it during its start, after a time that grows with `n`.
    pub fn start_and_kill(data: &Path, n: u64) {
        let mut child = command(data).spawn().unwrap();
        for _ in 0..n {
            assert!(child.try_wait().unwrap().is_none_or(|status| status.success()));
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
}

fn command(data: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_offbd"));
    command
        .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json", "--data"])
        .arg(data)
        .args(super::config(data).database.iter().flat_map(|url| ["--database", url]))
        .stderr(Stdio::piped());
    command
}

impl Drop for Process {
    /// Kills the process with SIGKILL.
    fn drop(&mut self) {
        // Fails if the process has already ended.
        let _ = self.child.kill();
        self.child.wait().unwrap();
    }
}
