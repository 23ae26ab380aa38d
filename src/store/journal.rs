//! What was committed of recordings and is not in their chunks yet.
//!
//! A commit appends one row to the journal for all its sessions, where each of
//! them would take a page of its chunks, one of its row and those of the index.
//! The same is held in memory, for the readers and until it is *folded*: put
//! into the session's chunks and its row, and removed from the journal, in one
//! transaction. What is held is always what the journal says beyond the
//! sessions' rows, so that a process that starts holds it again.

use super::from_row::from_row;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize, Serializer};
use sqlx::AnyConnection;

use super::codec::{self, Stay};
use super::tail::{FULL_CHUNK_SAMPLES, Run};
use super::{Progress, SessionRow, StoreError};
use offbd_core::vocabulary::Sample;

/// Samples in a run from which on it is folded at once: it fills pages of its own.
const LARGE_RUN: usize = 1024;

/// Samples held of a session; with as many it is folded by the commit at hand.
const MAX_HELD_SAMPLES: usize = 2 * FULL_CHUNK_SAMPLES;

/// The journal of one database, held in memory; all clones are one.
#[derive(Clone, Debug, Default)]
pub(super) struct Journal {
    held: Arc<Mutex<Held>>,
}

#[derive(Debug, Default)]
struct Held {
    sessions: HashMap<String, Unfolded>,
    /// The bytes of each row of the table, and of all.
    rows: BTreeMap<i64, usize>,
    n_bytes: usize,
}

/// What the journal has of a session.
#[derive(Debug)]
struct Unfolded {
    /// The first row of the journal that has some of it.
    row: i64,
    first_index: i64,
    n_samples: usize,
    n_bytes: usize,
    progress: Progress,
    chunks: Vec<Vec<u8>>,
}

/// A run in a row of the journal.
#[derive(Serialize, Deserialize)]
struct Entry<'a> {
    session: &'a str,
    first_index: i64,
    n_samples: i64,
    n_rejected: i64,
    first_t_s: Option<f64>,
    last_t_s: Option<f64>,
    last_seq: Option<i64>,
    #[serde(serialize_with = "as_bytes")]
    chunk: &'a [u8],
}

fn as_bytes<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}

impl Entry<'_> {
    const fn progress(&self) -> Progress {
        let Self { n_samples, n_rejected, first_t_s, last_t_s, last_seq, .. } = *self;
        Progress { n_samples, n_rejected, first_t_s, last_t_s, last_seq }
    }
}

/// What a transaction changes of the journal, to be held once it has come through.
#[derive(Debug, Default)]
pub(super) struct Changes {
    /// Sessions of which nothing is left in the journal.
    pub(super) gone: HashSet<String>,
    /// The row that it appended, its bytes, and what is in it.
    row: Option<(i64, usize)>,
    runs: Vec<(Encoded, String)>,
    /// The first row that was not removed.
    first_row: Option<i64>,
}

/// A run as it is held.
#[derive(Debug)]
struct Encoded {
    first_index: i64,
    n_samples: usize,
    progress: Progress,
    chunk: Vec<u8>,
}

impl Encoded {
    fn of(run: &Run) -> Self {
        let Run { first_index, progress, ref samples, .. } = *run;
        let chunk = codec::encode(samples, Stay::Short);
        Self { first_index, n_samples: samples.len(), progress, chunk }
    }

    fn entry<'a>(&'a self, session: &'a str) -> Entry<'a> {
        let Progress { n_samples, n_rejected, first_t_s, last_t_s, last_seq } = self.progress;
        let (first_index, chunk) = (self.first_index, &self.chunk[..]);
        Entry { session, first_index, n_samples, n_rejected, first_t_s, last_t_s, last_seq, chunk }
    }
}

/// For the writer.
impl Journal {
    /// Reads what the table has beyond the sessions' rows.
    pub(super) async fn load(db: &mut AnyConnection) -> Result<Self, StoreError> {
        let rows: Vec<(i64, Vec<u8>)> =
            sqlx::query_as("SELECT id, data FROM journal ORDER BY id").fetch_all(&mut *db).await?;
        let this = Self::default();
        if !rows.is_empty() {
            let folded = folded(db).await?;
            let mut held = this.lock();
            for (id, data) in &rows {
                held.take_row(*id, data, &folded)?;
            }
        }
        Ok(this)
    }

