//! A way to a PostgreSQL server that can be held: then nothing goes through in either
//! direction, and nothing is closed, as on a network that is cut.

use std::path::Path;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::watch;

/// Name of the server's socket in its directory.
const SOCKET: &str = ".s.PGSQL.5432";

pub struct HeldSocket {
    pub directory: tempfile::TempDir,
    held: watch::Sender<bool>,
}

impl HeldSocket {
    /// Starts to pass connections on to the server with its socket in `server`.
    pub fn new(server: &Path) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(directory.path().join(SOCKET)).unwrap();
        let (held, is_held) = watch::channel(false);
        tokio::spawn(accept(listener, server.join(SOCKET), is_held));
        Self { directory, held }
    }

    pub fn hold(&self, is_held: bool) {
        self.held.send_replace(is_held);
    }
}

async fn accept(listener: UnixListener, server: std::path::PathBuf, held: watch::Receiver<bool>) {
    while let Ok((client, _)) = listener.accept().await {
        let (server, held) = (server.clone(), held.clone());
        tokio::spawn(async move {
            let Ok(server) = UnixStream::connect(server).await else { return };
            let (from_client, to_client) = client.into_split();
            let (from_server, to_server) = server.into_split();
            tokio::join!(
                copy(from_client, to_server, held.clone()),
                copy(from_server, to_client, held),
            );
        });
    }
}

/// Copies until either side ends. The end of `from` is passed on as well.
async fn copy(
    mut from: impl AsyncRead + Unpin,
    mut to: impl AsyncWrite + Unpin,
    mut held: watch::Receiver<bool>,
) {
    let mut bytes = [0; 4096];
    while let Ok(n) = from.read(&mut bytes).await {
        if held.wait_for(|is_held| !is_held).await.is_err() || n == 0 {
            break;
        }
        if to.write_all(&bytes[..n]).await.is_err() {
            break;
        }
    }
    let _ = to.shutdown().await;
}
