//! The tail of an open session: the small chunks at the end of its recording.
//!
//! Each fold of the journal appends the samples of a session as one *run*. A short run
//! makes a small chunk. Small chunks are always the last ones of their session; a run
//! that would bring them to 128 chunks or to 2048 samples is merged with them, in the
//! same transaction. So a recording consists of chunks with at least 2048 samples and a
//! bounded tail, and appending never rewrites long chunks. When a session ends, its tail
//! is merged a last time.

use std::collections::{BTreeMap, HashMap};

use sqlx::AnyConnection;

use super::codec::{ChunkKey, Packing};
use super::multi_row::{MultiRowStatement, in_parts};
use super::progress::SESSIONS_AT_ONCE;
use super::query_builder::QueryBuilder;
use super::{PartitionId, SessionProgress, StoreError, codec, decode_chunk};
use offbd_core::vocabulary::Sample;

/// Samples in a full chunk; a longer run is cut into several.
pub const FULL_CHUNK_SAMPLES: usize = 8192;

/// Samples from which on a chunk is never merged again. Smaller chunks are in the tail,
/// which is merged as soon as it has as many samples.
const LONG_CHUNK_SAMPLES: usize = 2048;

/// Chunks in the tail of a session; the transaction that would reach this number merges
/// them.
pub const MAX_TAIL_CHUNKS: usize = 128;

/// Tails whose size is cached. When there are more, the one of the oldest session is counted in
/// the database again.
const MAX_CACHED: usize = 10_000;

/// The size of the tail of a session: chunks shorter than [`LONG_CHUNK_SAMPLES`], all at
/// the end of its recording.
#[derive(Clone, Copy, Debug, Default)]
struct Tail {
    n_chunks: usize,
    n_samples: usize,
}

/// The tails of open sessions, with their sizes cached.
#[derive(Debug, Default)]
pub(super) struct Tails {
    /// By session, whose ids have the order of time.
    cached: BTreeMap<String, (PartitionId, Tail)>,
    /// Sessions whose tail the transaction changes that is open or was the last one.
    changed: Vec<String>,
}

impl Tails {
    /// Forgets the tails that a failed transaction may have made wrong.
    pub(super) fn forget_uncommitted(&mut self) {
        for session in std::mem::take(&mut self.changed) {
            self.cached.remove(&session);
        }
    }

    /// Notes that the last transaction is committed.
    pub(super) fn note_committed(&mut self) {
        self.changed.clear();
    }

    /// Forgets the tails of `partitions`, which another writer may change.
    pub(super) fn forget(&mut self, partitions: &[PartitionId]) {
        self.cached.retain(|_, (partition, _)| !partitions.contains(partition));
    }

    /// Removes the deleted `session` from the cache.
    pub(super) fn remove(&mut self, session: &str) {
        self.cached.remove(session);
    }

    /// Appends `runs`, at most one per session, to the chunks of their sessions.
    pub(super) async fn append(
        &mut self,
        connection: &mut AnyConnection,
        runs: &[Run],
    ) -> Result<(), StoreError> {
        let runs: Vec<_> = runs.iter().filter(|run| !run.samples.is_empty()).collect();
        let tails = self.tails(connection, &runs).await?;
        let mut small = Vec::new();
        for (run, tail) in runs.into_iter().zip(tails) {
            let (n_chunks, n_samples) = (tail.n_chunks + 1, tail.n_samples + run.samples.len());
            let tail = if n_chunks < MAX_TAIL_CHUNKS && n_samples < LONG_CHUNK_SAMPLES {
                small.extend(cut(&run.session, run.first_index, &run.samples, Packing::Plain));
                Tail { n_chunks, n_samples }
            } else {
                merge(connection, run, tail, Packing::Plain).await?
            };
            self.cache(run, tail);
        }
        insert(connection, &small).await
    }