    /// Bytes of the table's rows.
    pub(super) fn n_bytes(&self) -> usize {
        self.lock().n_bytes
    }

    /// Whether `run` is better folded at once than appended.
    pub(super) fn is_large(&self, run: &Run) -> bool {
        let n = run.samples.len();
        let held = || self.lock().sessions.get(&run.session).map_or(0, |held| held.n_samples);
        n >= LARGE_RUN || n + held() >= MAX_HELD_SAMPLES
    }

    /// What is held of `session`, as one run.
    pub(super) fn run(&self, session: &str) -> Result<Option<Run>, StoreError> {
        let held = self.lock();
        let Some(unfolded) = held.sessions.get(session) else { return Ok(None) };
        let (first_index, progress) = (unfolded.first_index, unfolded.progress);
        let samples = unfolded.samples(session)?;
        Ok(Some(Run { session: session.to_owned(), first_index, samples, progress }))
    }

    /// The sessions that wait longest, of those not in `except`, with `n_bytes`
    /// or somewhat more.
    pub(super) fn oldest(&self, n_bytes: usize, except: &HashSet<String>) -> Vec<String> {
        let held = self.lock();
        let wanted = held.sessions.iter().filter(|(id, _)| !except.contains(*id));
        let mut all: Vec<_> = wanted.map(|(id, session)| (session.row, id, session)).collect();
        all.sort_unstable_by_key(|(row, id, _)| (*row, *id));
        let mut oldest = Vec::new();
        let mut sum = 0;
        for (_, id, session) in all {
            if sum >= n_bytes {
                break;
            }
            sum += session.n_bytes;
            oldest.push(id.clone());
        }
        oldest
    }

    /// Appends `runs` as the row `id`.
    pub(super) async fn append(
        db: &mut AnyConnection,
        id: i64,
        runs: Vec<Run>,
        changes: &mut Changes,
    ) -> Result<(), StoreError> {
        if runs.is_empty() {
            return Ok(());
        }
        changes.runs = runs.into_iter().map(|run| (Encoded::of(&run), run.session)).collect();
        let entries: Vec<_> =
            changes.runs.iter().map(|(run, session)| run.entry(session)).collect();
        let data = rmp_serde::to_vec(&entries).map_err(|e| StoreError::journal(id, &e))?;
        changes.row = Some((id, data.len()));
        sqlx::query("INSERT INTO journal (id, data) VALUES ($1, $2)")
            .bind(id)
            .bind(data)
            .execute(db)
            .await?;
        Ok(())
    }

    /// Removes the rows of which nothing is left after `changes`; `next` is the
    /// row after the last one.
    pub(super) async fn trim(
        &self,
        db: &mut AnyConnection,
        next: i64,
        changes: &mut Changes,
    ) -> Result<(), StoreError> {
        let first = self.lock().first_row(&changes.gone).unwrap_or(next);
        sqlx::query("DELETE FROM journal WHERE id < $1").bind(first).execute(db).await?;
        changes.first_row = Some(first);
        Ok(())
    }

    /// Holds what is in the journal after `changes`.
    pub(super) fn apply(&self, changes: Changes) {
        let mut held = self.lock();
        for session in &changes.gone {
            held.sessions.remove(session);
        }
        if let Some(first) = changes.first_row {
            let left = held.rows.split_off(&first);
            let removed = std::mem::replace(&mut held.rows, left);
            held.n_bytes -= removed.values().sum::<usize>();
        }
        let Some((row, n_bytes)) = changes.row else { return };
        held.add_row(row, n_bytes);
        for (run, session) in changes.runs {
            held.take(row, session, run);
        }
    }
}

