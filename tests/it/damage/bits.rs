//! One wrong bit anywhere in an SQLite file: every answer is right, or an error that names
//! the damage, and a check of the store finds it.

use std::collections::HashSet;
use std::path::PathBuf;
use std::time::Duration;

use crate::support::{Client, ServiceFixture, config, eventually, on_postgres, rig};
use offbd::{server, store};
use reqwest::Method;
use serde_json::{Value, json};
use store::Location;

/// Number of wrong bits, one after the other, unless the environment variable FLIPS is set.
const FLIPS: usize = 40;

/// An answer that takes longer is none.
const DEADLINE: Duration = Duration::from_secs(30);

/// What a service gives for a request.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Response {
    Body(String),
    /// An error that names the damage, or a body that breaks off.
    Damaged,
    /// Another error.
    Other(String),
}

/// What happens with one wrong bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Outcome {
    /// The service does not start, and says that the store is damaged.
    Refused,
    /// Answers that need the damaged part name the damage, all others are right.
    Named,
    /// Nothing that is asked for needs the damaged part.
    NotNeeded,
    /// At least one answer is wrong, or an error that does not name the damage, or the service
    /// does not stop.
    Wrong,
}

/// A stopped service with rows of every kind.
struct Stopped {
    fixture: ServiceFixture,
    file: PathBuf,
    whole: Vec<u8>,
    paths: Vec<String>,
    right: Vec<Response>,
}

/// Fills the store. Returns the paths of all that can be read.
async fn fill(client: &Client) -> Vec<String> {
    let samples = rig(3000, 1000);
    for asset in ["a", "b"] {
        client.asset(asset).await;
    }
    for part in samples.chunks(500) {
        client.telemetry("a", Some("s"), part).await;
    }
    client.post("assets/a/faults/x_servo/acknowledge", &Value::Null).await.expect(200);
    let ended = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    client.telemetry("b", Some("open"), &samples[..1500]).await;
    let open = client.session("b", "open").await["id"].as_str().unwrap().to_owned();
    let replay = client.post(&format!("sessions/{ended}/replays"), &json!({})).await.expect(202);
    let replay = finished(client, format!("replays/{}", replay["id"].as_str().unwrap())).await;
    let body = json!({"sessions": [ended]});
    let job = client.post("assets/a/calibrations", &body).await.expect(202);
    let calibration = format!("assets/a/calibrations/{}", job["id"].as_str().unwrap());
    let calibration = finished(client, calibration).await;
    let token = client.post("tokens", &json!({"name": "ann", "role": "viewer"})).await;
    let token = token.expect(201)["id"].as_str().unwrap().to_owned();
    let mut paths: Vec<String> =
        ["assets", "sessions", "faults?status=all", "events?after=0", "fleet", "tokens", "audit"]
            .map(str::to_owned)
            .into();
    paths.extend([replay, calibration, format!("tokens/{token}")]);
    for asset in ["a", "b"] {
        let of = ["", "/state", "/faults?status=all", "/learning", "/calibrations", "/trends"];
        paths.extend(of.map(|path| format!("assets/{asset}{path}")));
        let of = ["", "/history", "/recording"];
        paths.extend(of.map(|path| format!("assets/{asset}/faults/x_servo{path}")));
    }
    for session in [ended, open] {
        let of = ["", "/faults", "/telemetry", "/trace"];
        paths.extend(of.map(|path| format!("sessions/{session}{path}")));
    }
    paths
}

/// Waits until the job at `path` has ended, with or without success.
async fn finished(client: &Client, path: String) -> String {
    eventually(async || {
        let job = client.get(&path).await.expect(200);
        (job["state"] == "done" || job["state"] == "failed").then_some(())
    })
    .await;
    path
}

async fn responses(client: &Client, paths: &[String]) -> Vec<Response> {
    let mut found = Vec::new();
    for path in paths {
        let late = |_| Response::Other("late".to_owned());
        found.push(
            tokio::time::timeout(DEADLINE, response(client, path)).await.unwrap_or_else(late),
        );
    }
    found
}