    /// The tails of the sessions of `runs`.
    async fn tails(
        &self,
        connection: &mut AnyConnection,
        runs: &[&Run],
    ) -> Result<Vec<Tail>, StoreError> {
        let unknown = runs.iter().filter(|run| !self.cached.contains_key(&run.session));
        let unknown: Vec<_> = unknown.map(|run| run.session.clone()).collect();
        let counted = count_each(connection, &unknown).await?;
        let cached = |session| self.cached.get(session).map(|(_, tail)| tail);
        let tail = |session| cached(session).or(counted.get(session)).copied().unwrap_or_default();
        Ok(runs.iter().map(|run| tail(&run.session)).collect())
    }

    /// Appends the last run of a session that ends, and merges its tail.
    pub(super) async fn finish(
        &mut self,
        connection: &mut AnyConnection,
        run: &Run,
    ) -> Result<(), StoreError> {
        let tail = match self.cached.remove(&run.session) {
            Some((_, cached)) => cached,
            None => count(connection, &run.session).await?,
        };
        merge(connection, run, tail, Packing::Compact).await.map(drop)
    }

    fn cache(&mut self, run: &Run, tail: Tail) {
        self.changed.push(run.session.clone());
        self.cached.insert(run.session.clone(), (run.partition, tail));
        if self.cached.len() > MAX_CACHED {
            self.cached.pop_first();
        }
    }
}

/// Consecutive samples to be appended to one session, and the session's progress with them.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) partition: PartitionId,
    pub(super) session: String,
    pub(super) first_index: i64,
    pub(super) samples: Vec<Sample>,
    pub(super) progress: SessionProgress,
}

impl Run {
    /// A run without samples.
    pub(super) fn empty(partition: PartitionId, session: &str) -> Self {
        let (session, progress) = (session.to_owned(), SessionProgress::default());
        Self { partition, session, first_index: 0, samples: Vec::new(), progress }
    }

    /// Joins this run and the next one of the same session.
    pub(super) fn followed_by(mut self, next: Self) -> Self {
        self.samples.extend(next.samples);
        Self { progress: next.progress, ..self }
    }
}

/// A chunk to be inserted.
struct NewChunk<'a> {
    session: &'a str,
    first_index: i64,
    samples: &'a [Sample],
    packing: Packing,
}

/// Cuts `samples` into full chunks and a rest. Chunks that are never merged again are
/// compressed, a shorter rest is packed as `rest` says.
fn cut<'a>(
    session: &'a str,
    first_index: i64,
    samples: &'a [Sample],
    rest: Packing,
) -> impl Iterator<Item = NewChunk<'a>> {
    samples.chunks(FULL_CHUNK_SAMPLES).enumerate().map(move |(i, samples)| {
        let first_index = first_index + (i * FULL_CHUNK_SAMPLES) as i64;
        let packing = if samples.len() >= LONG_CHUNK_SAMPLES { Packing::Compact } else { rest };
        NewChunk { session, first_index, samples, packing }
    })
}

async fn count(connection: &mut AnyConnection, session: &str) -> Result<Tail, StoreError> {
    let session = session.to_owned();
    let counted = count_each(connection, std::slice::from_ref(&session)).await?;
    Ok(counted.get(&session).copied().unwrap_or_default())
}

/// The tails of those of `sessions` that have one.
async fn count_each(
    connection: &mut AnyConnection,
    sessions: &[String],
) -> Result<HashMap<String, Tail>, StoreError> {
    let mut tails = HashMap::new();
    for part in sessions.chunks(SESSIONS_AT_ONCE) {
        let mut query = QueryBuilder::new(
            "SELECT session, COUNT(*), CAST(SUM(n) AS BIGINT) FROM chunk WHERE n < ",
        );
        query.bind(LONG_CHUNK_SAMPLES as i64)?.push(" AND session IN (");
        query.bind_list(part)?.push(") GROUP BY session");
        let rows: Vec<(String, i64, i64)> = query.rows().fetch_all(&mut *connection).await?;
        let count = |n: i64| usize::try_from(n).unwrap_or(0);
        tails.extend(rows.into_iter().map(|(session, n_chunks, n_samples)| {
            (session, Tail { n_chunks: count(n_chunks), n_samples: count(n_samples) })
        }));
    }
    Ok(tails)
}

