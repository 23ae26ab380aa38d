//! Who commits what: triggers in the database that note each change, with its transaction. What
//! is rolled back is not noted.

use sqlx::Executor;

use crate::support::connection;

/// Notes each change of a partition, and each change of something that belongs to a partition.
const INSTALL: &str = "LOCK TABLE partition;
CREATE TABLE noted_count (n BIGSERIAL, tx BIGINT, partition BIGINT, epoch BIGINT,
    n_commits BIGINT, owner TEXT, writer TEXT);
CREATE TABLE noted_change (n BIGSERIAL, tx BIGINT, partition BIGINT, place TEXT);
CREATE FUNCTION note_count() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
    INSERT INTO noted_count (tx, partition, epoch, n_commits, owner, writer)
    VALUES (txid_current(), NEW.id, NEW.epoch, NEW.n_commits, COALESCE(NEW.owner, ''),
        COALESCE((SELECT MAX(id) FROM node WHERE pid = pg_backend_pid()), ''));
    RETURN NULL; END $$;
CREATE FUNCTION note_row() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
    INSERT INTO noted_change (tx, partition, place)
    VALUES (txid_current(), NEW.id >> 48, 'journal row ' || NEW.id);
    RETURN NULL; END $$;
CREATE FUNCTION note_change() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN
    INSERT INTO noted_change (tx, partition, place)
    SELECT txid_current(), partition, TG_TABLE_NAME || ' of ' || name FROM asset
    WHERE name = NEW.asset;
    RETURN NULL; END $$;
CREATE TRIGGER note AFTER UPDATE ON partition FOR EACH ROW
    WHEN (OLD.* IS DISTINCT FROM NEW.*) EXECUTE FUNCTION note_count();
CREATE TRIGGER note AFTER INSERT ON journal FOR EACH ROW EXECUTE FUNCTION note_row();
CREATE TRIGGER note AFTER INSERT OR UPDATE ON session FOR EACH ROW EXECUTE FUNCTION note_change();
CREATE TRIGGER note AFTER INSERT ON transition FOR EACH ROW EXECUTE FUNCTION note_change();
CREATE TRIGGER note AFTER INSERT ON action FOR EACH ROW EXECUTE FUNCTION note_change();
CREATE TRIGGER note AFTER INSERT OR UPDATE ON fault FOR EACH ROW EXECUTE FUNCTION note_change();
INSERT INTO noted_count (tx, partition, epoch, n_commits, owner, writer)
    SELECT 0, id, epoch, n_commits, COALESCE(owner, ''), '' FROM partition;";

/// A partition after a change of it.
#[derive(Clone, Debug)]
pub struct NotedCount {
    pub tx: i64,
    pub partition: i64,
    pub epoch: i64,
    pub n_commits: i64,
    /// Id of the node that owns it; empty if none does.
    pub owner: String,
    /// Id of the node that has changed it.
    pub writer: String,
}

/// A change of something that belongs to a partition.
#[derive(Clone, Debug)]
pub struct NotedChange {
    pub tx: i64,
    pub partition: i64,
    pub place: String,
}

/// What was committed, in the order of the commits of each partition.
#[derive(Clone, Debug, Default)]
pub struct CommitLog {
    pub counts: Vec<NotedCount>,
    pub changes: Vec<NotedChange>,
}

impl CommitLog {
    /// Begins to note what is committed to the database at `url`.
    pub async fn install(url: &str) {
        connection(url).await.execute(INSTALL).await.unwrap();
    }

    pub async fn read(url: &str) -> Self {
        let mut store = connection(url).await;
        let counts = "SELECT tx, partition, epoch, n_commits, owner, writer FROM noted_count
                      ORDER BY n";
        let counts: Vec<(i64, i64, i64, i64, String, String)> =
            sqlx::query_as(counts).fetch_all(&mut store).await.unwrap();
        let counts = counts.into_iter().map(|(tx, partition, epoch, n_commits, owner, writer)| {
            NotedCount { tx, partition, epoch, n_commits, owner, writer }
        });
        let changes = "SELECT tx, partition, place FROM noted_change ORDER BY n";
        let changes: Vec<(i64, i64, String)> =
            sqlx::query_as(changes).fetch_all(&mut store).await.unwrap();
        let changes =
            changes.into_iter().map(|(tx, partition, place)| NotedChange { tx, partition, place });
        Self { counts: counts.collect(), changes: changes.collect() }
    }
}
