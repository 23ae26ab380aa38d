//! A way to a PostgreSQL server that can hold the connection with which a node writes at a given
//! statement of a transaction, before the server gets it or before the node gets its answer. So
//! a node is met between two statements each time, and not by luck.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::watch;

/// Name of the server's socket in its directory.
const SOCKET: &str = ".s.PGSQL.5432";

/// A setting of each connection with which a node writes, and of no other.
const WRITER_SETTING: &str = "idle_session_timeout";

/// Code of a request for encryption, which comes before the start of a connection.
const SSL_REQUEST: &[u8] = &80_877_103_u32.to_be_bytes();

/// Which side of a statement is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldSide {
    /// The server does not get it.
    Statement,
    /// The server has executed it, and the node does not know.
    Answer,
}

/// Statements that belong together, by words of the first and the last one.
#[derive(Clone, Copy, Debug)]
pub struct StatementSequence {
    pub first: &'static str,
    pub last: &'static str,
}

/// Where to hold within a sequence.
#[derive(Clone, Copy, Debug)]
pub struct HoldPoint {
    /// From 1; `None` for the last statement.
    pub number: Option<usize>,
    pub side: HeldSide,
}

#[derive(Clone, Debug, Default)]
struct GateState {
    point: Option<(StatementSequence, HoldPoint)>,
    /// Statements of the sequence so far; 0 before its first.
    n_passed: usize,
    /// The statement at which the connection is held.
    held: Option<String>,
    /// The sequence is over, and nothing was held.
    is_over: bool,
}

impl GateState {
    /// Counts a statement; returns the side on which it is to be held.
    fn count(&mut self, sql: &str) -> Option<HeldSide> {
        let (sequence, HoldPoint { number, side }) = self.point?;
        if self.is_over || self.n_passed == 0 && !sql.contains(sequence.first) {
            return None;
        }
        self.n_passed += 1;
        let is_last = sql.contains(sequence.last);
        if number.map_or(is_last, |number| self.n_passed == number) {
            return Some(side);
        }
        self.is_over = is_last;
        None
    }
}

pub struct StatementGate {
    pub directory: tempfile::TempDir,
    state: watch::Sender<GateState>,
}

impl StatementGate {
    /// Starts to pass connections on to the server with its socket in `server`.
    pub fn new(server: &Path) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(directory.path().join(SOCKET)).unwrap();
        let (state, _) = watch::channel(GateState::default());
        tokio::spawn(accept(listener, server.join(SOCKET), state.clone()));
        Self { directory, state }
    }

    /// Holds the writer at this point of the next `sequence`.
    pub fn hold_at(&self, sequence: StatementSequence, point: HoldPoint) {
        let point = Some((sequence, point));
        self.state.send_replace(GateState { point, ..GateState::default() });
    }

    /// Waits until the writer is held; returns the statement, `None` if the sequence is over
    /// before it.
    pub async fn held(&self) -> Option<String> {
        let mut state = self.state.subscribe();
        let is_met = |state: &GateState| state.held.is_some() || state.is_over;
        let met = tokio::time::timeout(super::DEADLINE, state.wait_for(is_met));
        met.await.expect("a statement in time").unwrap().held.clone()
    }

    /// Holds nothing any more.
    pub fn release(&self) {
        self.state.send_replace(GateState::default());
    }
}

async fn accept(listener: UnixListener, server: PathBuf, state: watch::Sender<GateState>) {
    while let Ok((client, _)) = listener.accept().await {
        let (server, state) = (server.clone(), state.clone());
        tokio::spawn(async move {
            let Ok(server) = UnixStream::connect(server).await else { return };
            let (from_client, to_client) = client.into_split();
            let (from_server, to_server) = server.into_split();
            // The statement whose answer is held.
            let (waiting, answers) = watch::channel(None);
            let up = Up { state: state.clone(), waiting: Arc::new(waiting), is_writer: false };
            tokio::join!(
                up.pass(from_client, to_server),
                pass_answers(from_server, to_client, answers, state)
            );
        });
    }
}

