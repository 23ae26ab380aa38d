//! What a cluster has stored in the end, as its nodes and its database tell.

use std::collections::BTreeMap;

use futures_util::{StreamExt, stream};
use offbd_core::vocabulary::Sample;
use reqwest::Method;
use serde_json::Value;
use sqlx::AnyConnection;

use super::CommitLog;
use crate::support::cluster::{Cluster, call};
use crate::support::history::{Recorder, SeenEvent};
use crate::support::{Client, connection, eventually, read_csv};

/// Sessions that are read at the same time.
const AT_A_TIME: usize = 4;

/// Everything that is stored, once all sessions have ended.
#[derive(Clone, Debug, Default)]
pub struct Stored {
    pub sessions: Vec<StoredSession>,
    /// Those of the faults, in the order of their numbers.
    pub events: Vec<SeenEvent>,
    /// In the order of their numbers.
    pub actions: Vec<StoredAction>,
    /// The status of each fault of an asset, and whether it is acknowledged.
    pub faults: BTreeMap<(String, String), (String, bool)>,
    pub commits: CommitLog,
}

/// A session that has ended.
#[derive(Clone, Debug)]
pub struct StoredSession {
    pub id: String,
    pub asset: String,
    pub name: String,
    /// Exported by a node.
    pub recording: Vec<Sample>,
    pub hash: String,
}

/// What a person did to a fault.
#[derive(Clone, Debug)]
pub struct StoredAction {
    pub asset: String,
    /// The session that was open.
    pub session: Option<String>,
    /// Whether the asset's session began later: it may be sent before the first batch arrives.
    pub is_early: bool,
    /// Number of the session's samples before it.
    pub after_index: usize,
    pub kind: String,
    pub code: String,
    pub actor: String,
}

impl Stored {
    /// Ends all sessions and reads everything. Waits until the subscriber has the last event.
    pub async fn read(cluster: &Cluster, recorder: &Recorder) -> Self {
        let (clients, mut store) = (cluster.clients(), connection(&cluster.url()).await);
        let rows: Vec<(String, String, String)> =
            sqlx::query_as("SELECT id, asset, name FROM session ORDER BY id")
                .fetch_all(&mut store)
                .await
                .unwrap();
        let sessions = rows.into_iter().enumerate().map(|(i, (id, asset, name))| {
            let clients = &clients;
            async move {
                let client = &clients[i % clients.len()];
                let (recording, hash) = end(client, &id).await;
                StoredSession { id, asset, name, recording, hash }
            }
        });
        let sessions = stream::iter(sessions).buffered(AT_A_TIME).collect().await;
        let events = events(&mut store).await;
        let last = events.last().map(|event| event.id);
        let has_all = || recorder.lock().events.last().map(|event| event.id) >= last;
        eventually(|| async { has_all().then_some(()) }).await;
        let (actions, faults) = (actions(&mut store).await, faults(&mut store).await);
        Self { sessions, events, actions, faults, commits: CommitLog::read(&cluster.url()).await }
    }
}

/// Ends a session, if it has not ended yet. Returns its recording and the hash of its verdict.
async fn end(client: &Client, id: &str) -> (Vec<Sample>, String) {
    let path = format!("sessions/{id}");
    // Once more if that was answered and is not so: then something else is violated too.
    let session = eventually(|| async {
        call(client, Method::POST, &format!("{path}/end"), &Value::Null).await;
        let (_, session) = call(client, Method::GET, &path, &Value::Null).await;
        (session["state"] == "ended").then_some(session)
    })
    .await;
    let csv = eventually(|| async {
        let answer = client.get(&format!("{path}/telemetry")).await;
        (answer.status != 503).then_some(answer)
    })
    .await;
    assert_eq!(csv.status, 200, "{}", csv.text);
    let hash = session["verdict"]["verdict_hash"].as_str().unwrap();
    (read_csv(&csv.text), hash.to_owned())
}

async fn events(store: &mut AnyConnection) -> Vec<SeenEvent> {
    let query = "SELECT id, asset, session, code, status FROM transition
        UNION ALL SELECT id, asset, '', code, 'cleared' FROM action WHERE event IS NOT NULL
        ORDER BY id";
    let rows: Vec<(i64, String, String, String, String)> =
        sqlx::query_as(query).fetch_all(store).await.unwrap();
    let event = |(id, asset, session, code, status): (_, _, String, _, _)| {
        let session_id = (!session.is_empty()).then_some(session);
        SeenEvent { id, asset, session_id, code, status }
    };
    rows.into_iter().map(event).collect()
}

type ActionColumns = (String, String, i64, String, String, String, i64);

async fn actions(store: &mut AnyConnection) -> Vec<StoredAction> {
    let query = "SELECT asset, COALESCE(session, ''), after_index, kind, code, actor,
        CAST(CASE WHEN session IS NULL AND at < (SELECT MIN(opened_at) FROM session s
            WHERE s.asset = action.asset) THEN 1 ELSE 0 END AS BIGINT) FROM action ORDER BY id";
    let rows: Vec<ActionColumns> = sqlx::query_as(query).fetch_all(store).await.unwrap();
    let action = |columns: ActionColumns| {
        let (asset, session, after_index, kind, code, actor, is_early) = columns;
        let session = (!session.is_empty()).then_some(session);
        let (is_early, after_index) = (is_early != 0, usize::try_from(after_index).unwrap());
        StoredAction { asset, session, is_early, after_index, kind, code, actor }
    };
    rows.into_iter().map(action).collect()
}

async fn faults(store: &mut AnyConnection) -> BTreeMap<(String, String), (String, bool)> {
    let query = "SELECT asset, code, status, acknowledged FROM fault";
    let rows: Vec<(String, String, String, i64)> =
        sqlx::query_as(query).fetch_all(store).await.unwrap();
    let fault = |(asset, code, status, acknowledged)| ((asset, code), (status, acknowledged != 0));
    rows.into_iter().map(fault).collect()
}
