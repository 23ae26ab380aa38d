//! A TCP proxy on a bad line: every connection ends early. Of ten, about one ends within the
//! first request, one before the first answer, and the others after some requests, anywhere.
//! After a lost answer the service has stored a batch, but its sender does not know.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

use super::device::Random;

/// Of so many connections, one ends within the first request and one before the first answer.
const ONE_OF: usize = 10;
/// A first request that is cut ends after less than this, bytes; its head is about as long.
const CUT_BYTES: usize = 600;
/// Any connection ends after less than this, bytes of requests.
const LONGEST_BYTES: usize = 30_000;

/// What becomes of a connection.
enum Fate {
    /// Ends after so many bytes of requests.
    CutRequest(usize),
    CutAnswer,
}

pub struct LossyProxy {
    pub port: u16,
    to: Arc<Mutex<String>>,
    n_cut: Arc<AtomicUsize>,
}

impl LossyProxy {
    /// Starts a proxy to the service at `address`.
    pub async fn start(address: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = listener.local_addr().unwrap().port();
        let to = Arc::new(Mutex::new(address.to_owned()));
        let n_cut = Arc::<AtomicUsize>::default();
        tokio::spawn(accept(listener, to.clone(), n_cut.clone()));
        Self { port, to, n_cut }
    }

    /// Passes later connections on to the service at `address`.
    pub fn set_service(&self, address: &str) {
        address.clone_into(&mut self.to.lock().unwrap());
    }

    /// Number of connections, all of which were cut or will be.
    pub fn n_cut(&self) -> usize {
        self.n_cut.load(Ordering::Relaxed)
    }
}

async fn accept(listener: TcpListener, to: Arc<Mutex<String>>, n_cut: Arc<AtomicUsize>) {
    let mut random = Random(1);
    while let Ok((client, _)) = listener.accept().await {
        let fate = match random.below(ONE_OF) {
            0 => Fate::CutRequest(random.below(CUT_BYTES)),
            1 => Fate::CutAnswer,
            _ => Fate::CutRequest(random.below(LONGEST_BYTES)),
        };
        n_cut.fetch_add(1, Ordering::Relaxed);
        let to = to.lock().unwrap().clone();
        tokio::spawn(pass(client, to, fate));
    }
}

/// Passes one connection on; a service that cannot be reached closes it.
async fn pass(mut client: TcpStream, to: String, fate: Fate) {
    let Ok(mut service) = TcpStream::connect(to).await else { return };
    let (mut from_client, mut to_client) = client.split();
    let (mut from_service, mut to_service) = service.split();
    match fate {
        Fate::CutRequest(bytes) => {
            let mut requests = from_client.take(bytes as u64);
            tokio::select! {
                () = copy(&mut requests, &mut to_service) => {}
                () = copy(&mut from_service, &mut to_client) => {}
            }
        }
        Fate::CutAnswer => {
            // The service answers when it has stored the batch.
            let answered = async { from_service.read(&mut [0; 1]).await };
            tokio::select! {
                () = copy(&mut from_client, &mut to_service) => {}
                _ = answered => {}
            }
        }
    }
}

/// Copies until either side ends.
async fn copy(from: &mut (impl AsyncRead + Unpin), to: &mut (impl AsyncWrite + Unpin)) {
    let _ = tokio::io::copy(from, to).await;
    let _ = to.shutdown().await;
}