/// Passes answers on. The end of the server's connection is held as well.
async fn pass_answers(
    mut from: OwnedReadHalf,
    mut to: OwnedWriteHalf,
    waiting: watch::Receiver<Option<String>>,
    state: watch::Sender<GateState>,
) {
    let mut bytes = vec![0; 1 << 16];
    while let Ok(n) = from.read(&mut bytes).await {
        let statement = waiting.borrow().clone();
        if let Some(statement) = statement {
            state.send_modify(|state| {
                if state.point.is_some() {
                    state.held.get_or_insert(statement);
                }
            });
        }
        let mut released = state.subscribe();
        let is_free = |state: &GateState| state.held.is_none();
        // Other connections of the node pass.
        if waiting.borrow().is_some() && released.wait_for(is_free).await.is_err() {
            break;
        }
        if n == 0 || to.write_all(&bytes[..n]).await.is_err() {
            break;
        }
    }
    let _ = to.shutdown().await;
}

/// The direction from the node to the server.
struct Up {
    state: watch::Sender<GateState>,
    waiting: Arc<watch::Sender<Option<String>>>,
    is_writer: bool,
}

impl Up {
    /// Passes messages on, all that need one answer together.
    async fn pass(mut self, mut from: OwnedReadHalf, mut to: OwnedWriteHalf) {
        let _ = self.try_pass(&mut from, &mut to).await;
        let _ = to.shutdown().await;
    }

    async fn try_pass(
        &mut self,
        from: &mut (impl AsyncRead + Unpin),
        to: &mut (impl AsyncWrite + Unpin),
    ) -> std::io::Result<()> {
        loop {
            let start = message(from, 0).await?;
            to.write_all(&start).await?;
            if start[4..] != *SSL_REQUEST {
                break;
            }
        }
        let (mut statements, mut group) = (HashMap::new(), Vec::new());
        let (mut sql, mut is_executed) = (None, false);
        loop {
            let next = message(from, 1).await?;
            sql = statement(&next, &mut statements).or(sql);
            group.extend_from_slice(&next);
            is_executed |= matches!(next[0], b'Q' | b'E');
            if matches!(next[0], b'P' | b'B' | b'D' | b'E' | b'C') {
                continue;
            }
            // A statement that is only prepared changes nothing.
            if let Some(sql) = sql.take().filter(|_| is_executed) {
                self.meet(sql).await;
            }
            is_executed = false;
            to.write_all(&group).await?;
            group.clear();
        }
    }

    /// Holds a statement if it is to be held.
    async fn meet(&mut self, sql: String) {
        self.is_writer |= sql.contains(WRITER_SETTING);
        if !self.is_writer {
            return;
        }
        let mut side = None;
        self.state.send_modify(|state| side = state.count(&sql));
        match side {
            Some(HeldSide::Statement) => {
                let mut released = self.state.subscribe();
                self.waiting.send_replace(Some(sql.clone()));
                self.state.send_modify(|state| state.held = Some(sql));
                let _ = released.wait_for(|state| state.held.is_none()).await;
            }
            Some(HeldSide::Answer) => drop(self.waiting.send_replace(Some(sql))),
            None => {}
        }
    }
}

/// Reads a message: `n_type` bytes of its type, its length, and the rest.
async fn message(from: &mut (impl AsyncRead + Unpin), n_type: usize) -> std::io::Result<Vec<u8>> {
    let mut message = vec![0; n_type + 4];
    from.read_exact(&mut message).await?;
    let length = u32::from_be_bytes(message[n_type..].try_into().unwrap());
    message.resize(n_type + usize::try_from(length).unwrap(), 0);
    from.read_exact(&mut message[n_type + 4..]).await?;
    Ok(message)
}

/// The statement that a message executes or prepares, if it does.
fn statement(message: &[u8], known: &mut HashMap<Vec<u8>, String>) -> Option<String> {
    let mut words = message[5..].split(|byte| *byte == 0);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    match message[0] {
        b'Q' => words.next().map(text),
        b'P' => {
            let (name, sql) = (words.next()?.to_owned(), text(words.next()?));
            known.insert(name, sql.clone());
            Some(sql)
        }
        b'B' => known.get(words.nth(1)?).cloned(),
        _ => None,
    }
}
