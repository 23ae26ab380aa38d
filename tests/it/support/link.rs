//! A network link to a service that loses, delays or cuts what goes over it, each direction by
//! itself.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};
use tokio::sync::watch;

/// Name of a PostgreSQL server's socket in its directory.
const SOCKET: &str = ".s.PGSQL.5432";

/// What becomes of the bytes of one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkMode {
    Pass,
    /// They are lost, and so is the end of the connection. A connection that has lost some
    /// stays silent for good, as one that a firewall has forgotten; later ones pass.
    Drop,
    /// They arrive so much later.
    Delay(Duration),
    /// A connection ends after so many.
    CutAfter(usize),
}

/// The modes of both directions.
#[derive(Clone)]
struct LinkModes {
    up: watch::Sender<LinkMode>,
    down: watch::Sender<LinkMode>,
    /// How often a connection has begun to lose what goes over it.
    n_lost: watch::Sender<usize>,
}

pub struct Link {
    modes: LinkModes,
    n_connections: Arc<AtomicUsize>,
}

impl Link {
    /// Makes a link to a port of this machine; returns its own port.
    pub async fn to_port(port: u16) -> (Self, u16) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let (link, own) = (Self::new(), listener.local_addr().unwrap().port());
        let (modes, n_connections) = (link.modes.clone(), link.n_connections.clone());
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                n_connections.fetch_add(1, Ordering::Relaxed);
                let connect = TcpStream::connect(("127.0.0.1", port));
                tokio::spawn(modes.clone().carry(connect, client));
            }
        });
        (link, own)
    }

    /// Makes a link to the PostgreSQL server with its socket in `server`; returns the directory
    /// of its own socket.
    pub fn to_database(server: &Path) -> (Self, tempfile::TempDir) {
        let directory = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(directory.path().join(SOCKET)).unwrap();
        let (link, server) = (Self::new(), server.join(SOCKET));
        let modes = link.modes.clone();
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let connect = UnixStream::connect(server.clone());
                tokio::spawn(modes.clone().carry(connect, client));
            }
        });
        (link, directory)
    }

    fn new() -> Self {
        let mode = || watch::channel(LinkMode::Pass).0;
        let modes = LinkModes { up: mode(), down: mode(), n_lost: watch::channel(0).0 };
        Self { modes, n_connections: Arc::default() }
    }

    /// Returns how many connections to a port have been made.
    pub fn n_connections(&self) -> usize {
        self.n_connections.load(Ordering::Relaxed)
    }

    /// Sets the modes of the directions to the service and from it.
    pub fn set(&self, up: LinkMode, down: LinkMode) {
        self.modes.up.send_replace(up);
        self.modes.down.send_replace(down);
        self.modes.n_lost.send_replace(0);
    }

    /// Waits until so many connections have lost something since the modes were set.
    pub async fn has_lost(&self, n: usize) {
        let mut n_lost = self.modes.n_lost.subscribe();
        let lost = tokio::time::timeout(super::DEADLINE, n_lost.wait_for(|lost| *lost >= n));
        drop(lost.await.expect("something lost in time").unwrap());
    }
}

impl LinkModes {
    /// Carries a connection of `client` to the service that `connect` reaches.
    async fn carry<T: AsyncRead + AsyncWrite>(
        self,
        connect: impl Future<Output = std::io::Result<T>>,
        client: T,
    ) {
        let Ok(server) = connect.await else { return };
        let (from_client, to_client) = tokio::io::split(client);
        let (from_server, to_server) = tokio::io::split(server);
        tokio::join!(
            pass(from_client, to_server, self.up.subscribe(), &self.n_lost),
            pass(from_server, to_client, self.down.subscribe(), &self.n_lost),
        );
    }
}

/// Passes the bytes of one direction of a connection on, until it ends.
async fn pass(
    mut from: impl AsyncRead + Unpin,
    mut to: impl AsyncWrite + Unpin,
    mode: watch::Receiver<LinkMode>,
    n_lost: &watch::Sender<usize>,
) {
    let (mut bytes, mut n_passed) = (vec![0; 1 << 16], 0);
    while let Ok(n) = from.read(&mut bytes).await {
        let now = *mode.borrow();
        match now {
            LinkMode::Drop => {
                n_lost.send_modify(|n| *n += 1);
                return be_silent(from).await;
            }
            LinkMode::Delay(time) => tokio::time::sleep(time).await,
            _ => {}
        }
        n_passed += n;
        let is_cut = matches!(now, LinkMode::CutAfter(most) if n_passed > most);
        if n == 0 || is_cut || to.write_all(&bytes[..n]).await.is_err() {
            break;
        }
    }
    let _ = to.shutdown().await;
}

/// Loses everything, also the end. What it goes to stays connected.
async fn be_silent(mut from: impl AsyncRead + Unpin) {
    let _ = tokio::io::copy(&mut from, &mut tokio::io::sink()).await;
    std::future::pending().await
}
