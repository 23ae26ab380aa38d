//! A device sends, a person backs up, and the service starts and stops, while one call of one
//! of the processes fails. All of them try again, as a supervisor and a device do.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::{Value, json};

use crate::support::calls::{CALL_KINDS, CallControl, CallFault, CallKind};
use crate::support::process::{Process, Refusal, ended};
use crate::support::{Answer, DEADLINE, batch, judged, on_postgres, read_csv, registration, rig};

/// Allocations of this size are made for buffers, queues and chunks, not for single values.
pub const LARGE_BYTES: u64 = 4096;

/// So small that the journal is folded while the device sends.
const JOURNAL_BYTES: &str = "20000";

/// Samples of a batch. One of the batches goes to chunks with its own commit.
const BATCHES: [usize; 4] = [60, 140, 1200, 100];

/// The processes of which a call may fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    FirstLife,
    Backup,
    SecondLife,
}

pub const STAGES: [Stage; 3] = [Stage::FirstLife, Stage::Backup, Stage::SecondLife];

#[derive(Clone, Copy, Debug)]
pub struct Failure {
    pub stage: Stage,
    pub fault: CallFault,
}

/// What a run led to.
#[derive(Default)]
pub struct Outcome {
    /// Verdicts and faults, which failures must not change.
    pub results: Value,
    pub has_failed: bool,
    pub is_refused: bool,
    pub is_backup_failed: bool,
    /// Whether the service ended by itself.
    pub is_ended: bool,
    counts: Vec<(Stage, CallKind, u64)>,
}

impl Outcome {
    pub fn count(&self, stage: Stage, kind: CallKind) -> u64 {
        let of = |c: &&(Stage, CallKind, u64)| c.0 == stage && c.1 == kind;
        self.counts.iter().find(of).map_or(0, |count| count.2)
    }
}

pub struct Scenario {
    data: tempfile::TempDir,
    scratch: tempfile::TempDir,
    library: PathBuf,
    failure: Option<Failure>,
    /// Smallest allocation that counts; if it is not zero, calls count once the service serves.
    large_bytes: u64,
    process: Option<Process>,
    controls: Vec<(Stage, CallControl)>,
    outcome: Outcome,
}

impl Scenario {
    pub fn new(library: &Path, failure: Option<Failure>, large_bytes: u64) -> Self {
        assert!(!on_postgres(), "this is a test of the files of SQLite");
        Self {
            data: tempfile::tempdir().unwrap(),
            scratch: tempfile::tempdir().unwrap(),
            library: library.to_owned(),
            failure,
            large_bytes,
            process: None,
            controls: Vec::new(),
            outcome: Outcome::default(),
        }
    }

    pub async fn run(mut self) -> Outcome {
        let (first, second) = (rig(BATCHES.iter().sum(), 500), rig(200, 200));
        self.start(Stage::FirstLife);
        let made = self.request(Method::POST, "assets", &registration("a")).await;
        assert!([201, 409].contains(&made.status.as_u16()), "{}", made.text);
        self.send("first", &first, 0).await;
        let verdict = self.end("first").await;
        assert_eq!(verdict["verdict_hash"], judged("a", &first).0, "{:?}", self.failure);
        self.back_up(first.len()).await;
        self.send("second", &second[..120], 0).await;
        self.stop().await;
        self.start(Stage::SecondLife);
        // The last acknowledgement may have been lost, so the device repeats.
        self.send("second", &second, 60).await;
        let verdicts = [verdict, self.end("second").await];
        self.stop().await;
        self.process = Some(Process::start(self.data.path()));
        for (name, samples) in [("first", &first), ("second", &second)] {
            assert_eq!(&self.recording(name).await, samples, "{:?}: {name}", self.failure);
        }
        self.outcome.results = json!([verdicts, self.faults().await]);
        self.process = None;
        self.count();
        check(self.data.path(), first.len() + second.len()).await;
        std::mem::take(&mut self.outcome)
    }