async fn insert(connection: &mut AnyConnection, chunks: &[NewChunk<'_>]) -> Result<(), StoreError> {
    static INSERT: MultiRowStatement = MultiRowStatement::new(
        "INSERT INTO chunk (session, first_index, n, min_t_s, max_t_s, data) VALUES ",
        6,
        "",
    );
    for part in in_parts(chunks) {
        let mut query = sqlx::query(INSERT.sql(part.len()));
        for NewChunk { session, first_index, samples, packing } in part {
            let key = ChunkKey { session, first_index: *first_index };
            let times = || samples.iter().map(|sample| sample.t_s);
            query = query
                .bind(*session)
                .bind(first_index)
                .bind(samples.len() as i64)
                .bind(times().fold(f64::INFINITY, f64::min))
                .bind(times().fold(f64::NEG_INFINITY, f64::max))
                .bind(codec::encode(samples, *packing, key));
        }
        query.execute(&mut *connection).await?;
    }
    Ok(())
}

/// Joins the small chunks of `tail` with `run` and stores the result as full chunks and a
/// rest. Returns the new tail.
async fn merge(
    connection: &mut AnyConnection,
    run: &Run,
    tail: Tail,
    rest: Packing,
) -> Result<Tail, StoreError> {
    let session = &run.session;
    let small = if tail.n_chunks > 0 { take_small(connection, session).await? } else { vec![] };
    let first_index = small.first().map_or(run.first_index, |(first_index, _)| *first_index);
    let mut samples = decode_all(session, &small)?;
    samples.extend_from_slice(&run.samples);
    let chunks: Vec<_> = cut(session, first_index, &samples, rest).collect();
    insert(connection, &chunks).await?;
    let small = chunks.last().filter(|chunk| chunk.samples.len() < LONG_CHUNK_SAMPLES);
    Ok(small.map_or(Tail::default(), |last| Tail { n_chunks: 1, n_samples: last.samples.len() }))
}

/// Reads and removes the small chunks of `session`.
async fn take_small(
    connection: &mut AnyConnection,
    session: &str,
) -> Result<Vec<(i64, Vec<u8>)>, StoreError> {
    let small = sqlx::query_as(
        "SELECT first_index, data FROM chunk WHERE session = $1 AND n < $2 ORDER BY first_index",
    )
    .bind(session)
    .bind(LONG_CHUNK_SAMPLES as i64)
    .fetch_all(&mut *connection)
    .await?;
    sqlx::query("DELETE FROM chunk WHERE session = $1 AND n < $2")
        .bind(session)
        .bind(LONG_CHUNK_SAMPLES as i64)
        .execute(connection)
        .await?;
    Ok(small)
}

fn decode_all(session: &str, chunks: &[(i64, Vec<u8>)]) -> Result<Vec<Sample>, StoreError> {
    let mut samples = Vec::new();
    for &(first_index, ref data) in chunks {
        samples.extend(decode_chunk(data, ChunkKey { session, first_index })?);
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cached(tails: &Tails) -> Vec<&str> {
        tails.cached.keys().map(String::as_str).collect()
    }

    #[test]
    fn one_session_too_many_and_a_partition_that_goes_cost_no_others() {
        let mut tails = Tails::default();
        let sessions: Vec<_> = (0..=MAX_CACHED).map(|i| format!("{i:06}")).collect();
        for (i, session) in sessions.iter().enumerate() {
            let partition = PartitionId(u32::from(i % 2 == 0));
            tails.cache(&Run::empty(partition, session), Tail::default());
        }
        tails.note_committed();
        assert_eq!(cached(&tails), sessions[1..], "all but the oldest");
        // One that is cached already takes no other's place.
        tails.cache(&Run::empty(PartitionId(0), &sessions[1]), Tail::default());
        assert_eq!(tails.cached.len(), MAX_CACHED);
        tails.forget_uncommitted();
        assert_eq!(cached(&tails), sessions[2..], "what the failed transaction has changed");
        tails.forget(&[PartitionId(1)]);
        let odd: Vec<_> = sessions[2..].iter().skip(1).step_by(2).collect();
        assert_eq!(cached(&tails), odd);
    }
}
