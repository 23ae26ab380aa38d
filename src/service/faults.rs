//! The fault memory, of one asset and of the fleet.

use super::{Service, ServiceError, views};
use crate::store::{ActionKind, FaultFilter, FaultOrder};
use crate::wire::service::{FaultEntryView, MonitorView, Page, monitor_views};
use offbd_core::vocabulary::{FaultCode, Invalid};

/// The statuses that a word of a query stands for; none: all.
fn statuses(word: &str) -> Result<Vec<&'static str>, ServiceError> {
    Ok(match word {
        "active" => vec!["pending", "confirmed"],
        "pending" => vec!["pending"],
        "confirmed" => vec!["confirmed"],
        "healed" => vec!["healed"],
        "cleared" => vec!["cleared"],
        "all" => Vec::new(),
        _ => {
            let expected = "active, pending, confirmed, healed, cleared, all";
            let reason = format!("`{word}` is not one of {expected}");
            return Err(Invalid::new("?status", reason).into());
        }
    })
}

fn order(word: &str) -> Result<FaultOrder, ServiceError> {
    match word {
        "-changed_at" => Ok(FaultOrder::Newest),
        "changed_at" => Ok(FaultOrder::Oldest),
        "asset" => Ok(FaultOrder::Asset),
        _ => {
            let reason = format!("`{word}` is not one of -changed_at, changed_at, asset");
            Err(Invalid::new("?sort", reason).into())
        }
    }
}

fn code(word: &str) -> Result<FaultCode, ServiceError> {
    word.parse().map_err(ServiceError::UnknownCode)
}

fn take(monitors: &mut Vec<MonitorView>, code: &str) -> Option<MonitorView> {
    let at = monitors.iter().position(|monitor| monitor.code == code)?;
    Some(monitors.swap_remove(at))
}

/// What is asked of the fleet's faults, in words.
#[derive(Clone, Debug, Default)]
pub struct FaultQuery {
    /// `active` without one.
    pub status: Option<String>,
    pub asset: Option<String>,
    pub code: Option<String>,
    pub acknowledged: Option<bool>,
    /// `-changed_at` without one.
    pub sort: Option<String>,
    pub cursor: Option<String>,
}

impl Service {
    /// Faults across the fleet.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for a word that is none of those expected.
    pub async fn faults(
        &self,
        query: FaultQuery,
        limit: u32,
    ) -> Result<Page<FaultEntryView>, ServiceError> {
        let filter = FaultFilter {
            statuses: statuses(query.status.as_deref().unwrap_or("active"))?,
            asset: query.asset,
            code: query.code.as_deref().map(code).transpose()?.map(FaultCode::as_str),
            acknowledged: query.acknowledged,
            order: query.sort.as_deref().map(order).transpose()?.unwrap_or_default(),
            after: query.cursor.as_deref().map(views::cursor).transpose()?,
        };
        let rows = self.inner.handles.store.faults(&filter, limit + 1).await?;
        let key =
            |row: &crate::store::FaultRow| (row.changed_at, row.asset.clone(), row.code.clone());
        views::page(rows, limit, key, views::fault)
    }

    /// The faults of one asset, in the order of their codes.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Invalid`] for the status.
    pub async fn asset_faults(
        &self,
        asset: &str,
        status: Option<String>,
    ) -> Result<Page<FaultEntryView>, ServiceError> {
        self.asset(asset).await?;
        let (asset, sort) = (Some(asset.to_owned()), Some("asset".to_owned()));
        let query = FaultQuery { status, asset: asset.clone(), sort, ..FaultQuery::default() };
        let mut page = self.faults(query, FaultCode::COUNT as u32).await?;
        let mut monitors = self.monitors(asset.as_deref().unwrap_or_default()).await;
        for entry in &mut page.items {
            entry.monitor = take(&mut monitors, &entry.record.code);
        }
        Ok(page)
    }

    /// The monitors of the open session, if there is one; none also where the
    /// asset's shard has no time to say.
    async fn monitors(&self, asset: &str) -> Vec<MonitorView> {
        let seen = self.look(asset, |running| {
            running.open.as_ref().map(|open| monitor_views(&open.judging.engine().state()))
        });
        seen.await.ok().flatten().unwrap_or_default()
    }

    /// What is remembered of one code; one that never failed is `cleared`.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`].
    pub async fn fault(&self, asset: &str, word: &str) -> Result<FaultEntryView, ServiceError> {
        let code = code(word)?;
        self.asset(asset).await?;
        let mut entry = match self.inner.handles.store.fault(asset, code.as_str()).await? {
            Some(row) => views::fault(row)?,
            None => views::never_failed(&self.inner.handles.store, asset, code).await?,
        };
        entry.monitor = take(&mut self.monitors(asset).await, code.as_str());
        Ok(entry)
    }

    /// A person clears a code: everything stored of it is erased.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`].
    pub async fn clear(&self, asset: &str, word: &str, actor: String) -> Result<(), ServiceError> {
        let code = code(word)?;
        self.call(asset, move |_, running, work| {
            running.action(ActionKind::Clear, code, actor, work)
        })
        .await
    }

    /// A person acknowledges the current occurrence of a code.
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
        self.call(asset, move |_, running, work| {
            let status = running.current_memory().record(code).status;
            if !status.pending() && !status.confirmed() {
                let (asset, code) = (running.row.name.clone(), code.to_string());
                return Err(ServiceError::NothingToAcknowledge { asset, code });
            }
            running.action(ActionKind::Acknowledge, code, actor, work)
        })
        .await?;
        self.fault(asset, word).await
    }
}
