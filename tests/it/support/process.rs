//! The service as a separate process, which can be killed.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, mpsc};

use super::{Client, DEADLINE};

pub struct Process {
    pub child: Child,
    pub client: Client,
    log: Arc<Mutex<String>>,
}

/// A service that does not serve yet. It is killed when this is dropped.
pub struct Starting {
    child: Option<Child>,
    address: mpsc::Receiver<String>,
    log: Arc<Mutex<String>>,
}

/// A service that ended before it served.
#[derive(Debug)]
pub struct Refusal {
    pub status: ExitStatus,
    pub log: String,
}

impl Process {
    pub fn start(data: &Path) -> Self {
        Self::start_with(data, &[])
    }

    /// Starts the service with additional environment variables.
    pub fn start_with(data: &Path, environment: &[(&str, &Path)]) -> Self {
        let started = Self::try_start(data, environment);
        started.unwrap_or_else(|Refusal { log, .. }| panic!("the service does not start: {log}"))
    }

    /// Starts the service, which may end before it serves.
    pub fn try_start(data: &Path, environment: &[(&str, &Path)]) -> Result<Self, Refusal> {
        Self::try_start_program(&program(), data, environment)
    }

    /// As [`Self::try_start`], with a program of one's own.
    pub fn try_start_program(
        program: &Path,
        data: &Path,
        environment: &[(&str, &Path)],
    ) -> Result<Self, Refusal> {
        Self::begin(program, data, environment).served()
    }

    /// Starts the service without waiting until it serves.
    pub fn begin(program: &Path, data: &Path, environment: &[(&str, &Path)]) -> Starting {
        let mut child = command(program, data, environment).spawn().unwrap();
        let log = Arc::<Mutex<String>>::default();
        let address = read_log(child.stderr.take().unwrap(), log.clone());
        Starting { child: Some(child), address, log }
    }

    /// Returns what the service has logged so far.
    pub fn log(&self) -> String {
        self.log.lock().unwrap().clone()
    }

    /// Sends SIGTERM.
    pub fn terminate(&self) {
        terminate(&self.child, "-TERM");
    }

    /// Starts a service and kills it during its start, after a time that grows with `n`.
    pub fn start_and_kill(data: &Path, n: u64) {
        let mut child = command(&program(), data, &[]).spawn().unwrap();
        for _ in 0..n {
            assert!(child.try_wait().unwrap().is_none_or(|status| status.success()));
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
}

impl Starting {
    /// Returns what the service has logged so far.
    pub fn log(&self) -> String {
        self.log.lock().unwrap().clone()
    }

    /// Waits until the service serves, unless it ends before.
    pub fn served(mut self) -> Result<Process, Refusal> {
        let address = self.address.recv_timeout(DEADLINE);
        let mut child = self.child.take().unwrap();
        match address {
            Ok(address) => {
                Ok(Process { child, client: Client::new(address), log: self.log.clone() })
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                let status = child.wait().unwrap();
                Err(Refusal { status, log: self.log() })
            }
            Err(mpsc::RecvTimeoutError::Timeout) => {
                child.kill().unwrap();
                child.wait().unwrap();
                panic!("the service neither serves nor ends: {}", self.log())
            }
        }
    }

    /// Sends SIGTERM, and waits until the service has ended.
    pub async fn stop(mut self) -> ExitStatus {
        let child = self.child.as_mut().unwrap();
        terminate(child, "-TERM");
        ended(child).await
    }
}

impl Drop for Starting {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // Fails if the process has already ended.
            let _ = child.kill();
            child.wait().unwrap();
        }
    }
}

/// Sends `signal`, such as `-TERM`.
pub fn terminate(child: &Child, signal: &str) {
    let pid = child.id().to_string();
    assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
}

/// Reads the log on a thread; the address at which the service listens is sent.
fn read_log(stderr: ChildStderr, log: Arc<Mutex<String>>) -> mpsc::Receiver<String> {
    let (send, address) = mpsc::channel();
    std::thread::spawn(move || {
        let mut send = Some(send);
        for line in BufReader::new(stderr).lines().map_while(Result::ok) {
            let fields = serde_json::from_str::<serde_json::Value>(&line).unwrap_or_default();
            *log.lock().unwrap() += &(line + "\n");
            if fields["message"] == "serving" {
                let address = fields["address"].as_str().unwrap().to_owned();
                send.take().into_iter().for_each(|send| drop(send.send(address.clone())));
            }
        }
    });
    address
}

/// Waits until a process has ended.
pub async fn ended(child: &mut Child) -> ExitStatus {
    super::eventually(|| {
        let status = child.try_wait().unwrap();
        async move { status }
    })
    .await
}

/// The program under test.
pub fn program() -> PathBuf {
    PathBuf::from(env!("CARGO_BIN_EXE_offbd"))
}

fn command(program: &Path, data: &Path, environment: &[(&str, &Path)]) -> Command {
    let mut command = Command::new(program);
    command
        .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json", "--data"])
        .arg(data)
        .envs(environment.iter().copied())
        .stderr(Stdio::piped());
    if !environment.iter().any(|(name, _)| *name == "OFFBD_DATABASE") {
        command.args(super::config(data).database.iter().flat_map(|url| ["--database", url]));
    }
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
