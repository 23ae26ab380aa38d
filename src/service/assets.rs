//! The registry of assets.

use tokio::sync::oneshot;

use super::running::Running;
use super::shard::Job;
use super::{Service, ServiceError, settled, views};
use crate::store::{AccessWrite, AssetRow, Write};
use crate::wire::asset::{self, AssetView};
use crate::wire::service::{Page, StateView, WatchView, state_view};
use offbd_core::engine::{Rig, State};
use offbd_core::vocabulary::Invalid;

/// The rig of an asset file. What is no JSON at all is wrong as a whole, not in
/// the element at which reading stopped.
fn parse(document: &[u8]) -> Result<Rig, Invalid> {
    let json = serde_json::from_slice::<serde::de::IgnoredAny>(document);
    json.map_err(|error| Invalid::new("", error.to_string()))?;
    asset::parse(document)
}

fn state_of(asset: &str, running: &Running) -> StateView {
    let not_learnt = running.rig.calibration.is_none();
    let learning = not_learnt.then(|| running.learning_view());
    let Some(open) = &running.open else {
        return StateView { learning, ..state_view(asset, None, &State::default()) };
    };
    let samples = u64::try_from(open.progress.n_samples).unwrap_or_default();
    let session = (open.id.as_str(), open.name.as_str(), samples);
    StateView { learning, ..state_view(asset, Some(session), &open.judging.engine().state()) }
}

impl Service {
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn asset(&self, name: &str) -> Result<AssetView, ServiceError> {
        let row = self.inner.handles.store.asset(name).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: name.to_owned() })?;
        views::from_json(&row.document)
    }

    /// Assets in the order of their names.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for a cursor that is none.
    pub async fn assets(
        &self,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<AssetView>, ServiceError> {
        let after = cursor.map(views::cursor::<String>).transpose()?.unwrap_or_default();
        let rows = self.inner.handles.store.assets(&after, limit + 1).await?;
        views::page(rows, limit, |row| row.name.clone(), |row| views::from_json(&row.document))
    }

    /// Registers an asset.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] naming the element of the asset file;
    /// [`ServiceError::AssetExists`]; [`ServiceError::RegistryFull`].
    pub async fn create_asset(&self, document: &[u8]) -> Result<AssetView, ServiceError> {
        let rig = parse(document)?;
        self.create(&rig).await?;
        Ok(asset::view(&rig))
    }

    async fn create(&self, rig: &Rig) -> Result<(), ServiceError> {
        let limit = self.inner.limits.assets;
        let n_assets = self.inner.handles.store.n_assets().await?;
        if usize::try_from(n_assets).is_ok_and(|n| n >= limit) {
            return Err(ServiceError::RegistryFull { limit });
        }
        let (reply, answer) = oneshot::channel();
        let (name, document) = (rig.name.clone(), views::to_json(&asset::view(rig))?);
        let job: Job = Box::new(move |shard| {
            let row = |at| AssetRow {
                name: name.clone(),
                document,
                revision: 1,
                created_at: at,
                updated_at: at,
            };
            let make =
                |context: &super::Context| Ok(Write::CreateAsset(row(context.handles.clock.now())));
            shard.create(&name, make, reply);
        });
        self.shard(&rig.name).try_send(job).map_err(ServiceError::from_full)?;
        settled(answer.await)
    }

    /// Replaces the asset file of `name`, or registers it; returns it and
    /// whether it is new. An open session goes on with what it began with; the
    /// next one uses the new file.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] naming the element, `/name` if it is another.
    pub async fn put_asset(
        &self,
        name: &str,
        document: &[u8],
    ) -> Result<(AssetView, bool), ServiceError> {
        let rig = parse(document)?;
        if rig.name != name {
            let reason = format!("is `{}`, but the address says `{name}`", rig.name);
            return Err(Invalid::new("/name", reason).into());
        }
        let view = asset::view(&rig);
        match self.replace(rig.clone()).await {
            Ok(()) => Ok((view, false)),
            Err(ServiceError::UnknownAsset { .. }) => {
                self.create(&rig).await?;
                Ok((view, true))
            }
            Err(error) => Err(error),
        }
    }

    async fn replace(&self, rig: Rig) -> Result<(), ServiceError> {
        let name = rig.name.clone();
        self.call(&name, move |context, running, work| {
            running.update(views::to_json(&asset::view(&rig))?, work);
            if running.rig.calibration != rig.calibration {
                // The file's own calibration is none of those on record.
                let (asset, id) = (running.row.name.clone(), String::new());
                work.writes.push(Write::ActivateCalibration { asset, id });
                running.learning.replaced();
            } else if running.rig.calibration.is_none() && running.rig != rig {
                running.learning.described();
            }
            running.rig = rig;
            running.keep_learning(work)?;
            running.learn_if_due(context, work)
        })
        .await
    }

    /// Deletes an asset with its sessions, recordings and faults, and revokes
    /// the tokens of its devices. It is hidden at once; what is stored of it goes in
    /// pieces, also if the caller goes away. Until then its name is taken.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`], also while it is being deleted;
    /// [`ServiceError::NotStored`] if the store does not take a piece: the next sweep
    /// of retention goes on.
    pub async fn delete_asset(&self, name: &str) -> Result<(), ServiceError> {
        let (this, name) = (self.clone(), name.to_owned());
        let deletion = async move {
            let asset = name.clone();
            this.call(&name, move |_, running, work| {
                running.deleted = true;
                let revoke = AccessWrite::RevokeDevices { asset: asset.clone(), at: work.at };
                work.writes.push(Write::GiveUpAsset { name: asset, at: work.at });
                work.writes.push(Write::Access(revoke));
                Ok(())
            })
            .await?;
            this.inner.passes.forget();
            this.inner.deleter.asset(&name).await
        };
        self.to_the_end(deletion).await
    }

    /// Where the twin of `name` stands, samples under way included.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn state(&self, name: &str) -> Result<StateView, ServiceError> {
        let asset = name.to_owned();
        self.look(name, move |running| state_of(&asset, running)).await
    }

    /// The same with what has been judged since the watcher had `seen` so much
    /// of the session `session_id`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn watch(
        &self,
        name: &str,
        session_id: Option<String>,
        seen: u64,
    ) -> Result<WatchView, ServiceError> {
        let asset = name.to_owned();
        self.look(name, move |running| {
            let state = state_of(&asset, running);
            let seen = if state.session_id == session_id { seen } else { 0 };
            let recent = running.open.as_ref().map(|open| open.recent.since(seen));
            let (trace, seen) = recent.unwrap_or_default();
            WatchView { state, trace, seen }
        })
        .await
    }
}
