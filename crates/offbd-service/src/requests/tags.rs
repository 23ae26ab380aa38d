//! The tags of rigs.

use crate::{Edition, Expected, Service, ServiceError, tags, views};
use offbd_store::{EditWrite, Expectation, Write};
use offbd_wire::service::Page;
use offbd_wire::tag::{TagUseView, TagsView};

impl Service {
    /// Returns the tags of an asset, in alphabetical order.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn tags(&self, asset: &str) -> Result<Edition<TagsView>, ServiceError> {
        self.check_known(asset).await?;
        let mut known = self.inner.handles.store.tags_of([asset]).await?;
        Edition::of(TagsView { tags: known.remove(asset).unwrap_or_default() })
    }

    /// Replaces the tags of an asset; returns them as they are stored.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Invalid`] with the invalid tag;
    /// [`ServiceError::Changed`] if the present tags are not the expected ones.
    pub async fn put_tags(
        &self,
        asset: &str,
        new: TagsView,
        expected: &Expected,
    ) -> Result<Edition<TagsView>, ServiceError> {
        let found = self.tags(asset).await?;
        expected.check(Some(&found.tag))?;
        let tags = tags::checked(new.tags)?;
        let (asset, new) = (asset.to_owned(), TagsView { tags: tags.clone() });
        if expected.is_particular() {
            let unchanged = Expectation::Tags { asset: asset.clone(), tags: found.value.tags };
            let edit = EditWrite::Tags { asset: asset.clone(), tags };
            if !self.inner.handles.edit(Some(&asset), unchanged, edit).await? {
                return Err(ServiceError::Changed { now: Some(self.tags(&asset).await?.tag) });
            }
        } else {
            let write = Write::PutTags { asset: asset.clone(), tags };
            self.inner.handles.write(&asset, vec![write]).await?;
        }
        Edition::of(new)
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
