//! The tags of rigs.

use crate::{Service, ServiceError, tags, views};
use offbd_store::Write;
use offbd_wire::service::Page;
use offbd_wire::tag::{TagUseView, TagsView};

impl Service {
    /// Returns the tags of an asset, in alphabetical order.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn tags(&self, asset: &str) -> Result<TagsView, ServiceError> {
        self.check_known(asset).await?;
        let mut known = self.inner.handles.store.tags_of([asset]).await?;
        Ok(TagsView { tags: known.remove(asset).unwrap_or_default() })
    }

    /// Replaces the tags of an asset; returns them as they are stored.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Invalid`] with the invalid tag.
    pub async fn put_tags(&self, asset: &str, new: TagsView) -> Result<TagsView, ServiceError> {
        self.check_known(asset).await?;
        let tags = tags::checked(new.tags)?;
        let write = Write::PutTags { asset: asset.to_owned(), tags: tags.clone() };
        self.inner.handles.write(asset, vec![write]).await?;
        Ok(TagsView { tags })
    }

    /// Returns a page of the tags in use, in alphabetical order.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn tags_in_use(
        &self,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<TagUseView>, ServiceError> {
        let after = cursor.map(views::cursor::<String>).transpose()?.unwrap_or_default();
        let rows = self.inner.handles.store.tags_in_use(&after, limit + 1).await?;
        let view = |(tag, n): (String, i64)| {
            Ok(TagUseView { tag, assets: u64::try_from(n).unwrap_or_default() })
        };
        views::page(rows, limit, |(tag, _)| tag.clone(), view)
    }
}
