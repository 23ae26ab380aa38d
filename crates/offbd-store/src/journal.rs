//! The journal: samples that are committed but not in the chunks of their session yet.
//!
//! Each commit appends one row per partition to the table `journal`, with the new samples of
//! all its sessions. Written to chunks directly, the samples of each session would change
//! several pages: of its chunks, of its row and of the indexes. The writer also keeps the
//! journal's contents in memory, where readers look before they query the tables. To
//! *fold* a session is to move its samples from the journal to its chunks and to update
//! its row, in one transaction: after a crash or an error they are in one of the two,
//! never in both or in neither.
//!
//! The memory holds exactly those journal entries of owned partitions that are beyond the
//! progress in the rows of their sessions. So [`Journal::load`] restores it when a
//! partition is taken, and entries that are folded already are skipped even if their journal
//! row still exists.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize, Serializer};
use sqlx::AnyConnection;

use super::codec::{self, ChunkKey, Packing};
use super::multi_row::{MultiRowStatement, in_parts};
use super::progress::stored_progress;
use super::tail::{FULL_CHUNK_SAMPLES, Run};
use super::{PartitionId, SessionProgress, StoreError, decode_chunk};
use offbd_core::vocabulary::Sample;

/// Samples from which on a run is folded by its own commit: it fills whole pages anyway.
const LARGE_RUN_SAMPLES: usize = 1024;

/// Samples of a session in the journal; the commit that reaches this number folds the
/// session.
const MAX_SESSION_SAMPLES: usize = 2 * FULL_CHUNK_SAMPLES;

/// The journal of one database, as kept in memory. Clones share the contents.
#[derive(Clone, Debug, Default)]
pub(super) struct Journal {
    contents: Arc<Mutex<JournalContents>>,
}

#[derive(Debug, Default)]
struct JournalContents {
    sessions: HashMap<Arc<str>, UnfoldedSession>,
    /// All sessions by their first row, so by partition.
    by_row: BTreeSet<(i64, Arc<str>)>,
    /// All sessions in the order in which they were added.
    by_age: BTreeSet<(u64, Arc<str>)>,
    /// Sessions that were added so far.
    n_added: u64,
    /// Bytes of each row of the table, by id.
    rows: BTreeMap<i64, usize>,
    /// Bytes of all rows of the table.
    n_bytes: usize,
}

/// The samples of one session in the journal.
#[derive(Debug)]
struct UnfoldedSession {
    /// The first journal row with samples of the session.
    first_row: i64,
    /// Its place in the order in which sessions were added.
    age: u64,
    first_index: i64,
    n_samples: usize,
    n_bytes: usize,
    progress: SessionProgress,
    chunks: Vec<Vec<u8>>,
}

/// One run in a row of the journal, as serialised.
#[derive(Serialize, Deserialize)]
struct JournalEntry<'a> {
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

impl JournalEntry<'_> {
    const fn progress(&self) -> SessionProgress {
        let Self { n_samples, n_rejected, first_t_s, last_t_s, last_seq, .. } = *self;
        SessionProgress { n_samples, n_rejected, first_t_s, last_t_s, last_seq }
    }
}

/// The changes of the journal by a transaction; [`Journal::apply`] takes them over into
/// memory once the transaction is committed.
#[derive(Debug, Default)]
pub(super) struct JournalChanges {
    /// Sessions whose earlier samples are no longer in the journal.
    pub(super) removed_sessions: HashSet<String>,
    /// Id and bytes of each row that was appended.
    appended_rows: Vec<(i64, usize)>,
    /// The runs in these rows.
    runs: Vec<EncodedRun>,
    /// Of a partition each, the rows that were removed.
    removed_rows: Vec<Range<i64>>,
}

/// A [`Run`] as a chunk in a row of the journal.
#[derive(Debug)]
struct EncodedRun {
    row: i64,
    session: Arc<str>,
    first_index: i64,
    n_samples: usize,
    progress: SessionProgress,
    chunk: Vec<u8>,
}

