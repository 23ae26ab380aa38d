//! Whether other nodes reach this one where it says: with the address of another one it would own
//! rigs to which no request ever came.

use std::time::Duration;

use anyhow::{Result, bail};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};

/// Longest time until a connection to the address of a node arrives at it. Chosen: the name of a
/// container that has just started may not be known at once.
const ARRIVAL_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest time for one attempt.
const ATTEMPT_TIMEOUT: Duration = Duration::from_secs(2);

/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(200);

/// Fails unless a connection to `address` arrives at `listener`, on which nothing else is received
/// yet.
pub(super) async fn check(listener: &TcpListener, address: &str) -> Result<()> {
    let word = uuid::Uuid::now_v7().to_string();
    let mut reason = "nothing arrives here".to_owned();
    let connect = async {
        loop {
            match timeout(ATTEMPT_TIMEOUT, say(address, &word)).await {
                Ok(Ok(())) => {}
                Ok(Err(error)) => reason = error.to_string(),
                Err(_) => reason = "no connection in time".to_owned(),
            }
            sleep(PAUSE).await;
        }
    };
    let arrived = tokio::select! {
        arrived = timeout(ARRIVAL_TIMEOUT, arrival(listener, &word)) => arrived.is_ok(),
        () = connect => false,
    };
    if !arrived {
        bail!("`cluster.advertise`: {address} does not lead to this node: {reason}");
    }
    Ok(())
}

/// Sends a request with `word` to `address`, and waits until the other side ends it.
async fn say(address: &str, word: &str) -> std::io::Result<()> {
    let mut connection = TcpStream::connect(address).await?;
    let request = format!("GET /{word} HTTP/1.0\r\nhost: {address}\r\n\r\n");
    connection.write_all(request.as_bytes()).await?;
    connection.read_to_end(&mut Vec::new()).await?;
    Ok(())
}

/// Waits for a connection that begins with a request with `word`.
async fn arrival(listener: &TcpListener, word: &str) {
    let expected = format!("GET /{word}");
    loop {
        let Ok((mut connection, _)) = listener.accept().await else { continue };
        let mut begin = vec![0; expected.len()];
        let read = timeout(ATTEMPT_TIMEOUT, connection.read_exact(&mut begin)).await;
        if matches!(read, Ok(Ok(_))) && begin == expected.as_bytes() {
            return;
        }
    }
}