async fn response(client: &Client, path: &str) -> Response {
    if path.starts_with("events") {
        return events(client, path).await;
    }
    let Ok(response) = client.request(Method::GET, path).send().await else {
        // An export breaks off; here before the head of its answer.
        return Response::Damaged;
    };
    let status = response.status();
    match response.text().await {
        // A rig becomes silent by the clock, ten seconds after its last sample.
        Ok(text) if status == 200 => {
            Response::Body(text.replace("\"silent\":true", "\"silent\":false"))
        }
        Ok(text) if text.contains("urn:offbd:problem:corrupt") => Response::Damaged,
        Ok(text) => Response::Other(format!("{status}: {text}")),
        Err(_) if status == 200 => Response::Damaged,
        Err(error) => Response::Other(format!("{status}: {error}")),
    }
}

/// Reads the stored events. The stream continues after them, and ends if they are damaged.
async fn events(client: &Client, path: &str) -> Response {
    let mut response = client.request(Method::GET, path).send().await.unwrap();
    let (status, mut text) = (response.status(), String::new());
    loop {
        match response.chunk().await {
            Ok(Some(part)) => text += std::str::from_utf8(&part).unwrap(),
            _ if text.contains("urn:offbd:problem:corrupt") => return Response::Damaged,
            _ if status == 200 => return Response::Damaged,
            _ => return Response::Other(format!("{status}: {text}")),
        }
        if text.matches("event: fault").count() == N_EVENTS && text.ends_with("\n\n") {
            return Response::Body(text);
        }
    }
}

/// Events of the filled store.
const N_EVENTS: usize = 4;

impl Stopped {
    async fn new() -> Self {
        let mut fixture = ServiceFixture::start().await;
        let paths = fill(&fixture.client).await;
        fixture.restart().await;
        let right = responses(&fixture.client, &paths).await;
        fixture.restart().await;
        let again = responses(&fixture.client, &paths).await;
        for ((path, first), second) in paths.iter().zip(&right).zip(&again) {
            assert!(matches!(first, Response::Body(_)), "{path}: {first:?}");
            assert_eq!(first, second, "{path}");
        }
        fixture.server.take().unwrap().shutdown().await.unwrap();
        let file = fixture.data.path().join("offbd.sqlite");
        assert!(!file.with_extension("sqlite-wal").exists(), "all is in the file");
        let whole = std::fs::read(&file).unwrap();
        Self { fixture, file, whole, paths, right }
    }

