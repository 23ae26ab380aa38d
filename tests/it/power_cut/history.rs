//! A recorded run of the service: several lives on one folder, in which devices send until
//! they are acknowledged.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use futures_util::future::join_all;
use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::Value;

use super::disk::Disk;
use crate::support::calls::{
    CallControl, CallError, CallFault, CallKind, CallRecord, Operation, read_records,
};
use crate::support::device::Random;
use crate::support::process::{Process, ended};
use crate::support::{Client, DEADLINE, batch, registration, rig};

/// The backup that is made in the first life.
pub const COPY: &str = "copy.sqlite";

/// A rig that is recorded: its name, its samples and from which one on its x servo is dead.
/// The recording of the last one is open in the end.
pub const RIGS: [(&str, usize, usize); 3] =
    [("a", 1500, 500), ("b", 600, usize::MAX), ("c", 900, 300)];

/// Size limits of the journal in the lives of the service: parts are folded; every commit is
/// folded; everything fits.
const JOURNAL_BYTES: [&str; 3] = ["20000", "1", "16777216"];

/// Syncs of a life, one of which fails.
const SYNCS: usize = 60;

/// Most samples of a batch, except one that has its own chunks.
const BATCH: usize = 80;

/// What was acknowledged before a power cut.
#[derive(Default)]
pub struct Acknowledged {
    pub registered: BTreeSet<String>,
    pub n_samples: BTreeMap<String, usize>,
    pub ended: BTreeSet<String>,
    pub is_backed_up: bool,
}

pub struct History {
    folder: tempfile::TempDir,
    pub records: Vec<CallRecord>,
}

impl History {
    /// Lets a service live three times; in each life a sync fails on request.
    pub async fn record(library: &Path, fails_syncs: bool, random: &mut Random) -> Self {
        loop {
            if let Some(history) = Self::try_record(library, fails_syncs, random).await {
                return history;
            }
        }
    }