    /// Prepares to watch the process of `stage` if its calls are to be counted or one of them
    /// fails; returns its environment variables.
    fn watch(&mut self, stage: Stage) -> Vec<(&'static str, PathBuf)> {
        if self.failure.is_some_and(|failure| failure.stage != stage) {
            return Vec::new();
        }
        let file = self.scratch.path().join(format!("{stage:?}"));
        let control = CallControl::new(&self.library, self.data.path(), &file);
        if self.large_bytes == 0 || stage == Stage::Backup {
            control.begin(self.failure.map(|failure| failure.fault), self.large_bytes);
        }
        let variables = control.environment().into_iter();
        let variables = variables.map(|(name, value)| (name, value.to_owned())).collect();
        self.controls.push((stage, control));
        variables
    }

    /// Takes the counts of the processes that were watched.
    fn count(&mut self) {
        for (stage, control) in &self.controls {
            self.outcome.has_failed |= control.has_failed();
            let kinds = CALL_KINDS.map(|kind| (*stage, kind, control.count(kind)));
            self.outcome.counts.extend(kinds);
        }
    }

    fn start(&mut self, stage: Stage) {
        let variables = self.watch(stage);
        let mut environment: Vec<_> = variables.iter().map(|(n, v)| (*n, v.as_path())).collect();
        environment.push(("OFFBD_LIMITS__JOURNAL_BYTES", Path::new(JOURNAL_BYTES)));
        match Process::try_start(self.data.path(), &environment) {
            Ok(process) => self.process = Some(process),
            Err(Refusal { status, log }) => {
                self.outcome.is_refused = true;
                let is_named = status.code() == Some(1) && !log.contains("panicked");
                assert!(is_named, "{:?}: {status}: {log}", self.failure);
                self.process = Some(Process::start(self.data.path()));
            }
        }
        let watched = self.controls.last().filter(|(watched, _)| *watched == stage);
        if let Some((_, control)) = watched.filter(|_| self.large_bytes > 0) {
            control.begin(self.failure.map(|failure| failure.fault), self.large_bytes);
        }
    }

    /// Stops the service as an administrator does.
    async fn stop(&mut self) {
        self.request(Method::GET, "/readyz", &Value::Null).await.expect(200);
        let mut process = self.process.take().unwrap();
        process.terminate();
        let status = ended(&mut process.child).await;
        if !status.success() {
            self.note_end(status, &process.log());
        }
    }

    /// Takes note that the service has ended by itself: it may do so only without memory.
    fn note_end(&mut self, status: ExitStatus, log: &str) {
        self.outcome.is_ended = true;
        let is_memory = self.large_bytes > 0;
        assert!(is_memory, "{:?}: the service ends with {status}: {log}", self.failure);
    }

    /// Repeats a request until there is an answer other than 429 and 503; meanwhile the
    /// service is started again if it has ended. To SQLite a read that fails is damage, so
    /// that 500 may be the answer once.
    async fn request(&mut self, method: Method, path: &str, body: &Value) -> Answer {
        let failure = self.failure;
        let mut refused = String::new();
        let is_read = failure.is_some_and(|failure| failure.fault.kind == CallKind::Read);
        let mut again: &[u16] = if is_read { &[429, 500, 503] } else { &[429, 503] };
        let repeat = async {
            loop {
                let process = self.process.as_mut().unwrap();
                match answer(process, &method, path, body).await {
                    Some(answer) if !again.contains(&answer.status.as_u16()) => return answer,
                    Some(answer) => {
                        if answer.status == 500 {
                            again = &[429, 503];
                        }
                        refused = answer.text;
                    }
                    None => {
                        if let Some(status) = process.child.try_wait().unwrap() {
                            let log = process.log();
                            self.note_end(status, &log);
                            self.process = Some(Process::start(self.data.path()));
                        }
                    }
                }
                tokio::task::yield_now().await;
            }
        };
        let answer = tokio::time::timeout(DEADLINE, repeat).await;
        answer.unwrap_or_else(|_| panic!("{failure:?}: {path} is not answered: {refused}"))
    }

    async fn send(&mut self, session: &str, samples: &[Sample], repeated_from: usize) {
        let mut at = repeated_from;
        for n in BATCHES {
            let end = (at + n).min(samples.len());
            let body = batch(Some(session), &samples[at..end]);
            if at < end {
                let taken = self.request(Method::POST, "assets/a/telemetry", &body).await;
                let taken = taken.expect(200);
                let n = |field: &str| taken[field].as_u64().unwrap();
                assert_eq!(n("accepted") + n("duplicate"), (end - at) as u64, "{taken}");
            }
            at = end;
        }
    }

