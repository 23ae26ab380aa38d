//! The service as a separate process, which can be killed.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, Result};

/// A service; it is killed when this is dropped.
pub(crate) struct Process {
    child: Child,
    pub(crate) address: SocketAddr,
}

impl Process {
    /// Starts it with the given settings (TOML) on a free port, and waits until it serves.
    pub(crate) fn start(data: &Path, settings: &str) -> Result<Self> {
        let file = data.join("offbd.toml");
        std::fs::write(&file, settings)?;
        let mut child = Command::new(env!("CARGO_BIN_EXE_offbd"))
            .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json", "--data"])
            .arg(data)
            .arg("--config")
            .arg(&file)
            .stderr(Stdio::piped())
            .spawn()?;
        let mut log = BufReader::new(child.stderr.take().context("the log is piped")?).lines();
        let address = loop {
            let line = log.next().context("the service does not start")??;
            let line: serde_json::Value = serde_json::from_str(&line)?;
            if line["message"] == "serving" {
                break line["address"].as_str().context("no address")?.parse()?;
            }
        };
        // The rest of the log is read, so that the service does not wait.
        std::thread::spawn(move || log.map_while(Result::ok).count());
        Ok(Self { child, address })
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
