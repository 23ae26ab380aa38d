//! Streams a recorded session to a running service over a WebSocket and prints the faults
//! that it reports:
//!
//! ```text
//! offbd serve &
//! curl -X PUT http://127.0.0.1:8087/api/v1/assets/my-rig -d '{"name":"my-rig"}'
//! cargo run --example websocket_client -- my-rig session.csv
//! ```

use std::fs::File;
use std::path::Path;

use anyhow::{Context, bail};
use futures_util::{SinkExt, StreamExt};
use offbd::wire::table::{TableOptions, TableReader};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;

/// Rows per batch: one second at 100 Hz.
const ROWS: usize = 100;

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [asset, file, rest @ ..] = args.as_slice() else {
        bail!("usage: websocket_client ASSET SESSION.csv [HOST:PORT]")
    };
    let host = rest.first().map_or("127.0.0.1:8087", String::as_str);
    let url = format!("ws://{host}/api/v1/assets/{asset}/stream");
    let (socket, _) = tokio_tungstenite::connect_async(&url).await.context(url)?;
    let (mut up, mut down) = socket.split();
    let session = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
    let rows: Vec<Sample> = TableReader::recording(File::open(file)?, &TableOptions::default())?
        .filter_map(Result::ok)
        .collect();
    let mut n_pending = rows.chunks(ROWS).len();
    // Sending and receiving run concurrently: neither waits for the other.
    let send = async {
        for (n, batch) in rows.chunks(ROWS).enumerate() {
            let samples: Vec<Value> =
                batch.iter().enumerate().map(|(i, s)| row(n * ROWS + i + 1, s)).collect();
            let batch = json!({ "id": n.to_string(), "session": session, "samples": samples });
            up.send(Message::text(batch.to_string())).await?;
        }
        anyhow::Ok(())
    };
    let receive = async {
        while n_pending > 0 {
            let Message::Text(text) =
                down.next().await.context("the service closed the connection")??
            else {
                continue;
            };
            let frame: Value = serde_json::from_str(&text)?;
            match frame["type"].as_str() {
                Some("ack") => n_pending -= 1,
                Some("fault") => println!("{}", frame["summary"].as_str().unwrap_or_default()),
                Some("error") => bail!("{}", frame["problem"]),
                _ => {}
            }
        }
        anyhow::Ok(())
    };
    tokio::try_join!(send, receive)?;
    println!("{} rows acknowledged", rows.len());
    Ok(())
}

/// Returns a row with its number, by which the service recognises a duplicate.
fn row(seq: usize, sample: &Sample) -> Value {
    let Sample { t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m, .. } = sample;
    json!({ "seq": seq, "t_s": t_s, "cmd_qx_rad": cmd_qx_rad, "cmd_qy_rad": cmd_qy_rad,
        "x_m": x_m, "y_m": y_m })
}