impl EncodedRun {
    fn of(run: &Run, row: i64) -> Self {
        let Run { first_index, progress, ref samples, .. } = *run;
        let key = ChunkKey { session: &run.session, first_index };
        let chunk = codec::encode(samples, Packing::Plain, key);
        let session = run.session.as_str().into();
        Self { row, session, first_index, n_samples: samples.len(), progress, chunk }
    }

    fn entry(&self) -> JournalEntry<'_> {
        let SessionProgress { n_samples, n_rejected, first_t_s, last_t_s, last_seq } =
            self.progress;
        let (session, first_index, chunk) = (&*self.session, self.first_index, &self.chunk[..]);
        JournalEntry {
            session,
            first_index,
            n_samples,
            n_rejected,
            first_t_s,
            last_t_s,
            last_seq,
            chunk,
        }
    }
}

/// Methods of the writer.
impl Journal {
    /// Reads the entries of some partitions that are beyond the progress in the sessions'
    /// rows.
    pub(super) async fn load(
        &self,
        db: &mut AnyConnection,
        partitions: &[PartitionId],
    ) -> Result<(), StoreError> {
        for partition in partitions {
            let rows: Vec<(i64, Vec<u8>)> = sqlx::query_as(
                "SELECT id, data FROM journal WHERE id >= $1 AND id < $2 ORDER BY id",
            )
            .bind(partition.journal_row(0))
            .bind(partition.next_journal_row())
            .fetch_all(&mut *db)
            .await?;
            if rows.is_empty() {
                continue;
            }
            let folded = folded_progress(db, &rows).await?;
            let mut contents = self.lock();
            contents.forget(*partition);
            for (id, data) in &rows {
                contents.load_row(*id, data, &folded)?;
            }
        }
        Ok(())
    }

    /// Removes the entries of a partition that is no longer owned.
    pub(super) fn forget(&self, partition: PartitionId) {
        self.lock().forget(partition);
    }

    /// The partitions that have rows in the table and no session that needs them.
    pub(super) fn idle_partitions(&self) -> Vec<PartitionId> {
        let contents = self.lock();
        let (mut idle, mut from) = (Vec::new(), i64::MIN);
        while let Some((&row, _)) = contents.rows.range(from..).next() {
            let partition = PartitionId::of_journal_row(row);
            from = partition.next_journal_row();
            if contents.first_needed_row(partition, &HashSet::new()).is_none() {
                idle.push(partition);
            }
        }
        idle
    }

    /// The partition of a session that is in the journal.
    pub(super) fn partition_of(&self, session: &str) -> Option<PartitionId> {
        let contents = self.lock();
        contents.sessions.get(session).map(|s| PartitionId::of_journal_row(s.first_row))
    }

    /// Bytes of all rows of the table.
    pub(super) fn n_bytes(&self) -> usize {
        self.lock().n_bytes
    }

    /// Returns whether `run` should be folded by its own commit instead of being appended.
    pub(super) fn is_large(&self, run: &Run) -> bool {
        let n = run.samples.len();
        let before = || self.lock().sessions.get(&*run.session).map_or(0, |known| known.n_samples);
        n >= LARGE_RUN_SAMPLES || n + before() >= MAX_SESSION_SAMPLES
    }

    /// The samples of `session` in the journal, as one run.
    pub(super) fn run(&self, session: &str) -> Result<Option<Run>, StoreError> {
        let contents = self.lock();
        let Some(unfolded) = contents.sessions.get(session) else { return Ok(None) };
        let (first_index, progress) = (unfolded.first_index, unfolded.progress);
        let partition = PartitionId::of_journal_row(unfolded.first_row);
        let samples = unfolded.samples(session)?;
        Ok(Some(Run { partition, session: session.to_owned(), first_index, samples, progress }))
    }

