//! Nodes of a cluster as separate processes, on one PostgreSQL database.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use reqwest::Method;
use serde_json::Value;

use super::postgres::Postgres;
use super::process::{self, Process, Refusal, ended};
use super::{Client, eventually};

/// Nodes, unless a test wants another number.
pub const N_NODES: usize = 3;
pub const N_PARTITIONS: u64 = 16;

/// Lines of the log of each node that are printed when a test fails.
const N_LINES: usize = 100;

/// A cluster of processes, and the database server that they share.
pub struct Cluster {
    postgres: Postgres,
    pub data: tempfile::TempDir,
    pub nodes: Vec<Option<Process>>,
    kinds: Vec<NodeKind>,
}

/// What distinguishes a node from the others, also when it starts again.
#[derive(Clone)]
pub struct NodeKind {
    /// The program that it runs.
    pub program: PathBuf,
    /// Its own environment variables.
    pub environment: Vec<(&'static str, String)>,
    /// The token of its client, if it requires one.
    pub token: Option<String>,
}

impl Default for NodeKind {
    fn default() -> Self {
        Self { program: process::program(), environment: Vec::new(), token: None }
    }
}

impl Cluster {
    pub async fn start() -> Self {
        Self::start_with(|_| None).await
    }

    /// Starts the nodes, the second one with its own way to the database, if there is one.
    pub async fn start_with(way: impl FnOnce(&Postgres) -> Option<String>) -> Self {
        let postgres = Postgres::new();
        let mut kinds = vec![NodeKind::default(); N_NODES];
        kinds[1].environment.extend(way(&postgres).map(|url| ("OFFBD_DATABASE", url)));
        Self::of(postgres, kinds).await
    }

    /// Starts a node of each of `kinds`, one after the other, and waits until each has its share.
    pub async fn of(postgres: Postgres, kinds: Vec<NodeKind>) -> Self {
        let n = kinds.len();
        let this = Self::begin(postgres, kinds).await;
        this.settled(n).await;
        this
    }

    /// As [`Self::of`], without waiting until the partitions are shared.
    pub async fn begin(postgres: Postgres, kinds: Vec<NodeKind>) -> Self {
        let (data, n) = (tempfile::tempdir().unwrap(), kinds.len());
        let mut this = Self { postgres, data, nodes: Vec::new(), kinds };
        for i in 0..n {
            this.nodes.push(None);
            this.restart(i);
        }
        this.complete(n).await;
        this
    }

    pub fn url(&self) -> String {
        self.postgres.database("cluster")
    }

    /// Starts the node with this number, with further environment variables.
    pub fn try_node(&self, i: usize, settings: &[(&str, &str)]) -> Result<Process, Refusal> {
        let (name, url, partitions) = (format!("node-{i}"), self.url(), N_PARTITIONS.to_string());
        let mut environment = BTreeMap::from([
            ("OFFBD_DATABASE", url.as_str()),
            ("OFFBD_CLUSTER__NAME", &name),
            ("OFFBD_CLUSTER__LISTEN", "127.0.0.1:0"),
            ("OFFBD_CLUSTER__PARTITIONS", &partitions),
        ]);
        let kind = self.kinds.get(i).cloned().unwrap_or_default();
        environment.extend(kind.environment.iter().map(|(key, value)| (*key, value.as_str())));
        environment.extend(settings.iter().copied());
        let environment: Vec<_> =
            environment.iter().map(|(key, value)| (*key, Path::new(value))).collect();
        let mut node = Process::try_start_program(&kind.program, self.data.path(), &environment)?;
        node.client.token = kind.token;
        Ok(node)
    }

    /// Starts a node that does not run.
    pub fn restart(&mut self, i: usize) {
        let node = self.try_node(i, &[]).unwrap_or_else(|Refusal { log, .. }| panic!("{log}"));
        self.nodes[i] = Some(node);
    }

    /// Kills a node.
    pub fn kill(&mut self, i: usize) {
        self.nodes[i] = None;
    }

    /// Stops a node, which hands its partitions over.
    pub async fn stop(&mut self, i: usize) {
        let mut stopped = self.nodes[i].take().unwrap();
        stopped.terminate();
        assert!(ended(&mut stopped.child).await.success(), "{}", stopped.log());
    }

    pub fn client(&self, i: usize) -> Client {
        self.nodes[i].as_ref().unwrap().client.clone()
    }

