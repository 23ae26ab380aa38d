//! The registry of assets.

use crate::asset::{self, Asset, AssetCommand};
use crate::{Edition, Expected, Service, ServiceError, views};
use offbd_core::engine::Rig;
use offbd_core::vocabulary::Invalid;
use offbd_store::AssetFilter;
use offbd_wire::asset::{self as asset_file, AssetView};
use offbd_wire::link::LinkView;
use offbd_wire::service::{Page, StateView, TraceCursor, WatchView};

impl Service {
    /// Returns the asset file of `name`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn asset(&self, name: &str) -> Result<AssetView, ServiceError> {
        let row = self.inner.handles.store.asset(name).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: name.to_owned() })?;
        views::from_json(&row.document)
    }

    /// Returns the asset file of `name` with the tag of its edition.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn asset_edition(&self, name: &str) -> Result<Edition<AssetView>, ServiceError> {
        Edition::of(self.asset(name).await?)
    }

    /// Checks that there is an asset `name`, without reading its file.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn check_known(&self, name: &str) -> Result<(), ServiceError> {
        let name = [name.to_owned()];
        if self.existing_assets(&name).await?.is_empty() {
            let [name] = name;
            return Err(ServiceError::UnknownAsset { name });
        }
        Ok(())
    }

    /// Returns those of `names` that are assets.
    ///
    /// # Errors
    /// [`ServiceError::Store`].
    pub async fn existing_assets(&self, names: &[String]) -> Result<Vec<String>, ServiceError> {
        Ok(self.inner.handles.store.existing_assets(names).await?)
    }

    /// Returns a page of asset files, sorted by name, of the assets whose name begins with
    /// `name`.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn assets(
        &self,
        name: Option<String>,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<AssetView>, ServiceError> {
        let after = cursor.map(views::cursor::<String>).transpose()?.unwrap_or_default();
        let filter = AssetFilter { after, name, ..AssetFilter::default() };
        let rows = self.inner.handles.store.assets(&filter, limit + 1).await?;
        views::page(rows, limit, |row| row.name.clone(), |row| views::from_json(&row.document))
    }

    /// Registers an asset.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with the invalid element of the asset file;
    /// [`ServiceError::AssetExists`]; [`ServiceError::RegistryFull`].
    pub async fn create_asset(&self, document: &[u8]) -> Result<Edition<AssetView>, ServiceError> {
        let rig = asset_file::parse_new(document)?;
        self.create(&rig).await?;
        Edition::of(asset_file::view(&rig))
    }

    async fn create(&self, rig: &Rig) -> Result<(), ServiceError> {
        self.inner.quota.claim(|| self.inner.handles.store.n_assets()).await?;
        let document = views::to_json(&asset_file::view(rig))?;
        self.inner.shards.call(&rig.name, |reply| AssetCommand::Create { document, reply }).await
    }

    /// Replaces the asset file of `name`, or registers the asset; returns the file and
    /// whether the asset is new. An open session keeps the file that it started with; the
    /// next one uses the new file.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with the invalid element, `/name` if it differs from
    /// `name`; [`ServiceError::Changed`] if the present file is not the expected one.
    pub async fn put_asset(
        &self,
        name: &str,
        document: &[u8],
        expected: &Expected,
    ) -> Result<(Edition<AssetView>, bool), ServiceError> {
        let rig = asset_file::parse_new(document)?;
        if rig.name != name {
            let reason = format!("`{}` differs from `{name}` in the path", rig.name);
            return Err(Invalid::new("/name", reason).into());
        }
        let edition = Edition::of(asset_file::view(&rig))?;
        let replace = |reply| {
            let (rig, expected) = (Box::new(rig.clone()), expected.clone());
            AssetCommand::Replace { rig, expected, reply }
        };
        match self.inner.shards.call(name, replace).await {
            Ok(()) => Ok((edition, false)),
            Err(ServiceError::UnknownAsset { .. }) => {
                expected.check(None)?;
                self.create(&rig).await?;
                Ok((edition, true))
            }
            Err(error) => Err(error),
        }
    }

    /// Deletes an asset with its sessions, recordings and faults, and revokes the tokens
    /// of its devices. The asset is hidden immediately; its data are deleted in parts, even
    /// if the caller is dropped. Its name cannot be used again before the deletion is
    /// complete.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`], also while it is being deleted;
    /// [`ServiceError::Changed`] if its file is not the expected one;
    /// [`ServiceError::NotStored`] if the store does not accept a part; the next sweep of
    /// retention continues the deletion.
    pub async fn delete_asset(&self, name: &str, expected: Expected) -> Result<(), ServiceError> {
        let (this, name) = (self.clone(), name.to_owned());
        let deletion = async move {
            let delete = |reply| AssetCommand::Delete { expected, reply };
            this.inner.shards.call(&name, delete).await?;
            this.inner.principals.clear();
            this.inner.mutes.remove_asset(&name);
            this.inner.deleter.asset(&name).await
        };
        self.inner.deleter.run_to_completion(deletion).await
    }

    /// Returns what `look` sees of the asset `name`: as it is now or, if it is not loaded, as it
    /// was stored last. A question about a rig does not load its engine.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; those of [`Shards::look`](crate::asset::Shards::look).
    pub(super) async fn look<T: Send + 'static>(
        &self,
        name: &str,
        look: impl Fn(&Asset) -> T + Copy + Send + 'static,
    ) -> Result<T, ServiceError> {
        match self.inner.shards.look(name, look).await? {
            Some(seen) => Ok(seen),
            None => Ok(look(&asset::stored(&self.inner.handles.store, name).await?)),
        }
    }

    /// Returns the state of the twin of `name`, including samples that are not durable yet; the
    /// last stored state if it is not loaded.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn state(&self, name: &str) -> Result<StateView, ServiceError> {
        Ok(self.with_mutes(self.look(name, Asset::state).await?))
    }

    /// Returns how the samples of `name` arrive.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn link(&self, name: &str) -> Result<LinkView, ServiceError> {
        let now = self.inner.handles.clock.now();
        self.look(name, move |asset| asset.link(now)).await
    }

    /// Returns the state of the twin and, with the cursor of a trace, the trace after it; `None`
    /// if the asset is not loaded.
    ///
    /// # Errors
    /// [`ServiceError::Busy`], [`ServiceError::Moving`] or [`ServiceError::Unavailable`] if the
    /// shard of the asset does not answer.
    pub async fn watch(
        &self,
        name: &str,
        cursor: Option<TraceCursor>,
    ) -> Result<Option<WatchView>, ServiceError> {
        let view = self.inner.shards.look(name, |asset| asset.watch(cursor)).await?;
        Ok(view.map(|view| WatchView { state: self.with_mutes(view.state), ..view }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Clock, Limits};
    use offbd_store::{AssetRow, ChangeSet, Location, Store, Write};

    /// An answer from the store alone would look as if the rig were not running.
    #[tokio::test]
    async fn a_shard_that_does_not_answer_is_an_error() {
        let data = tempfile::tempdir().unwrap();
        let location = Location::File(data.path().join("offbd.sqlite"));
        let (store, mut writer) = Store::open(&location).await.unwrap();
        let document = views::to_json(&asset_file::view(&Rig::chapter("a"))).unwrap();
        let row = AssetRow { name: "a".to_owned(), document, ..AssetRow::default() };
        let mut set = vec![Write::CreateAsset(row)];
        writer.commit(&mut [ChangeSet::unpartitioned(&mut set)]).await.unwrap();
        let (service, parts) =
            Service::assemble(store, writer, Limits::default(), None, None, Clock::System);
        service.asset("a").await.unwrap();
        drop(parts.shards);
        let refused = [
            service.state("a").await.map(drop),
            service.link("a").await.map(drop),
            service.learning("a").await.map(drop),
            service.watch("a", None).await.map(drop),
            service.asset_faults("a", None).await.map(drop),
            service.fault("a", "x_servo").await.map(drop),
        ];
        for refused in refused {
            assert!(matches!(refused, Err(ServiceError::Unavailable { .. })), "{refused:?}");
        }
    }
}