    /// Writes the file with one wrong bit, or without any.
    fn write(&self, bit: Option<usize>) {
        let mut bytes = self.whole.clone();
        if let Some(bit) = bit {
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        // Another file, because SQLite shares what it knows of the log among the connections of
        // a process to one file, and some may still be closing.
        for end in ["sqlite", "sqlite-wal", "sqlite-shm"] {
            let _ = std::fs::remove_file(self.file.with_extension(end));
        }
        std::fs::write(&self.file, bytes).unwrap();
    }

    /// Returns whether a check names the damage.
    async fn is_found(&self) -> bool {
        match store::check(&Location::File(self.file.clone())).await {
            Ok(report) => !report.findings.is_empty(),
            Err(error) => is_named(&error.to_string()),
        }
    }

    async fn outcome(&self) -> (Outcome, String) {
        let server = match server::start(config(self.fixture.data.path())).await {
            Ok(server) => server,
            Err(error) => {
                let error = format!("{error:#}");
                let outcome = if is_named(&error) { Outcome::Refused } else { Outcome::Wrong };
                return (outcome, error);
            }
        };
        let client = Client::new(server.address.to_string());
        let found = responses(&client, &self.paths).await;
        // What is still running would change the next file.
        if let Err(error) = server.shutdown().await {
            return (Outcome::Wrong, format!("{error:#}"));
        }
        let mut outcome = (Outcome::NotNeeded, String::new());
        for ((path, found), right) in self.paths.iter().zip(found).zip(&self.right) {
            if found == Response::Damaged && outcome.0 == Outcome::NotNeeded {
                outcome.0 = Outcome::Named;
            } else if found != Response::Damaged
                && found != *right
                && !lacks_monitors(&found, right)
            {
                outcome = (Outcome::Wrong, format!("{path}: {}", difference(&found, right)));
            }
        }
        outcome
    }

    /// Numbers of the pages that hold nothing: the leaves of the list of free pages
    /// (<https://www.sqlite.org/fileformat2.html#the_freelist>).
    fn free_pages(&self) -> HashSet<usize> {
        let number = |at: usize| {
            let bytes = self.whole[at..at + 4].try_into().unwrap();
            usize::try_from(u32::from_be_bytes(bytes)).unwrap()
        };
        let (mut free, mut trunk) = (HashSet::new(), number(32));
        while trunk != 0 {
            let at = (trunk - 1) * PAGE_SIZE;
            free.extend((0..number(at + 4)).map(|i| number(at + 8 + 4 * i)));
            trunk = number(at);
        }
        free
    }
}

/// Whether two responses differ only in that the first has no monitors: they are not known while the
/// stored state of the engine is damaged, and the records are right without it.
fn lacks_monitors(found: &Response, right: &Response) -> bool {
    let (Response::Body(found), Response::Body(right)) = (found, right) else { return false };
    let parsed = [found, right].map(|text| serde_json::from_str::<Value>(text).ok());
    let [Some(found), Some(mut right)] = parsed else { return false };
    match right.get_mut("items").and_then(Value::as_array_mut) {
        Some(faults) => faults.iter_mut().for_each(|fault| fault["monitor"] = Value::Null),
        None => right["monitor"] = Value::Null,
    }
    found == right
}

/// Describes where two responses begin to differ.
fn difference(found: &Response, right: &Response) -> String {
    let (found, right) = (format!("{found:?}"), format!("{right:?}"));
    let same = found.bytes().zip(right.bytes()).take_while(|(a, b)| a == b).count();
    let part =
        |text: &str| text.chars().skip(same.saturating_sub(60)).take(160).collect::<String>();
    format!("{} instead of {}", part(&found), part(&right))
}

const PAGE_SIZE: usize = 4096;

/// Returns whether an error says that the store is damaged.
fn is_named(error: &str) -> bool {
    ["damaged", "corrupt", "file is not a database"].iter().any(|word| error.contains(word))
}

/// A sequence of pseudo-random numbers (SplitMix64).
fn next(state: &mut u64) -> usize {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    usize::try_from(z ^ (z >> 31)).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_wrong_bit_is_never_served() {
    if on_postgres() {
        return;
    }
    let n = std::env::var("FLIPS").map_or(FLIPS, |n| n.parse().unwrap());
    let mut random = std::env::var("SEED").map_or(1, |seed| seed.parse().unwrap());
    let stopped = Stopped::new().await;
    let free = stopped.free_pages();
    let (mut counts, mut wrong, mut not_found) = ([0usize; 8], Vec::new(), Vec::new());
    for i in 0..n {
        // The header of the file, which decides how all else is read, comes more often.
        let n_bits = if i % 20 == 0 { 100 * 8 } else { stopped.whole.len() * 8 };
        let bit = next(&mut random) % n_bits;
        stopped.write(Some(bit));
        let is_found = stopped.is_found().await;
        stopped.write(Some(bit));
        let (outcome, reason) = stopped.outcome().await;
        counts[outcome as usize * 2 + usize::from(is_found)] += 1;
        if outcome == Outcome::Wrong {
            wrong.push(format!("bit {bit}: {}", reason.chars().take(400).collect::<String>()));
        }
        if !is_found && !free.contains(&(bit / 8 / PAGE_SIZE + 1)) {
            not_found.push(bit);
        }
    }
    println!("{n} wrong bits in {} pages, {} free", stopped.whole.len() / PAGE_SIZE, free.len());
    for (i, name) in ["refused", "named", "not needed", "wrong"].iter().enumerate() {
        let [not_found, found] = [counts[2 * i], counts[2 * i + 1]];
        println!("{name:>10}: {found} found by a check, {not_found} not");
    }
    wrong.iter().take(20).for_each(|wrong| println!("{wrong}"));
    assert!(wrong.is_empty(), "{} wrong answers", wrong.len());
    assert!(not_found.is_empty(), "a check does not find the bits {not_found:?}");
}
