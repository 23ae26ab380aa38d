//! The end of an open session's recording: many small chunks, merged into big
//! ones before they become too many.

use std::collections::BTreeMap;

use sqlx::AnyConnection;

use super::codec::Stay;
use super::rows_at_once::{RowsAtOnce, in_parts};
use super::{Progress, StoreError, codec};
use crate::vocabulary::Sample;

/// Samples in a full chunk; a longer run is cut into several.
pub const FULL_CHUNK_SAMPLES: usize = 8192;

/// Samples in a small chunk at most, so that only a merge makes full ones and
/// all small ones are at the end.
const SMALL_CHUNK_SAMPLES: usize = FULL_CHUNK_SAMPLES / 2;

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

    /// Appends each run to its session; a session has one run at most.
    pub(super) async fn append(
        &mut self,
        connection: &mut AnyConnection,
        runs: &[Run],
    ) -> Result<(), StoreError> {
        let pieces: Vec<_> = runs.iter().flat_map(Run::pieces).collect();
        insert(connection, &pieces).await?;
        for run in runs.iter().filter(|run| !run.samples.is_empty()) {
            self.grow(connection, run).await?;
        }
        Ok(())
    }

    /// Takes note of a run that has been inserted; merges what has become too much.
    async fn grow(&mut self, connection: &mut AnyConnection, run: &Run) -> Result<(), StoreError> {
        let mut tail = match self.known.get(&run.session) {
            Some(known) => Tail {
                n_chunks: known.n_chunks + run.samples.len().div_ceil(SMALL_CHUNK_SAMPLES),
                n_samples: known.n_samples + run.samples.len(),
            },
            None => count(connection, &run.session).await?,
        };
        if tail.n_chunks >= MAX_TAIL_CHUNKS || tail.n_samples >= FULL_CHUNK_SAMPLES {
            tail = merge(connection, &run.session, Stay::Short).await?;
        }
        self.remember(&run.session, tail);
        Ok(())
    }

    /// Merges what is left: `session` has ended.
    pub(super) async fn finish(
        &mut self,
        connection: &mut AnyConnection,
        session: &str,
    ) -> Result<(), StoreError> {
        self.known.remove(session);
        merge(connection, session, Stay::Long).await.map(drop)
    }

    fn remember(&mut self, session: &str, tail: Tail) {
        if self.known.len() >= MAX_REMEMBERED {
            self.known.clear();
        }
        self.known.insert(session.to_owned(), tail);
    }
}

/// Samples at the end of a session, and how far it has come with them.
pub(super) struct Run {
    pub(super) session: String,
    pub(super) first_index: i64,
    pub(super) samples: Vec<Sample>,
    pub(super) progress: Progress,
}

impl Run {
    fn pieces(&self) -> impl Iterator<Item = Piece<'_>> {
        cut(&self.session, self.first_index, &self.samples, SMALL_CHUNK_SAMPLES, Stay::Short)
    }
}

/// A chunk that is to be.
struct Piece<'a> {
    session: &'a str,
    first_index: i64,
    samples: &'a [Sample],
    stay: Stay,
}

/// Chunks of at most `most` samples; those that are full stay.
fn cut<'a>(
    session: &'a str,
    first_index: i64,
    samples: &'a [Sample],
    most: usize,
    rest: Stay,
) -> impl Iterator<Item = Piece<'a>> {
    samples.chunks(most).enumerate().map(move |(i, samples)| {
        let stay = if samples.len() == FULL_CHUNK_SAMPLES { Stay::Long } else { rest };
        Piece { session, first_index: first_index + (i * most) as i64, samples, stay }
    })
}

async fn count(connection: &mut AnyConnection, session: &str) -> Result<Tail, StoreError> {
    let (n_chunks, n_samples): (i64, i64) = sqlx::query_as(
        "SELECT COUNT(*), CAST(COALESCE(SUM(n), 0) AS BIGINT) FROM chunk
         WHERE session = $1 AND n < $2",
    )
    .bind(session)
    .bind(FULL_CHUNK_SAMPLES as i64)
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

/// Makes one run of the small chunks, which are all at the end, and cuts it
/// into full chunks and a rest. Returns the tail that this leaves.
async fn merge(
    connection: &mut AnyConnection,
    session: &str,
    rest: Stay,
) -> Result<Tail, StoreError> {
    let small: Vec<(i64, Vec<u8>)> = sqlx::query_as(
        "SELECT first_index, data FROM chunk WHERE session = $1 AND n < $2 ORDER BY first_index",
    )
    .bind(session)
    .bind(FULL_CHUNK_SAMPLES as i64)
    .fetch_all(&mut *connection)
    .await?;
    let Some((first_index, _)) = small.first() else {
        return Ok(Tail::default());
    };
    let run = decode_all(session, &small)?;
    sqlx::query("DELETE FROM chunk WHERE session = $1 AND n < $2")
        .bind(session)
        .bind(FULL_CHUNK_SAMPLES as i64)
        .execute(&mut *connection)
        .await?;
    let pieces: Vec<_> = cut(session, *first_index, &run, FULL_CHUNK_SAMPLES, rest).collect();
    insert(connection, &pieces).await?;
    let n_samples = run.len() % FULL_CHUNK_SAMPLES;
    Ok(Tail { n_chunks: usize::from(n_samples > 0), n_samples })
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