    pub fn clients(&self) -> Vec<Client> {
        self.nodes.iter().flatten().map(|node| node.client.clone()).collect()
    }

    /// Waits until `n` nodes know each other and share all partitions.
    pub async fn settled(&self, n: usize) {
        self.shared_by(n, N_PARTITIONS / n as u64).await;
    }

    /// Waits until `n` nodes know each other and each partition has an owner.
    pub async fn complete(&self, n: usize) {
        self.shared_by(n, 0).await;
    }

    async fn shared_by(&self, n: usize, least: u64) {
        for client in self.clients() {
            eventually(|| async {
                let cluster = try_get(&client, "cluster").await?;
                let nodes = cluster["nodes"].as_array()?;
                let is_shared = nodes.iter().all(|node| node["partitions"].as_u64() >= Some(least));
                (nodes.len() == n && is_shared && cluster["unowned"] == 0).then_some(())
            })
            .await;
        }
    }

    /// Returns those of the rigs that a node owns; there are some.
    pub async fn owned_by(&self, i: usize, names: &[String]) -> Vec<String> {
        let owned = self.rigs_of(i, names).await;
        assert!(!owned.is_empty(), "node-{i} owns none of the rigs");
        owned
    }

    /// Returns those of the rigs that a node owns, as it says itself, perhaps none.
    pub async fn rigs_of(&self, i: usize, names: &[String]) -> Vec<String> {
        let (client, node) = (self.client(i), format!("node-{i}"));
        let mut owned = Vec::new();
        for name in names {
            let path = format!("cluster?asset={name}");
            let owner = eventually(async || {
                let place = try_get(&client, &path).await?;
                place["asset"]["owner"].as_str().map(str::to_owned)
            });
            if owner.await == node {
                owned.push(name.clone());
            }
        }
        owned
    }

    /// Stops the database server with a signal; see [`Postgres::stop`].
    pub fn stop_database(&mut self, signal: &str) {
        self.postgres.stop(signal);
    }

    pub fn start_database(&mut self) {
        self.postgres.start();
    }

    pub fn signal(&self, i: usize, signal: &str) {
        let pid = self.nodes[i].as_ref().unwrap().child.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        // On a busy machine a process goes on until one of its threads takes the signal.
        while signal == "-STOP" && !is_paused(&pid) {
            std::thread::sleep(super::POLL_PAUSE);
        }
    }

    /// Waits until the other nodes own everything.
    pub async fn taken_over_from(&self, i: usize) {
        let name = format!("node-{i}");
        let other = self.client((i + 1) % self.nodes.len());
        eventually(|| async {
            let cluster = try_get(&other, "cluster").await?;
            let nodes = cluster["nodes"].as_array()?;
            let is_gone = nodes.iter().all(|node| node["name"] != name.as_str());
            (is_gone && cluster["unowned"] == 0).then_some(())
        })
        .await;
    }
}

/// Whether all threads of a process are stopped by a signal.
fn is_paused(pid: &str) -> bool {
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).unwrap();
    threads.into_iter().all(|thread| {
        // One that has ended runs no more.
        let Ok(stat) = std::fs::read_to_string(thread.unwrap().path().join("stat")) else {
            return true;
        };
        // The state comes after the name, which is in parentheses.
        stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('T'))
    })
}

/// What the nodes have logged last, if a test fails.
impl Drop for Cluster {
    fn drop(&mut self) {
        for (i, node) in self.nodes.iter().enumerate().filter(|_| std::thread::panicking()) {
            let log = node.as_ref().map(Process::log).unwrap_or_default();
            let last = log.lines().rev().take(N_LINES).collect::<Vec<_>>();
            eprintln!("node-{i}:");
            last.iter().rev().for_each(|line| eprintln!("{line}"));
        }
    }
}

pub async fn try_get(client: &Client, path: &str) -> Option<Value> {
    let answer = client.request(Method::GET, path).send().await.ok()?;
    (answer.status() == 200).then_some(answer)?.json().await.ok()
}

/// Sends a request again until it is not refused because an asset moves.
pub async fn call(client: &Client, method: Method, path: &str, body: &Value) -> (u16, Value) {
    eventually(|| async {
        let answer = client.request(method.clone(), path).json(body).send().await.ok()?;
        let status = answer.status().as_u16();
        if status == 503 {
            assert_eq!(answer.headers()["retry-after"], "1");
            return None;
        }
        Some((status, answer.json().await.unwrap_or_default()))
    })
    .await
}
