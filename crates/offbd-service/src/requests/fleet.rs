//! The fleet overview.

use std::collections::BTreeMap;

use crate::asset::LearningRecord;
use crate::clock::rfc3339;
use crate::{Service, ServiceError, views};
use offbd_store::{AssetFilter, AssetRow, FaultRow, Micros, SessionRow, TagsByAsset, WarningRow};
use offbd_wire::asset::AssetView;
use offbd_wire::service::{FleetEntryView, FleetFaultView, Page, unjudged_view};
use offbd_wire::stored::{StoredProvenance, StoredRecord};
use offbd_wire::trend::TrendWarningView;

/// Time without a sample after which a rig with an open session counts as silent.
const SILENT_AFTER: Micros = 10_000_000;

/// The parameters of a query for the fleet.
#[derive(Clone, Debug, Default)]
pub struct FleetQuery {
    /// How the name begins.
    pub name: Option<String>,
    /// Whether a fault is pending or confirmed.
    pub has_fault: Option<bool>,
    /// Whether a session is open.
    pub has_session: Option<bool>,
    /// A tag of the asset.
    pub tag: Option<String>,
    pub cursor: Option<String>,
}

/// The stored data of a page of assets, by asset name.
struct FleetData {
    open: BTreeMap<String, SessionRow>,
    last: BTreeMap<String, Micros>,
    faults: BTreeMap<String, Vec<FleetFaultView>>,
    warnings: BTreeMap<String, Vec<SessionWarnings>>,
    learning: BTreeMap<String, LearningRecord>,
    lost: BTreeMap<String, Micros>,
    tags: TagsByAsset,
}

/// The drift warnings of an axis in a session, and the calibration that they refer to.
struct SessionWarnings {
    calibration_id: Option<String>,
    warnings: Vec<TrendWarningView>,
}

impl Service {
    /// Returns a page of overviews of assets, sorted by name.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn fleet(
        &self,
        query: FleetQuery,
        limit: u32,
    ) -> Result<Page<FleetEntryView>, ServiceError> {
        let FleetQuery { name, has_fault, has_session, tag, cursor } = query;
        let after = cursor.as_deref().map(views::cursor::<String>).transpose()?;
        let after = after.unwrap_or_default();
        let filter = AssetFilter { after, name, has_fault, has_session, tag };
        let rows = self.inner.handles.store.assets(&filter, limit + 1).await?;
        let mut known = match (rows.first(), rows.last()) {
            (Some(first), Some(last)) => self.known(&first.name, &last.name).await?,
            _ => return Ok(Page { items: Vec::new(), next: None }),
        };
        views::page(rows, limit, |row| row.name.clone(), |row| self.entry(row, &mut known))
    }

    async fn known(&self, first: &str, last: &str) -> Result<FleetData, ServiceError> {
        let store = &self.inner.handles.store;
        let open = store.open_sessions_of(first, last).await?;
        let mut faults: BTreeMap<String, Vec<FleetFaultView>> = BTreeMap::new();
        for row in store.active_faults_of(first, last).await? {
            faults.entry(row.asset.clone()).or_default().push(fault(row)?);
        }
        let mut warnings: BTreeMap<String, Vec<SessionWarnings>> = BTreeMap::new();
        for WarningRow { asset, calibration_id, warnings: json } in
            store.warnings_of(first, last).await?
        {
            let warned = SessionWarnings { calibration_id, warnings: views::from_json(&json)? };
            warnings.entry(asset).or_default().push(warned);
        }
        let mut learning = BTreeMap::new();
        for (asset, document) in store.learning_of(first, last).await? {
            learning.insert(asset, views::from_json(&document)?);
        }
        Ok(FleetData {
            open: open.into_iter().map(|row| (row.asset.clone(), row)).collect(),
            last: store.last_sessions_of(first, last).await?.into_iter().collect(),
            faults,
            warnings,
            learning,
            tags: store.tags_between(first, last).await?,
            lost: store.lost_communications_of(first, last).await?.into_iter().collect(),
        })
    }

    fn entry(&self, row: AssetRow, known: &mut FleetData) -> Result<FleetEntryView, ServiceError> {
        let file: AssetView = views::from_json(&row.document)?;
        let presence = self.inner.presences.of(&row.name);
        let open = known.open.remove(&row.name);
        let seen = presence.as_ref().map(|p| p.seen_at).or(known.last.remove(&row.name));
        let progress = open.as_ref().map(|open| open.progress).unwrap_or_default();
        let calibration_id = file.calibration.as_ref().map(|c| &c.id);
        let mut warned = known.warnings.remove(&row.name).unwrap_or_default();
        warned.retain(|warned| warned.calibration_id.as_ref() == calibration_id);
        let learning = known.learning.remove(&row.name).unwrap_or_default();
        Ok(FleetEntryView {
            stale: false,
            warnings: warned.into_iter().flat_map(|warned| warned.warnings).collect(),
            faults: known.faults.remove(&row.name).unwrap_or_default(),
            muted: self.mutes_of(&row.name),
            tags: known.tags.remove(&row.name).unwrap_or_default(),
            communication_lost_since: known.lost.remove(&row.name).map(rfc3339),
            calibrated: file.calibration.is_some(),
            learning: learning.state(file.calibration.is_some()),
            session_id: open.as_ref().map(|open| open.id.clone()),
            session: open.as_ref().map(|open| open.name.clone()),
            samples: u64::try_from(progress.n_samples).unwrap_or_default(),
            last_t_s: progress.last_t_s,
            silent: open.is_some() && is_silent(seen, self.inner.handles.clock.now()),
            last_seen: seen.map(rfc3339),
            lag_s: presence.as_ref().and_then(|p| p.lag_s),
            unjudged: presence.and_then(|p| p.unjudged).map(unjudged_view),
            asset: row.name,
        })
    }
}

/// Whether a rig with an open session, whose last sample arrived at `seen_at`, is silent at `now`.
fn is_silent(seen_at: Option<Micros>, now: Micros) -> bool {
    seen_at.is_none_or(|seen_at| now.saturating_sub(seen_at) >= SILENT_AFTER)
}

fn fault(row: FaultRow) -> Result<FleetFaultView, ServiceError> {
    let stored: StoredRecord = views::from_json(&row.record)?;
    let provenance: StoredProvenance = views::from_json(&row.provenance)?;
    let record = stored.record().map_err(ServiceError::corrupt)?;
    Ok(FleetFaultView {
        code: stored.code,
        kind: stored.kind,
        kind_weight: record.suspicion.as_ref().and_then(|suspicion| suspicion.kind_weight()),
        status: views::word(&row.status)?,
        failing: record.status.test_failed(),
        tested: record.status.completed_this_cycle(),
        failed_at: provenance.last_occurrence.map(|occurrence| occurrence.noted_at),
        acknowledged: row.acknowledged != 0,
        changed_at: rfc3339(row.changed_at),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rig_is_silent_ten_seconds_after_its_last_sample() {
        let now = 1_000_000_000;
        assert!(!is_silent(Some(now), now));
        assert!(!is_silent(Some(now - SILENT_AFTER + 1), now));
        assert!(is_silent(Some(now - SILENT_AFTER), now));
        assert!(!is_silent(Some(now + 5), now), "a clock that was set back");
        assert!(is_silent(None, now), "no sample at all");
    }
}
