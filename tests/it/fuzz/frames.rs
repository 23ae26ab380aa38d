//! Fuzzing of the WebSocket: mutated frames, sent to a real service.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::timeout;

use super::mutation::InputPool;
use super::{corpus, env_number};
use crate::support::web_socket::{frame, open_websocket};
use crate::support::{DEADLINE, ServiceFixture, batch, rig};

/// Number of connections, unless FUZZ is set.
const CONNECTIONS: usize = 60;

/// A close frame.
const CLOSE: [u8; 6] = [0x88, 0x80, 0, 0, 0, 0];

#[tokio::test(flavor = "multi_thread")]
async fn the_service_survives_mutated_websocket_frames() {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let mut inputs: Vec<Vec<u8>> = corpus("json").iter().map(|text| frame(text)).collect();
    inputs.extend(corpus("frames"));
    let mut pool = InputPool::new(inputs, env_number("SEED", 1) as u64);
    for _ in 0..env_number("FUZZ", CONNECTIONS) {
        let input = pool.next();
        let mut socket = open_websocket(&fixture.client.address).await;
        let sent = async {
            socket.write_all(&input).await?;
            socket.write_all(&CLOSE).await?;
            // Ends a wait for the rest of an incomplete frame.
            socket.shutdown().await
        };
        // The service may have closed the connection already.
        let _ = sent.await;
        let mut answer = Vec::new();
        // The service closes the connection, with or without an error.
        let closed = timeout(DEADLINE, socket.read_to_end(&mut answer)).await;
        let _ = closed.expect("the service closes the connection");
        pool.record(&input, answer.iter().take(24).map(|b| char::from(*b)).collect());
    }
    // The service still works.
    let samples = rig(50, usize::MAX);
    let ack = fixture.client.post("assets/a/telemetry", &batch(Some("after"), &samples)).await;
    assert_eq!(ack.expect(200)["accepted"], 50);
    fixture.client.get("/readyz").await.expect(200);
}
