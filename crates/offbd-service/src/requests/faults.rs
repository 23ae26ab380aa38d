//! The fault memory, of one asset and of the fleet.

use crate::asset::{Asset, AssetCommand};
use crate::clock::rfc3339;
use crate::{Service, ServiceError, snapshots, views};
use offbd_core::vocabulary::FaultCode;
use offbd_store::{FaultFilter, FaultOrder, Micros};
use offbd_wire::service::{FaultEntryView, MonitorView, Page, monitor_views};
use offbd_wire::words::{FaultSort, StatusFilter, StatusWord};

/// Returns the statuses that `filter` selects; an empty list selects all.
fn statuses(filter: StatusFilter) -> Vec<&'static str> {
    match filter {
        StatusFilter::Active => vec![StatusWord::Pending.as_str(), StatusWord::Confirmed.as_str()],
        StatusFilter::All => Vec::new(),
        one => vec![one.as_str()],
    }
}

const fn order(sort: FaultSort) -> FaultOrder {
    match sort {
        FaultSort::Newest => FaultOrder::Newest,
        FaultSort::Oldest => FaultOrder::Oldest,
        FaultSort::Asset => FaultOrder::Asset,
    }
}

fn code(word: &str) -> Result<FaultCode, ServiceError> {
    word.parse().map_err(ServiceError::UnknownCode)
}

/// The monitors of the open session of an asset.
#[derive(Default)]
struct SessionMonitors {
    session_open: bool,
    /// Time at which the last data arrived, if data have stopped during the open session.
    lost_since: Option<Micros>,
    /// Empty without a session, or if none of its states is known.
    monitors: Vec<MonitorView>,
}

impl SessionMonitors {
    /// Adds its monitor to the entry of a fault.
    fn complete(&mut self, entry: &mut FaultEntryView) {
        let is_of_entry = |monitor: &MonitorView| monitor.code == entry.record.code;
        let at = self.monitors.iter().position(is_of_entry);
        entry.monitor = at.map(|at| self.monitors.swap_remove(at));
        entry.session_open = Some(self.session_open);
        entry.communication_lost_since = self.lost_since.map(rfc3339);
    }
}

/// The parameters of a query for faults.
#[derive(Clone, Debug, Default)]
pub struct FaultQuery {
    /// `active` by default.
    pub status: Option<StatusFilter>,
    pub asset: Option<String>,
    pub code: Option<String>,
    pub acknowledged: Option<bool>,
    /// `-changed_at` by default.
    pub sort: Option<FaultSort>,
    pub cursor: Option<String>,
}

impl Service {
    /// Returns a page of the faults of the fleet.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid parameter; [`ServiceError::UnknownAsset`].
    pub async fn faults(
        &self,
        query: FaultQuery,
        limit: u32,
    ) -> Result<Page<FaultEntryView>, ServiceError> {
        self.check_asset(query.asset.as_deref()).await?;
        let filter = FaultFilter {
            statuses: statuses(query.status.unwrap_or(StatusFilter::Active)),
            asset: query.asset,
            code: query.code.as_deref().map(code).transpose()?.map(FaultCode::as_str),
            acknowledged: query.acknowledged,
            order: query.sort.map(order).unwrap_or_default(),
            after: query.cursor.as_deref().map(views::cursor).transpose()?,
            ..FaultFilter::default()
        };
        let rows = self.inner.handles.store.faults(&filter, limit + 1).await?;
        let key =
            |row: &offbd_store::FaultRow| (row.changed_at, row.asset.clone(), row.code.clone());
        views::page(rows, limit, key, views::fault)
    }

    /// Returns the faults of one asset, in the order of their codes.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Invalid`] for an invalid status.
    pub async fn asset_faults(
        &self,
        asset: &str,
        status: Option<StatusFilter>,
    ) -> Result<Page<FaultEntryView>, ServiceError> {
        let (asset, sort) = (Some(asset.to_owned()), Some(FaultSort::Asset));
        let query = FaultQuery { status, asset: asset.clone(), sort, ..FaultQuery::default() };
        let mut page = self.faults(query, FaultCode::COUNT as u32).await?;
        let mut monitors = self.monitors(asset.as_deref().unwrap_or_default()).await?;
        page.items.iter_mut().for_each(|entry| monitors.complete(entry));
        Ok(page)
    }

    /// Returns the monitors of the open session; none without one. Those of an asset that is
    /// not loaded are the ones stored last: a question about a rig does not load its engine.
    ///
    /// # Errors
    /// An answer without the monitors would look complete, so a shard that does not answer is an
    /// error too.
    async fn monitors(&self, asset: &str) -> Result<SessionMonitors, ServiceError> {
        let mut found = match self.inner.shards.look(asset, Asset::monitors).await? {
            Some(monitors) => {
                let session_open = !monitors.is_empty();
                SessionMonitors { session_open, monitors, ..SessionMonitors::default() }
            }
            None => self.stored_monitors(asset).await?,
        };
        let lost = self.inner.handles.store.lost_communications(Some(asset)).await?;
        found.lost_since = lost.first().map(|row| row.since);
        self.show_mutes(asset, &mut found.monitors);
        Ok(found)
    }

    /// Returns the monitors of the open session as its last snapshot has them; none without a
    /// session or a snapshot.
    async fn stored_monitors(&self, asset: &str) -> Result<SessionMonitors, ServiceError> {
        let store = &self.inner.handles.store;
        let Some(session) = store.open_session(asset).await? else {
            return Ok(SessionMonitors::default());
        };
        let snapshot = store.snapshot(&session.id, &snapshots::version(), i64::MAX).await;
        let restored = snapshots::undamaged(snapshot, &session)?;
        let monitors = restored.map(|(_, engine)| monitor_views(&engine.judging.engine().state()));
        let monitors = monitors.unwrap_or_default();
        Ok(SessionMonitors { session_open: true, monitors, ..SessionMonitors::default() })
    }

    /// Returns the fault memory entry of one code; a code that never failed is `cleared`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`].
    pub async fn fault(&self, asset: &str, word: &str) -> Result<FaultEntryView, ServiceError> {
        let code = code(word)?;
        self.check_known(asset).await?;
        let mut entry = match self.inner.handles.store.fault(asset, code.as_str()).await? {
            Some(row) => views::fault(row)?,
            None => views::never_failed(&self.inner.handles.store, asset, code).await?,
        };
        self.monitors(asset).await?.complete(&mut entry);
        Ok(entry)
    }

    /// Erases the fault memory entry of a code on request of a person.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`].
    pub async fn clear(&self, asset: &str, word: &str, actor: String) -> Result<(), ServiceError> {
        let code = code(word)?;
        self.inner.shards.call(asset, |reply| AssetCommand::Clear { code, actor, reply }).await
    }

    /// Acknowledges the current occurrence of a code on request of a person.
    ///
    /// # Errors
    /// As for [`Self::clear`], and [`ServiceError::NothingToAcknowledge`].
    pub async fn acknowledge(
        &self,
        asset: &str,
        word: &str,
        actor: String,
    ) -> Result<FaultEntryView, ServiceError> {
        let code = code(word)?;
        let acknowledge = |reply| AssetCommand::Acknowledge { code, actor, reply };
        self.inner.shards.call(asset, acknowledge).await?;
        self.fault(asset, word).await
    }
}