    async fn id(&mut self, session: &str) -> String {
        let page = self.request(Method::GET, "sessions?asset=a", &Value::Null).await.expect(200);
        let mut found = page["items"].as_array().unwrap().iter();
        let found = found.find(|item| item["name"] == session);
        found.unwrap_or_else(|| panic!("{page}"))["id"].as_str().unwrap().to_owned()
    }

    /// Ends a session; returns what its verdict says, without times.
    async fn end(&mut self, session: &str) -> Value {
        let path = format!("sessions/{}/end", self.id(session).await);
        let ended = self.request(Method::POST, &path, &Value::Null).await;
        assert_eq!(ended.status, 200, "{:?}: {}", self.failure, ended.text);
        let verdict = &ended.json()["verdict"];
        json!({ "verdict_hash": verdict["verdict_hash"], "faults": verdict["faults"] })
    }

    async fn recording(&mut self, session: &str) -> Vec<Sample> {
        let path = format!("sessions/{}/telemetry", self.id(session).await);
        let csv = self.request(Method::GET, &path, &Value::Null).await;
        assert_eq!(csv.status, 200, "{:?}: {}", self.failure, csv.text);
        read_csv(&csv.text)
    }

    async fn faults(&mut self) -> Vec<Value> {
        let path = "assets/a/faults?status=all";
        let page = self.request(Method::GET, path, &Value::Null).await.expect(200);
        let items = page["items"].as_array().unwrap().iter();
        items.map(|fault| json!([fault["code"], fault["status"]])).collect()
    }

    /// Backs up, again if it fails, and restores the copy elsewhere.
    async fn back_up(&mut self, n_samples: usize) {
        let variables = self.watch(Stage::Backup);
        let (data, copy) = (self.data.path().to_owned(), self.data.path().join("copy.sqlite"));
        let backup =
            async |variables| offbd(&["backup", "--data"], &data, &[&copy], variables).await;
        let (status, log) = backup(&variables).await;
        if !status.success() {
            self.outcome.is_backup_failed = true;
            assert!(status.code() == Some(1) || self.large_bytes > 0, "{status}: {log}");
            assert!(!log.is_empty(), "{:?}: {status}", self.failure);
            // The name may be there, but is not known to be on the disk.
            if !copy.exists() {
                let (status, log) = backup(&[]).await;
                assert!(status.success(), "{:?}: {log}", self.failure);
            }
        }
        let restored = tempfile::tempdir().unwrap();
        let (status, log) = offbd(&["restore", "--data"], restored.path(), &[&copy], &[]).await;
        assert!(status.success(), "{:?}: {log}", self.failure);
        check(restored.path(), n_samples).await;
    }
}

/// Says which call has failed in a scenario that panics, and what the service has printed.
impl Drop for Scenario {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let log = self.process.as_ref().map(Process::log);
            eprintln!("{:?}: {}", self.failure, log.unwrap_or_default());
        }
    }
}

/// Sends a request; `None` if there is no answer, or a part.
async fn answer(process: &Process, method: &Method, path: &str, body: &Value) -> Option<Answer> {
    let request = process.client.request(method.clone(), path).json(body);
    let response = request.send().await.ok()?;
    let (status, headers) = (response.status(), response.headers().clone());
    Some(Answer { status, headers, text: response.text().await.ok()? })
}

/// Runs a command of `offbd` on the store in `data`; returns its status and what it prints.
async fn offbd(
    words: &[&str],
    data: &Path,
    rest: &[&Path],
    environment: &[(&str, PathBuf)],
) -> (ExitStatus, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_offbd"));
    command.args(words).arg(data).args(rest).stdout(Stdio::piped()).stderr(Stdio::piped());
    let environment = environment.iter().map(|(name, value)| (*name, value));
    let mut child = command.envs(environment).spawn().unwrap();
    ended(&mut child).await;
    let output = child.wait_with_output().unwrap();
    let printed = [output.stdout, output.stderr].concat();
    (output.status, String::from_utf8(printed).unwrap())
}

/// Checks that the store is whole and holds `n` samples.
async fn check(data: &Path, n: usize) {
    let (status, printed) = offbd(&["check", "--data"], data, &[], &[]).await;
    assert!(status.success(), "{printed}");
    assert!(printed.contains(&format!(" {n} samples")), "{printed}");
}