    /// Returns the sessions that have been in the journal longest, without those in
    /// `except`: as many as are needed for `n_bytes` in total.
    pub(super) fn oldest(&self, n_bytes: usize, except: &HashSet<String>) -> Vec<String> {
        let contents = self.lock();
        let mut oldest = Vec::new();
        let mut sum = 0;
        for (_, id) in contents.by_age.iter().filter(|(_, id)| !except.contains(&**id)) {
            if sum >= n_bytes {
                break;
            }
            sum += contents.sessions.get(id).map_or(0, |session| session.n_bytes);
            oldest.push(id.to_string());
        }
        oldest
    }

    /// Appends `runs` to the table, a row for each of their partitions. `row` returns the id
    /// of that row.
    pub(super) async fn append(
        db: &mut AnyConnection,
        runs: Vec<Run>,
        row: impl Fn(PartitionId) -> i64,
        changes: &mut JournalChanges,
    ) -> Result<(), StoreError> {
        static INSERT: MultiRowStatement =
            MultiRowStatement::new("INSERT INTO journal (id, data) VALUES ", 2, "");
        let mut by_row = BTreeMap::<i64, Vec<EncodedRun>>::new();
        for run in &runs {
            let row = row(run.partition);
            by_row.entry(row).or_default().push(EncodedRun::of(run, row));
        }
        let mut rows = Vec::with_capacity(by_row.len());
        for (id, runs) in by_row {
            let entries: Vec<_> = runs.iter().map(EncodedRun::entry).collect();
            let data = sealed(id, &entries)?;
            changes.appended_rows.push((id, data.len()));
            changes.runs.extend(runs);
            rows.push((id, data));
        }
        for part in in_parts(&rows) {
            let mut query = sqlx::query(INSERT.sql(part.len()));
            for (id, data) in part {
                query = query.bind(id).bind(&data[..]);
            }
            query.execute(&mut *db).await?;
        }
        Ok(())
    }

    /// Removes from the table the oldest rows of `partition` that are no longer needed after
    /// `changes`. `next` is the id of the row after its last one.
    pub(super) async fn trim(
        &self,
        db: &mut AnyConnection,
        partition: PartitionId,
        next: i64,
        changes: &mut JournalChanges,
    ) -> Result<(), StoreError> {
        let begin = partition.journal_row(0);
        let needed = self.lock().first_needed_row(partition, &changes.removed_sessions);
        let first = needed.unwrap_or(next);
        sqlx::query("DELETE FROM journal WHERE id >= $1 AND id < $2")
            .bind(begin)
            .bind(first)
            .execute(db)
            .await?;
        changes.removed_rows.push(begin..first);
        Ok(())
    }

    /// Applies the changes of a committed transaction to the contents in memory.
    pub(super) fn apply(&self, changes: JournalChanges) {
        let mut contents = self.lock();
        for session in &changes.removed_sessions {
            contents.remove(session);
        }
        for removed in changes.removed_rows {
            contents.remove_rows(removed);
        }
        for (row, n_bytes) in changes.appended_rows {
            contents.add_row(row, n_bytes);
        }
        for run in changes.runs {
            contents.add_run(run);
        }
    }
}

/// Methods of the readers. They must be called before the tables are queried: samples
/// that are folded in between are then found in the tables.
impl Journal {
    /// The samples of `session` from `index` on; `None` if the sample at `index` is not in
    /// the journal.
    pub(super) fn samples_from(
        &self,
        session: &str,
        index: i64,
    ) -> Result<Option<Vec<Sample>>, StoreError> {
        let contents = self.lock();
        let Some(unfolded) = contents.sessions.get(session) else { return Ok(None) };
        let at = usize::try_from(index - unfolded.first_index).ok();
        let Some(at) = at.filter(|&at| at < unfolded.n_samples) else { return Ok(None) };
        let mut samples = unfolded.samples(session)?;
        drop(contents);
        Ok(Some(samples.split_off(at)))
    }

    /// The progress of `session`; `None` if its row is up to date.
    pub(super) fn progress(&self, session: &str) -> Option<SessionProgress> {
        self.lock().sessions.get(session).map(|unfolded| unfolded.progress)
    }