/// For the readers, who ask before they look into the tables: what is folded
/// meanwhile is then found there.
impl Journal {
    /// The samples of `session` from `index` on, if the first of them is here.
    pub(super) fn samples_from(
        &self,
        session: &str,
        index: i64,
    ) -> Result<Option<Vec<Sample>>, StoreError> {
        let held = self.lock();
        let Some(unfolded) = held.sessions.get(session) else { return Ok(None) };
        let at = usize::try_from(index - unfolded.first_index).ok();
        let Some(at) = at.filter(|&at| at < unfolded.n_samples) else { return Ok(None) };
        let mut samples = unfolded.samples(session)?;
        drop(held);
        Ok(Some(samples.split_off(at)))
    }

    /// How far `session` has come, if the journal knows better than its row.
    pub(super) fn progress(&self, session: &str) -> Option<Progress> {
        self.lock().sessions.get(session).map(|unfolded| unfolded.progress)
    }

    /// The same of all sessions.
    pub(super) fn all_progress(&self) -> HashMap<String, Progress> {
        let held = self.lock();
        held.sessions.iter().map(|(id, unfolded)| (id.clone(), unfolded.progress)).collect()
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl SessionRow {
    /// The same with how far the session has come by the journal, if that is `known`
    /// and more.
    pub(super) fn with(mut self, known: Option<&Progress>) -> Self {
        if let Some(known) = known.filter(|known| known.is_beyond(&self.progress)) {
            self.progress = *known;
        }
        self
    }
}

impl Held {
    fn add_row(&mut self, id: i64, n_bytes: usize) {
        self.rows.insert(id, n_bytes);
        self.n_bytes += n_bytes;
    }

    fn take(&mut self, row: i64, session: String, run: Encoded) {
        let Encoded { first_index, n_samples, progress, chunk } = run;
        let unfolded = self.sessions.entry(session).or_insert_with(|| Unfolded {
            row,
            first_index,
            n_samples: 0,
            n_bytes: 0,
            progress,
            chunks: Vec::new(),
        });
        unfolded.n_samples += n_samples;
        unfolded.n_bytes += chunk.len();
        unfolded.progress = progress;
        unfolded.chunks.push(chunk);
    }

    /// Takes from a row of the table what is beyond `folded`, how far the open
    /// sessions' rows have come.
    fn take_row(
        &mut self,
        id: i64,
        data: &[u8],
        folded: &HashMap<String, Progress>,
    ) -> Result<(), StoreError> {
        let entries: Vec<Entry<'_>> =
            rmp_serde::from_slice(data).map_err(|e| StoreError::journal(id, &e))?;
        self.add_row(id, data.len());
        for entry in entries {
            let progress = entry.progress();
            if !folded.get(entry.session).is_some_and(|folded| progress.is_beyond(folded)) {
                continue;
            }
            let n_samples =
                codec::n_samples(entry.chunk).map_err(|e| StoreError::journal(id, &e))?;
            let chunk = entry.chunk.to_vec();
            let run = Encoded { first_index: entry.first_index, n_samples, progress, chunk };
            self.take(id, entry.session.to_owned(), run);
        }
        Ok(())
    }

    /// The first row that has something of a session not in `gone`.
    fn first_row(&self, gone: &HashSet<String>) -> Option<i64> {
        let left = self.sessions.iter().filter(|(id, _)| !gone.contains(*id));
        left.map(|(_, unfolded)| unfolded.row).min()
    }
}

impl Unfolded {
    fn samples(&self, session: &str) -> Result<Vec<Sample>, StoreError> {
        let mut samples = Vec::with_capacity(self.n_samples);
        for chunk in &self.chunks {
            let first_index = self.first_index + samples.len() as i64;
            samples.extend(codec::decode(chunk).map_err(|source| StoreError::Chunk {
                session: session.to_owned(),
                first_index,
                source,
            })?);
        }
        Ok(samples)
    }
}

/// How far the rows of the open sessions have come. All else is folded.
async fn folded(db: &mut AnyConnection) -> Result<HashMap<String, Progress>, StoreError> {
    struct Folded {
        id: String,
        progress: Progress,
    }

    from_row!(Folded { id }[progress]);
    let rows: Vec<Folded> = sqlx::query_as(
        "SELECT id, n_samples, n_rejected, first_t_s, last_t_s, last_seq FROM session
         WHERE state = 'open'",
    )
    .fetch_all(db)
    .await?;
    Ok(rows.into_iter().map(|row| (row.id, row.progress)).collect())
}
