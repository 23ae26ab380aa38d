//! What the engines of several open sessions take after their last snapshots, read by one
//! query for each table, however many they are.

use std::collections::{BTreeMap, HashMap};

use sqlx::AnyConnection;

use super::query_builder::QueryBuilder;
use super::{ActionRow, RecordingReader, SessionRow, Store, StoreError};

/// What the engine of a session takes from some sample on.
#[derive(Debug)]
pub struct SessionInputs {
    /// All actions of people in the session, in order.
    pub actions: Vec<ActionRow>,
    pub recording: RecordingReader,
    /// The number of transitions of the session.
    pub n_transitions: i64,
}

impl Store {
    /// The inputs of `session` from the sample `first` on. Its recording may be long.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn inputs_of(
        &self,
        session: &SessionRow,
        first: i64,
    ) -> Result<SessionInputs, StoreError> {
        Ok(SessionInputs {
            actions: self.actions(&session.id).await?,
            n_transitions: self.n_transitions(&session.id).await?,
            recording: self.recording(session, first),
        })
    }

    /// The inputs of each of `sessions` from a sample on, with all chunks of their recordings.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails.
    pub async fn session_inputs(
        &self,
        sessions: &[(&SessionRow, i64)],
    ) -> Result<Vec<SessionInputs>, StoreError> {
        if sessions.is_empty() {
            return Ok(Vec::new());
        }
        let ids: Vec<_> = sessions.iter().map(|(session, _)| session.id.clone()).collect();
        let mut db = self.pool.acquire().await?;
        let mut actions = actions(&mut db, &ids).await?;
        let n_transitions = n_transitions(&mut db, &ids).await?;
        let mut chunks = chunks(&mut db, sessions).await?;
        let inputs = |(session, first): &(&SessionRow, i64)| SessionInputs {
            actions: actions.remove(&session.id).unwrap_or_default(),
            n_transitions: n_transitions.get(&session.id).copied().unwrap_or_default(),
            recording: self
                .recording(session, *first)
                .with_chunks(chunks.remove(&session.id).unwrap_or_default()),
        };
        Ok(sessions.iter().map(inputs).collect())
    }
}

async fn actions(
    db: &mut AnyConnection,
    sessions: &[String],
) -> Result<HashMap<String, Vec<ActionRow>>, StoreError> {
    let mut query = QueryBuilder::new("SELECT * FROM action WHERE session IN (");
    query.bind_list(sessions)?.push(") ORDER BY after_index, id");
    let rows: Vec<ActionRow> = query.rows().fetch_all(db).await?;
    let mut actions = HashMap::<_, Vec<_>>::new();
    for row in rows {
        actions.entry(row.session.clone().unwrap_or_default()).or_default().push(row);
    }
    Ok(actions)
}

async fn n_transitions(
    db: &mut AnyConnection,
    sessions: &[String],
) -> Result<HashMap<String, i64>, StoreError> {
    let mut query =
        QueryBuilder::new("SELECT session, COUNT(*) FROM transition WHERE session IN (");
    query.bind_list(sessions)?.push(") GROUP BY session");
    let rows: Vec<(String, i64)> = query.rows().fetch_all(db).await?;
    Ok(rows.into_iter().collect())
}

/// The chunks of each of `sessions` from the one with a given sample on, by their first
/// indexes.
async fn chunks(
    db: &mut AnyConnection,
    sessions: &[(&SessionRow, i64)],
) -> Result<HashMap<String, BTreeMap<i64, Vec<u8>>>, StoreError> {
    let wanted: Vec<_> = sessions.iter().map(|(row, first)| (row.id.clone(), *first)).collect();
    let mut query = QueryBuilder::new("WITH wanted (session, sample) AS (VALUES ");
    query.bind_rows(&wanted)?.push(
        ") SELECT chunk.session, first_index, data FROM
             (SELECT wanted.session, COALESCE((SELECT MAX(first_index) FROM chunk AS earlier
                 WHERE earlier.session = wanted.session AND first_index <= sample), 0) AS first
              FROM wanted) AS needed
         JOIN chunk ON chunk.session = needed.session AND first_index >= needed.first",
    );
    let rows: Vec<(String, i64, Vec<u8>)> = query.rows().fetch_all(db).await?;
    let mut chunks = HashMap::<_, BTreeMap<_, _>>::new();
    for (session, first_index, data) in rows {
        chunks.entry(session).or_default().insert(first_index, data);
    }
    Ok(chunks)
}
