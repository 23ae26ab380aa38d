//! The end of an open session's recording: many small chunks, merged into big
//! ones before they become too many.

use std::collections::BTreeMap;

use sqlx::AnyConnection;

use super::{StoreError, codec};
use crate::vocabulary::Sample;

/// Samples in a full chunk; a longer run is cut into several.
pub const FULL_CHUNK_SAMPLES: usize = 8192;

/// Samples in a small chunk at most, so that only a merge makes full ones and
/// all small ones are at the end.
const SMALL_CHUNK_SAMPLES: usize = FULL_CHUNK_SAMPLES / 2;

/// Small chunks at the end of a session; when there are as many, the writer
/// merges them within the transaction at hand.
pub const MAX_TAIL_CHUNKS: usize = 64;

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

    /// Appends `samples` to `session`, the first of them having `first_index`.
    pub(super) async fn append(
        &mut self,
        connection: &mut AnyConnection,
        session: &str,
        first_index: i64,
        samples: &[Sample],
    ) -> Result<(), StoreError> {
        let mut tail = self.tail(connection, session).await?;
        let mut at = first_index;
        for piece in samples.chunks(SMALL_CHUNK_SAMPLES) {
            insert(connection, session, at, piece).await?;
            at += length(piece);
            tail.n_chunks += 1;
            tail.n_samples += piece.len();
        }
        if tail.n_chunks >= MAX_TAIL_CHUNKS || tail.n_samples >= FULL_CHUNK_SAMPLES {
            tail = merge(connection, session).await?;
        }
        self.remember(session, tail);
        Ok(())
    }

    /// Merges what is left: `session` has ended.
    pub(super) async fn finish(
        &mut self,
        connection: &mut AnyConnection,
        session: &str,
    ) -> Result<(), StoreError> {
        self.known.remove(session);
        merge(connection, session).await.map(drop)
    }

    async fn tail(
        &self,
        connection: &mut AnyConnection,
        session: &str,
    ) -> Result<Tail, StoreError> {
        if let Some(tail) = self.known.get(session) {
            return Ok(*tail);
        }
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

    fn remember(&mut self, session: &str, tail: Tail) {
        if self.known.len() >= MAX_REMEMBERED {
            self.known.clear();
        }
        self.known.insert(session.to_owned(), tail);
    }
}

const fn length(samples: &[Sample]) -> i64 {
    samples.len() as i64
}

async fn insert(
    connection: &mut AnyConnection,
    session: &str,
    first_index: i64,
    samples: &[Sample],
) -> Result<(), StoreError> {
    let min = samples.iter().map(|s| s.t_s).fold(f64::INFINITY, f64::min);
    let max = samples.iter().map(|s| s.t_s).fold(f64::NEG_INFINITY, f64::max);
    sqlx::query(
        "INSERT INTO chunk (session, first_index, n, min_t_s, max_t_s, data)
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(session)
    .bind(first_index)
    .bind(length(samples))
    .bind(min)
    .bind(max)
    .bind(codec::encode(samples))
    .execute(connection)
    .await?;
    Ok(())
}

/// Makes one run of the small chunks, which are all at the end, and cuts it
/// into full chunks and a rest. Returns the tail that this leaves.
async fn merge(connection: &mut AnyConnection, session: &str) -> Result<Tail, StoreError> {
    let small: Vec<(i64, Vec<u8>)> = sqlx::query_as(
        "SELECT first_index, data FROM chunk WHERE session = $1 AND n < $2 ORDER BY first_index",
    )
    .bind(session)
    .bind(FULL_CHUNK_SAMPLES as i64)
    .fetch_all(&mut *connection)
    .await?;
    let Some(mut at) = small.first().map(|(first_index, _)| *first_index) else {
        return Ok(Tail::default());
    };
    let run = decode_all(session, &small)?;
    sqlx::query("DELETE FROM chunk WHERE session = $1 AND n < $2")
        .bind(session)
        .bind(FULL_CHUNK_SAMPLES as i64)
        .execute(&mut *connection)
        .await?;
    for piece in run.chunks(FULL_CHUNK_SAMPLES) {
        insert(connection, session, at, piece).await?;
        at += length(piece);
    }
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
