//! WebSockets of a cluster: they end when the asset has moved, and go on at its new owner.

use futures_util::{SinkExt, StreamExt};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

use super::{judged, register_rigs};
use crate::support::cluster::{Cluster, N_NODES, NodeKind};
use crate::support::postgres::Postgres;
use crate::support::{Client, DEADLINE, batch, eventually, rig};

pub(super) type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Opens a stream, once the asset has an owner.
pub(super) async fn stream(client: &Client, asset: &str) -> Socket {
    let url = format!("ws://{}/api/v1/assets/{asset}/stream", client.address);
    eventually(async || connect_async(&url).await.ok()).await.0
}

/// Sends a batch and waits for its acknowledgement. Returns `None` if the stream ends before.
pub(super) async fn is_acknowledged(socket: &mut Socket, samples: &[Sample]) -> Option<()> {
    let text = batch(Some("s"), samples).to_string();
    socket.send(Message::text(text)).await.ok()?;
    while let Some(Ok(message)) = socket.next().await {
        let Message::Text(text) = message else { continue };
        let frame: Value = serde_json::from_str(&text).unwrap();
        if frame["type"] == "ack" {
            return Some(());
        }
    }
    None
}

/// Reads to the end of a stream. Returns the code with which it is closed, if there is one.
pub(super) async fn closed(socket: &mut Socket) -> Option<CloseCode> {
    let mut code = None;
    let end = async {
        while let Some(Ok(message)) = socket.next().await {
            if let Message::Close(frame) = message {
                code = frame.map(|frame| frame.code);
            }
        }
    };
    timeout(DEADLINE, end).await.expect("the stream ends");
    code
}

/// Sends the rest over a new stream, and compares what is stored.
async fn go_on(client: &Client, asset: &str, samples: &[Sample], n: usize) {
    is_acknowledged(&mut stream(client, asset).await, &samples[n..]).await.expect("it goes on");
    assert_eq!(client.recording(asset, "s").await, samples);
    let session = client.end(asset, "s").await;
    assert_eq!(session["verdict"]["verdict_hash"], judged(asset, samples).0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stream_through_another_node_ends_when_its_owner_is_paused() {
    let (cluster, samples) = (Cluster::start().await, rig(900, 300));
    let names = register_rigs(&cluster).await;
    let asset = &cluster.owned_by(1, &names).await[0];
    let client = cluster.client(0);
    let mut socket = stream(&client, asset).await;
    is_acknowledged(&mut socket, &samples[..300]).await.expect("it is forwarded");
    cluster.signal(1, "-STOP");
    closed(&mut socket).await;
    go_on(&client, asset, &samples, 300).await;
    cluster.signal(1, "-CONT");
    cluster.settled(N_NODES).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stream_is_closed_when_its_asset_is_handed_over() {
    let (mut cluster, samples) =
        (Cluster::of(Postgres::new(), vec![NodeKind::default(); 2]).await, rig(900, 300));
    let names = register_rigs(&cluster).await;
    let (client, mut streams) = (cluster.client(0), Vec::new());
    for name in cluster.owned_by(0, &names).await {
        let mut socket = stream(&client, &name).await;
        is_acknowledged(&mut socket, &samples[..300]).await.expect("it is served here");
        streams.push((name, socket));
    }
    // A third node gets its share.
    cluster.nodes.push(None);
    cluster.restart(2);
    cluster.settled(3).await;
    let staying = cluster.rigs_of(0, &names).await;
    let mut n_moved = 0;
    for (name, mut socket) in streams {
        if staying.contains(&name) {
            is_acknowledged(&mut socket, &samples[300..]).await.expect("it stays open");
            continue;
        }
        n_moved += 1;
        assert_eq!(closed(&mut socket).await, Some(CloseCode::Restart), "{name}");
        go_on(&client, &name, &samples, 300).await;
    }
    assert!(n_moved > 0, "none of the rigs has moved: {}", json!(names));
}