    /// The progress of those of `sessions` whose rows are not up to date, by session id.
    pub(super) fn progress_of(&self, sessions: &[String]) -> HashMap<String, SessionProgress> {
        let contents = self.lock();
        let progress = |id: &String| Some((id.clone(), contents.sessions.get(&**id)?.progress));
        sessions.iter().filter_map(progress).collect()
    }

    /// The progress of all sessions whose row is not up to date, by session id.
    pub(super) fn all_progress(&self) -> HashMap<String, SessionProgress> {
        let contents = self.lock();
        contents.sessions.iter().map(|(id, s)| (id.to_string(), s.progress)).collect()
    }

    fn lock(&self) -> MutexGuard<'_, JournalContents> {
        self.contents.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl JournalContents {
    fn add_row(&mut self, id: i64, n_bytes: usize) {
        self.rows.insert(id, n_bytes);
        self.n_bytes += n_bytes;
    }

    fn remove_rows(&mut self, rows: Range<i64>) {
        let removed: Vec<_> = self.rows.range(rows).map(|(&id, _)| id).collect();
        for id in removed {
            self.n_bytes -= self.rows.remove(&id).unwrap_or_default();
        }
    }

    fn add_run(&mut self, run: EncodedRun) {
        let EncodedRun { row, session, first_index, n_samples, progress, chunk } = run;
        if !self.sessions.contains_key(&session) {
            self.n_added += 1;
            self.by_row.insert((row, session.clone()));
            self.by_age.insert((self.n_added, session.clone()));
        }
        let unfolded = self.sessions.entry(session).or_insert_with(|| UnfoldedSession {
            first_row: row,
            age: self.n_added,
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

    fn remove(&mut self, session: &str) {
        if let Some((id, removed)) = self.sessions.remove_entry(session) {
            self.by_row.remove(&(removed.first_row, id.clone()));
            self.by_age.remove(&(removed.age, id));
        }
    }

    /// Removes all entries of `partition`.
    fn forget(&mut self, partition: PartitionId) {
        let rows = partition.journal_row(0)..partition.next_journal_row();
        let sessions: Vec<_> = self.sessions_in(&rows).cloned().collect();
        sessions.iter().for_each(|session| self.remove(session));
        self.remove_rows(rows);
    }

    /// The sessions whose first row is one of `rows`, by that row.
    fn sessions_in(&self, rows: &Range<i64>) -> impl Iterator<Item = &Arc<str>> {
        let begin: (i64, Arc<str>) = (rows.start, "".into());
        let end: (i64, Arc<str>) = (rows.end, "".into());
        self.by_row.range(begin..end).map(|(_, id)| id)
    }

    /// Adds the entries of a row of the table that are beyond `folded`, the progress in the
    /// rows of the open sessions.
    fn load_row(
        &mut self,
        id: i64,
        data: &[u8],
        folded: &HashMap<String, SessionProgress>,
    ) -> Result<(), StoreError> {
        let entries = entries(id, data)?;
        self.add_row(id, data.len());
        for entry in entries {
            let progress = entry.progress();
            if !folded.get(entry.session).is_some_and(|folded| progress.is_beyond(folded)) {
                continue;
            }
            let key = ChunkKey { session: entry.session, first_index: entry.first_index };
            let n_samples =
                codec::n_samples(entry.chunk, key).map_err(|e| StoreError::journal(id, &e))?;
            let chunk = entry.chunk.to_vec();
            let (session, first_index) = (entry.session.into(), entry.first_index);
            let run = EncodedRun { row: id, session, first_index, n_samples, progress, chunk };
            self.add_run(run);
        }
        Ok(())
    }

    /// The first row of `partition` with samples of a session that is not in `removed`.
    fn first_needed_row(&self, partition: PartitionId, removed: &HashSet<String>) -> Option<i64> {
        let rows = partition.journal_row(0)..partition.next_journal_row();
        let needed = self.sessions_in(&rows).find(|id| !removed.contains(&***id))?;
        self.sessions.get(needed).map(|session| session.first_row)
    }
}

impl UnfoldedSession {
    fn samples(&self, session: &str) -> Result<Vec<Sample>, StoreError> {
        let mut samples = Vec::with_capacity(self.n_samples);
        for chunk in &self.chunks {
            let first_index = self.first_index + samples.len() as i64;
            samples.extend(decode_chunk(chunk, ChunkKey { session, first_index })?);
        }
        Ok(samples)
    }
}

/// A run of samples in a row of the journal.
pub(super) struct JournalRun {
    pub(super) session: String,
    pub(super) first_index: i64,
    pub(super) n: i64,
}

/// Returns the runs in the row `id` after checking all checksums.
///
/// # Errors
/// [`StoreError::Journal`] if the row is damaged.
pub(super) fn runs(id: i64, data: &[u8]) -> Result<Vec<JournalRun>, StoreError> {
    let run = |entry: &JournalEntry<'_>| {
        let JournalEntry { session, first_index, .. } = *entry;
        let samples = codec::decode(entry.chunk, ChunkKey { session, first_index })
            .map_err(|error| StoreError::journal(id, &error))?;
        Ok(JournalRun { session: session.to_owned(), first_index, n: samples.len() as i64 })
    };
    entries(id, data)?.iter().map(run).collect()
}

fn entries(id: i64, data: &[u8]) -> Result<Vec<JournalEntry<'_>>, StoreError> {
    rmp_serde::from_slice(unseal(id, data)?).map_err(|e| StoreError::journal(id, &e))
}

/// The first byte of a row with a checksum. No MessagePack document begins with it, so that
/// rows of earlier versions are told apart.
const SEALED: u8 = 0xc1;

/// Bytes of an entry without its session and chunk, at most.
const ENTRY_BYTES: usize = 64;

/// Returns the row `id` with the contents `entries`: a CRC-32 of both, and the contents. It is
/// written in one piece, since it may have megabytes.
fn sealed(id: i64, entries: &[JournalEntry<'_>]) -> Result<Vec<u8>, StoreError> {
    let n_bytes = |entry: &JournalEntry<'_>| ENTRY_BYTES + entry.session.len() + entry.chunk.len();
    let mut row = Vec::with_capacity(ENTRY_BYTES + entries.iter().map(n_bytes).sum::<usize>());
    row.extend([SEALED, 0, 0, 0, 0]);
    rmp_serde::encode::write(&mut row, entries).map_err(|e| StoreError::journal(id, &e))?;
    let (head, contents) = row.split_at_mut(5);
    head[1..].copy_from_slice(&checksum(id, contents));
    Ok(row)
}

/// Returns the contents of the row `id` after checking its checksum.
fn unseal(id: i64, data: &[u8]) -> Result<&[u8], StoreError> {
    if data.first() != Some(&SEALED) {
        return Ok(data);
    }
    match data[1..].split_first_chunk() {
        Some((found, entries)) if checksum(id, entries) == *found => Ok(entries),
        _ => Err(StoreError::journal(id, &codec::CodecError::Checksum)),
    }
}

fn checksum(id: i64, entries: &[u8]) -> [u8; 4] {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&id.to_le_bytes());
    hasher.update(entries);
    hasher.finalize().to_le_bytes()
}

/// The progress in the rows of the sessions that are in the journal's `rows`, by id.
async fn folded_progress(
    db: &mut AnyConnection,
    rows: &[(i64, Vec<u8>)],
) -> Result<HashMap<String, SessionProgress>, StoreError> {
    let mut sessions = BTreeSet::new();
    for (id, data) in rows {
        sessions.extend(entries(*id, data)?.iter().map(|entry| entry.session.to_owned()));
    }
    stored_progress(db, &sessions.into_iter().collect::<Vec<_>>()).await
}
