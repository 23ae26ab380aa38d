//! The registry of assets.

use crate::asset::AssetCommand;
use crate::{Service, ServiceError, views};
use offbd_core::engine::Rig;
use offbd_core::vocabulary::Invalid;
use offbd_store::AssetFilter;
use offbd_wire::asset::{self, AssetView};
use offbd_wire::link::LinkView;
use offbd_wire::service::{Page, StateView, WatchView};

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
    pub async fn create_asset(&self, document: &[u8]) -> Result<AssetView, ServiceError> {
        let rig = asset::parse(document)?;
        self.create(&rig).await?;
        Ok(asset::view(&rig))
    }

    async fn create(&self, rig: &Rig) -> Result<(), ServiceError> {
        self.inner.quota.claim(|| self.inner.handles.store.n_assets()).await?;
        let document = views::to_json(&asset::view(rig))?;
        self.inner.shards.call(&rig.name, |reply| AssetCommand::Create { document, reply }).await
    }

    /// Replaces the asset file of `name`, or registers the asset; returns the file and
    /// whether the asset is new. An open session keeps the file that it started with; the
    /// next one uses the new file.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with the invalid element, `/name` if it differs from
    /// `name`.
    pub async fn put_asset(
        &self,
        name: &str,
        document: &[u8],
    ) -> Result<(AssetView, bool), ServiceError> {
        let rig = asset::parse(document)?;
        if rig.name != name {
            let reason = format!("`{}` differs from `{name}` in the path", rig.name);
            return Err(Invalid::new("/name", reason).into());
        }
        let view = asset::view(&rig);
        let replace = |reply| AssetCommand::Replace { rig: Box::new(rig.clone()), reply };
        match self.inner.shards.call(name, replace).await {
            Ok(()) => Ok((view, false)),
            Err(ServiceError::UnknownAsset { .. }) => {
                self.create(&rig).await?;
                Ok((view, true))
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
    /// [`ServiceError::NotStored`] if the store does not accept a part; the next sweep of
    /// retention continues the deletion.
    pub async fn delete_asset(&self, name: &str) -> Result<(), ServiceError> {
        let (this, name) = (self.clone(), name.to_owned());
        let deletion = async move {
            this.inner.shards.call(&name, |reply| AssetCommand::Delete { reply }).await?;
            this.inner.principals.clear();
            this.inner.mutes.remove_asset(&name);
            this.inner.deleter.asset(&name).await
        };
        self.inner.deleter.run_to_completion(deletion).await
    }

    /// Returns the state of the twin of `name`, including samples that are not durable yet.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn state(&self, name: &str) -> Result<StateView, ServiceError> {
        let state = self.inner.shards.call(name, |reply| AssetCommand::State { reply }).await?;
        Ok(self.with_mutes(state))
    }

    /// Returns how the samples of `name` arrive.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn link(&self, name: &str) -> Result<LinkView, ServiceError> {
        self.inner.shards.call(name, |reply| AssetCommand::Link { reply }).await
    }

    /// Returns the state of the twin, and the trace after the first `seen` points of the
    /// session with the id `session`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn watch(
        &self,
        name: &str,
        session: Option<String>,
        seen: u64,
    ) -> Result<WatchView, ServiceError> {
        let watch = |reply| AssetCommand::Watch { session, seen, reply };
        let view = self.inner.shards.call(name, watch).await?;
        Ok(WatchView { state: self.with_mutes(view.state), ..view })
    }
}
