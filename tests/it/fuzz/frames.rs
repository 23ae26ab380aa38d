//! Frames of a WebSocket that are nearly right, sent to a real server.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use super::change::Pool;
use super::{corpus, number};
use crate::support::{Bench, DEADLINE, batch, rig};

/// Connections that are tried; FUZZ says otherwise.
const CONNECTIONS: usize = 60;

/// A connection that has become a WebSocket.
async fn upgraded(address: &str) -> TcpStream {
    let mut socket = TcpStream::connect(address).await.unwrap();
    let request = format!(
        "GET /api/v1/assets/a/stream HTTP/1.1\r\nhost: {address}\r\nconnection: upgrade\r\n\
         upgrade: websocket\r\nsec-websocket-version: 13\r\n\
         sec-websocket-key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    );
    socket.write_all(request.as_bytes()).await.unwrap();
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        head.push(socket.read_u8().await.unwrap());
    }
    assert!(head.starts_with(b"HTTP/1.1 101 "), "{}", String::from_utf8_lossy(&head));
    socket
}

/// The frame of a text, masked with nothing.
fn frame(text: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x81];
    match u16::try_from(text.len()) {
        Ok(n) if n < 126 => frame.push(0x80 | u8::try_from(n).unwrap()),
        Ok(n) => {
            frame.push(0x80 | 126);
            frame.extend(n.to_be_bytes());
        }
        Err(_) => {
            frame.push(0x80 | 127);
            frame.extend((text.len() as u64).to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(text);
    frame
}

/// A frame that closes.
const CLOSE: [u8; 6] = [0x88, 0x80, 0, 0, 0, 0];

#[tokio::test(flavor = "multi_thread")]
async fn the_websocket_bears_frames_that_are_nearly_right() {
    let bench = Bench::start().await;
    bench.client.asset("a").await;
    let mut inputs: Vec<Vec<u8>> = corpus("json").iter().map(|text| frame(text)).collect();
    inputs.extend(corpus("frames"));
    let mut pool = Pool::new(inputs, number("SEED", 1) as u64);
    for _ in 0..number("FUZZ", CONNECTIONS) {
        let input = pool.next();
        let mut socket = upgraded(&bench.client.address).await;
        let sent = async {
            socket.write_all(&input).await?;
            socket.write_all(&CLOSE).await?;
            // What waits for the rest of a frame learns that there is none.
            socket.shutdown().await
        };
        // The service may have closed already.
        let _ = sent.await;
        let mut answer = Vec::new();
        // It closes, in whatever way.
        let _ = timeout(DEADLINE, socket.read_to_end(&mut answer)).await.expect("it closes");
        pool.learn(&input, answer.iter().take(24).map(|b| char::from(*b)).collect());
    }
    // It goes on as if nothing had been.
    let samples = rig(50, usize::MAX);
    let ack = bench.client.post("assets/a/telemetry", &batch(Some("after"), &samples)).await;
    assert_eq!(ack.expect(200)["accepted"], 50);
    bench.client.get("/readyz").await.expect(200);
}