    /// Returns `None` if a life ended while a record was written: what it did last is unknown
    /// then.
    async fn try_record(library: &Path, fails_syncs: bool, random: &mut Random) -> Option<Self> {
        let (folder, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let mut control = CallControl::new(library, folder.path(), &scratch.path().join("control"));
        let mut records = Vec::new();
        for life in 0..JOURNAL_BYTES.len() {
            let file = scratch.path().join(format!("record-{life}"));
            control = control.record_to(&file);
            let number = 1 + random.below(SYNCS) as u64;
            let fault = CallFault { kind: CallKind::Sync, number, error: CallError::Io };
            control.begin(fails_syncs.then_some(fault), 0);
            live(&control, folder.path(), life, random).await;
            records.extend(read_records(&file)?);
        }
        Some(Self { folder, records })
    }

    /// Lets a service live `n_earlier` times, and starts it again while the sync with this
    /// number fails; if it starts nevertheless, a rig is registered.
    pub async fn of_failed_start(library: &Path, n_earlier: u64, number: u64) -> Self {
        loop {
            if let Some(history) = Self::try_of_failed_start(library, n_earlier, number).await {
                return history;
            }
        }
    }

    /// Returns `None` if the service ended while one of its threads wrote a record.
    async fn try_of_failed_start(library: &Path, n_earlier: u64, number: u64) -> Option<Self> {
        let (folder, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let file = scratch.path().join("record");
        let control = CallControl::new(library, folder.path(), &scratch.path().join("control"));
        let control = control.record_to(&file);
        for _ in 0..n_earlier {
            stop(Process::start_with(folder.path(), &control.environment())).await;
        }
        let fault = CallFault { kind: CallKind::Sync, number, error: CallError::Io };
        control.begin(Some(fault), 0);
        if let Ok(process) = Process::try_start(folder.path(), &control.environment()) {
            let (asset, body) = (RIGS[0].0, registration(RIGS[0].0));
            let id = format!("registered/{asset}");
            request(&process.client, Method::POST, "assets", &body, &id).await;
            stop(process).await;
        }
        Some(Self { records: read_records(&file)?, folder })
    }

    /// The disk after the first `n` records.
    pub fn disk(&self, n: usize) -> Disk {
        let mut disk = Disk::new(self.folder());
        self.records[..n].iter().for_each(|record| disk.apply(record));
        disk
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The syncs that failed among the first `n` records, with their files.
    pub fn failed_syncs(&self, n: usize) -> Vec<(usize, &str)> {
        let records = self.records[..n].iter().enumerate();
        let failed = records.filter(|(_, record)| record.operation == Operation::FailedSync);
        failed.map(|(i, record)| (i, record.path.as_str())).collect()
    }

    /// The records of acknowledgements that are sent.
    pub fn answers(&self) -> Vec<usize> {
        let is_answer = |i: &usize| acknowledgement(&self.records[*i]).is_some();
        (0..self.records.len()).filter(is_answer).collect()
    }

    /// What was acknowledged by the first `n` records.
    pub fn acknowledged(&self, n: usize) -> Acknowledged {
        let mut all = Acknowledged::default();
        for id in self.records[..n].iter().filter_map(acknowledgement) {
            match id.split_once('/').unwrap() {
                ("registered", asset) => drop(all.registered.insert(asset.to_owned())),
                ("ended", asset) => drop(all.ended.insert(asset.to_owned())),
                ("ready", "copy") => all.is_backed_up = true,
                ("ready", _) => {}
                (asset, n) => {
                    let known = all.n_samples.entry(asset.to_owned()).or_default();
                    *known = n.parse::<usize>().unwrap().max(*known);
                }
            }
        }
        all
    }
}

/// Returns the id of the request that a record acknowledges. It says what is acknowledged.
fn acknowledgement(record: &CallRecord) -> Option<String> {
    let Operation::Send(data) = &record.operation else { return None };
    let head = String::from_utf8_lossy(data);
    let mut lines = head.split("\r\n");
    lines.next().filter(|status| status.starts_with("HTTP/1.1 2"))?;
    let id = lines.find_map(|line| line.strip_prefix("x-request-id: "));
    id.filter(|id| id.contains('/')).map(str::to_owned)
}

/// One life of the service: each rig sends a part of its samples, the first session ends and
/// is backed up, and the service is stopped or, in the second life, killed.
async fn live(control: &CallControl, folder: &Path, life: usize, random: &mut Random) {
    let mut environment = control.environment();
    environment.push(("OFFBD_LIMITS__JOURNAL_BYTES", Path::new(JOURNAL_BYTES[life])));
    let process = Process::try_start(folder, &environment).unwrap_or_else(|_| {
        control.begin(None, 0);
        Process::start_with(folder, &environment)
    });
    let client = &process.client;
    let devices = RIGS.iter().map(|&(asset, n, dead_from)| {
        let random = Random(random.below(1 << 30) as u64);
        let part = n * life / JOURNAL_BYTES.len()..n * (life + 1) / JOURNAL_BYTES.len();
        send(client, asset, rig(n, dead_from), part, random)
    });
    join_all(devices.collect::<Vec<_>>()).await;
    if life == JOURNAL_BYTES.len() - 1 {
        end(client, RIGS[0].0).await;
        back_up(client, folder, &environment).await;
        end(client, RIGS[1].0).await;
    }
    if life != 1 {
        stop(process).await;
    }
}

async fn stop(mut process: Process) {
    process.terminate();
    ended(&mut process.child).await;
}

/// Registers the rig if it is new, and sends a part of its samples.
async fn send(
    client: &Client,
    asset: &str,
    samples: Vec<Sample>,
    part: std::ops::Range<usize>,
    mut random: Random,
) {
    if part.start == 0 {
        let id = format!("registered/{asset}");
        request(client, Method::POST, "assets", &registration(asset), &id).await;
    }
    let mut at = part.start;
    while at < part.end {
        let end = (at + 1 + random.below(BATCH)).min(part.end);
        let (path, id) = (format!("assets/{asset}/telemetry"), format!("{asset}/{end}"));
        request(client, Method::POST, &path, &batch(Some("s"), &samples[at..end]), &id).await;
        at = end;
    }
}

async fn end(client: &Client, asset: &str) {
    let session = client.session(asset, "s").await;
    let path = format!("sessions/{}/end", session["id"].as_str().unwrap());
    request(client, Method::POST, &path, &Value::Null, &format!("ended/{asset}")).await;
}

/// Backs up; the answer to the next request is what comes after it in the record.
async fn back_up(client: &Client, folder: &Path, environment: &[(&str, &Path)]) {
    let copy: PathBuf = folder.join(COPY);
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_offbd"));
    command.arg("backup").arg("--data").arg(folder).arg(&copy);
    let output = command.envs(environment.iter().copied()).output().unwrap();
    if output.status.success() {
        request(client, Method::GET, "/readyz", &Value::Null, "ready/copy").await;
    }
}

/// Repeats a request until it is acknowledged.
async fn request(client: &Client, method: Method, path: &str, body: &Value, id: &str) {
    let repeat = async {
        loop {
            let request = client.request(method.clone(), path).header("x-request-id", id);
            let answer = client.send(request.json(body)).await;
            match answer.status.as_u16() {
                200..300 | 409 => return,
                429 | 503 => tokio::task::yield_now().await,
                _ => panic!("{id}: {}", answer.text),
            }
        }
    };
    let answered = tokio::time::timeout(DEADLINE, repeat).await;
    answered.unwrap_or_else(|_| panic!("{id}: not acknowledged in time"));
}
