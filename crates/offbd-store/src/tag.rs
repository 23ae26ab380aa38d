//! The table of the rigs' tags.

use std::collections::BTreeMap;

use sqlx::AnyConnection;

use super::execute::execute;
use super::query_builder::QueryBuilder;
use super::{Store, StoreError};

/// The tags of assets, by the asset's name, each in alphabetical order.
pub type TagsByAsset = BTreeMap<String, Vec<String>>;

/// Replaces the tags of an asset; nothing happens if it is being deleted.
pub(super) async fn put(
    db: &mut AnyConnection,
    asset: &str,
    tags: &[String],
) -> Result<(), StoreError> {
    execute!(&mut *db, "DELETE FROM tag WHERE asset = $1"; asset)?;
    for tag in tags {
        execute!(
            &mut *db, "INSERT INTO tag (asset, name)
             SELECT name, $2 FROM asset WHERE name = $1 AND deleted_at IS NULL";
            asset, tag
        )?;
    }
    Ok(())
}

/// The tags of an asset, in alphabetical order, as the writer sees them.
pub(super) async fn of(db: &mut AnyConnection, asset: &str) -> Result<Vec<String>, StoreError> {
    let tags = sqlx::query_scalar("SELECT name FROM tag WHERE asset = $1").bind(asset);
    let mut tags: Vec<String> = tags.fetch_all(db).await?;
    tags.sort();
    Ok(tags)
}

impl QueryBuilder {
    /// Appends the condition that the asset named in `column` has a tag; nothing without one.
    /// `column` is constant SQL.
    pub(super) fn push_tagged(
        &mut self,
        column: &'static str,
        tag: Option<&str>,
    ) -> Result<&mut Self, StoreError> {
        let Some(tag) = tag else { return Ok(self) };
        self.push(" AND ").push(column);
        self.push(" IN (SELECT tag.asset FROM tag WHERE tag.name = ").bind(tag.to_owned())?;
        Ok(self.push(")"))
    }
}

fn grouped(rows: Vec<(String, String)>) -> TagsByAsset {
    let mut tags = TagsByAsset::new();
    for (asset, tag) in rows {
        tags.entry(asset).or_default().push(tag);
    }
    // Not by the database, whose order depends on its collation.
    tags.values_mut().for_each(|tags| tags.sort());
    tags
}

impl Store {
    /// The tags of the assets from `first` to `last`.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn tags_between(&self, first: &str, last: &str) -> Result<TagsByAsset, StoreError> {
        let rows = sqlx::query_as("SELECT asset, name FROM tag WHERE asset >= $1 AND asset <= $2");
        Ok(grouped(rows.bind(first).bind(last).fetch_all(&self.pool).await?))
    }

    /// The tags of each of `assets` that has some.
    pub async fn tags_of<'a>(
        &self,
        assets: impl IntoIterator<Item = &'a str>,
    ) -> Result<TagsByAsset, StoreError> {
        let mut query = QueryBuilder::new("SELECT asset, name FROM tag WHERE asset IN (''");
        for asset in assets {
            query.push(", ").bind(asset.to_owned())?;
        }
        query.push(")");
        Ok(grouped(query.rows().fetch_all(&self.pool).await?))
    }

    /// The tags in use after the tag `after`, in alphabetical order, each with the number of
    /// its assets; at most `limit`.
    pub async fn tags_in_use(
        &self,
        after: &str,
        limit: u32,
    ) -> Result<Vec<(String, i64)>, StoreError> {
        let rows = sqlx::query_as(
            "SELECT tag.name, COUNT(*) FROM tag JOIN asset ON asset.name = tag.asset
             WHERE tag.name > $1 AND asset.deleted_at IS NULL
             GROUP BY tag.name ORDER BY tag.name LIMIT $2",
        );
        Ok(rows.bind(after).bind(i64::from(limit)).fetch_all(&self.pool).await?)
    }
}
