//! Deletions of chunks: how many one transaction has, and some that the database refuses.

use std::path::Path;

use sqlx::{AssertSqlSafe, Executor};

use super::{connection, on_postgres, url};

async fn store(data: &Path) -> sqlx::AnyConnection {
    connection(&url(data)).await
}

/// Makes the database record the commit that deletes each chunk.
pub async fn record_deletions(data: &Path) {
    let note = "INSERT INTO gone SELECT n_commits FROM partition";
    let words = if on_postgres() {
        format!(
            "CREATE TABLE gone (at BIGINT);
             CREATE FUNCTION note() RETURNS trigger LANGUAGE plpgsql AS
             $$BEGIN {note}; RETURN OLD; END$$;
             CREATE TRIGGER noted BEFORE DELETE ON chunk FOR EACH ROW EXECUTE FUNCTION note()"
        )
    } else {
        format!(
            "CREATE TABLE gone (at BIGINT);
             CREATE TRIGGER noted BEFORE DELETE ON chunk BEGIN {note}; END"
        )
    };
    store(data).await.execute(AssertSqlSafe(words)).await.unwrap();
}

/// The number of chunks deleted since, and the largest number in one transaction.
pub async fn deletions(data: &Path) -> (i64, i64) {
    let sql = "SELECT CAST(COALESCE(SUM(n), 0) AS BIGINT), COALESCE(MAX(n), 0)
               FROM (SELECT COUNT(*) AS n FROM gone GROUP BY at) AS together";
    sqlx::query_as(sql).fetch_one(&mut store(data).await).await.unwrap()
}

/// Makes the database reject the deletion of the chunks that begin with the sample
/// `first_index`.
pub async fn block_deletion(data: &Path, first_index: i64) {
    let words = if on_postgres() {
        format!(
            "CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS
             'BEGIN RAISE ''stuck'' USING ERRCODE = ''23514''; END';
             CREATE TRIGGER stuck BEFORE DELETE ON chunk FOR EACH ROW
             WHEN (OLD.first_index = {first_index}) EXECUTE FUNCTION refuse()"
        )
    } else {
        format!(
            "CREATE TRIGGER stuck BEFORE DELETE ON chunk WHEN OLD.first_index = {first_index}
             BEGIN SELECT RAISE(ABORT, 'stuck'); END"
        )
    };
    store(data).await.execute(AssertSqlSafe(words)).await.unwrap();
}

pub async fn unblock_deletion(data: &Path) {
    let on = if on_postgres() { " ON chunk" } else { "" };
    let words = format!("DROP TRIGGER stuck{on}");
    store(data).await.execute(AssertSqlSafe(words)).await.unwrap();
}
