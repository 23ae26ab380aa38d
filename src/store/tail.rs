//! The end of an open session's recording: many small chunks, merged into big
//! ones before they become too many.

use std::collections::BTreeMap;

use sqlx::AnyConnection;

use super::codec::Stay;
use super::rows_at_once::{RowsAtOnce, in_parts};
use super::{Progress, StoreError, codec};
use offbd_core::vocabulary::Sample;

/// Samples in a full chunk; a longer run is cut into several.
pub const FULL_CHUNK_SAMPLES: usize = 8192;

/// Samples in a chunk that stays as it is; smaller ones are all at the end of
/// their session, and are merged as soon as they are as many together.
const LONG_CHUNK_SAMPLES: usize = 2048;

/// Small chunks at the end of a session; when there are as many, the writer
/// merges them within the transaction at hand.
pub const MAX_TAIL_CHUNKS: usize = 128;

/// Open sessions whose tail is remembered; beyond, all are forgotten and
/// counted again.
const MAX_REMEMBERED: usize = 10_000;

#[derive(Clone, Copy, Debug, Default)]
struct Tail {
    n_chunks: usize,
    n_samples: usize,
}

/// What is known of the open sessions' tails.
#[derive(Debug, Default)]
pub(super) struct Tails {
    known: BTreeMap<String, Tail>,
}

impl Tails {
    /// Forgets everything, after a transaction that failed.
    pub(super) fn forget(&mut self) {
        self.known.clear();
    }

    /// Forgets `session`, which is deleted.
    pub(super) fn remove(&mut self, session: &str) {
        self.known.remove(session);
    }

    /// Appends each run to its session; a session has one run at most.
    pub(super) async fn append(
        &mut self,
        connection: &mut AnyConnection,
        runs: &[Run],
    ) -> Result<(), StoreError> {
        let mut small = Vec::new();
        for run in runs.iter().filter(|run| !run.samples.is_empty()) {
            let tail = self.tail(connection, &run.session).await?;
            let (n_chunks, n_samples) = (tail.n_chunks + 1, tail.n_samples + run.samples.len());
            let tail = if n_chunks < MAX_TAIL_CHUNKS && n_samples < LONG_CHUNK_SAMPLES {
                small.extend(cut(&run.session, run.first_index, &run.samples, Stay::Short));
                Tail { n_chunks, n_samples }
            } else {
                merge(connection, run, tail, Stay::Short).await?
            };
            self.remember(&run.session, tail);
        }
        insert(connection, &small).await
    }

    async fn tail(
        &self,
        connection: &mut AnyConnection,
        session: &str,
    ) -> Result<Tail, StoreError> {
        match self.known.get(session) {
            Some(known) => Ok(*known),
            None => count(connection, session).await,
        }
    }

    /// Appends the last run of a session, which ends, and merges what is left.
    pub(super) async fn finish(
        &mut self,
        connection: &mut AnyConnection,
        run: &Run,
    ) -> Result<(), StoreError> {
        let tail = self.tail(connection, &run.session).await?;
        self.known.remove(&run.session);
        merge(connection, run, tail, Stay::Long).await.map(drop)
    }

    fn remember(&mut self, session: &str, tail: Tail) {
        if self.known.len() >= MAX_REMEMBERED {
            self.known.clear();
        }
        self.known.insert(session.to_owned(), tail);
    }
}

/// Samples at the end of a session, and how far it has come with them.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) session: String,
    pub(super) first_index: i64,
    pub(super) samples: Vec<Sample>,
    pub(super) progress: Progress,
}

impl Run {
    pub(super) fn nothing(session: &str) -> Self {
        let (session, progress) = (session.to_owned(), Progress::default());
        Self { session, first_index: 0, samples: Vec::new(), progress }
    }

    /// This and the next run of the same session.
    pub(super) fn followed_by(mut self, next: Self) -> Self {
        self.samples.extend(next.samples);
        Self { progress: next.progress, ..self }
    }
}

/// A chunk that is to be.
struct Piece<'a> {
    session: &'a str,
    first_index: i64,
    samples: &'a [Sample],
    stay: Stay,
}

/// Full chunks and a rest; long ones stay, and the `rest` as it says.
fn cut<'a>(
    session: &'a str,
    first_index: i64,
    samples: &'a [Sample],
    rest: Stay,
) -> impl Iterator<Item = Piece<'a>> {
    samples.chunks(FULL_CHUNK_SAMPLES).enumerate().map(move |(i, samples)| {
        let first_index = first_index + (i * FULL_CHUNK_SAMPLES) as i64;
        let stay = if samples.len() >= LONG_CHUNK_SAMPLES { Stay::Long } else { rest };
        Piece { session, first_index, samples, stay }
    })
}

async fn count(connection: &mut AnyConnection, session: &str) -> Result<Tail, StoreError> {
    let (n_chunks, n_samples): (i64, i64) = sqlx::query_as(
        "SELECT COUNT(*), CAST(COALESCE(SUM(n), 0) AS BIGINT) FROM chunk
         WHERE session = $1 AND n < $2",
    )
    .bind(session)
    .bind(LONG_CHUNK_SAMPLES as i64)
    .fetch_one(connection)
    .await?;
    let count = |n: i64| usize::try_from(n).unwrap_or(0);
    Ok(Tail { n_chunks: count(n_chunks), n_samples: count(n_samples) })
}

async fn insert(connection: &mut AnyConnection, pieces: &[Piece<'_>]) -> Result<(), StoreError> {
    static INSERT: RowsAtOnce = RowsAtOnce::new(
        "INSERT INTO chunk (session, first_index, n, min_t_s, max_t_s, data) VALUES ",
        6,
        "",
    );
    for part in in_parts(pieces) {
        let mut query = sqlx::query(INSERT.sql(part.len()));
        for Piece { session, first_index, samples, stay } in part {
            let times = || samples.iter().map(|sample| sample.t_s);
            query = query
                .bind(*session)
                .bind(first_index)
                .bind(samples.len() as i64)
                .bind(times().fold(f64::INFINITY, f64::min))
                .bind(times().fold(f64::NEG_INFINITY, f64::max))
                .bind(codec::encode(samples, *stay));
        }
        query.execute(&mut *connection).await?;
    }
    Ok(())
}

/// Makes one run of the small chunks of the `tail`, which are all at the end, and
/// of `run`, and cuts it into full chunks and a rest. Returns the tail that this
/// leaves.
async fn merge(
    connection: &mut AnyConnection,
    run: &Run,
    tail: Tail,
    rest: Stay,
) -> Result<Tail, StoreError> {
    let session = &run.session;
    let small = if tail.n_chunks > 0 { take_small(connection, session).await? } else { vec![] };
    let first_index = small.first().map_or(run.first_index, |(first_index, _)| *first_index);
    let mut samples = decode_all(session, &small)?;
    samples.extend_from_slice(&run.samples);
    let pieces: Vec<_> = cut(session, first_index, &samples, rest).collect();
    insert(connection, &pieces).await?;
    let small = pieces.last().filter(|piece| piece.samples.len() < LONG_CHUNK_SAMPLES);
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
    let mut run = Vec::new();
    for (first_index, data) in chunks {
        run.extend(codec::decode(data).map_err(|source| StoreError::Chunk {
            session: session.to_owned(),
            first_index: *first_index,
            source,
        })?);
    }
    Ok(run)
}
