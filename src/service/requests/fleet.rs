//! The fleet overview.

use std::collections::BTreeMap;

use crate::service::asset::LearningRecord;
use crate::service::clock::rfc3339;
use crate::service::{Service, ServiceError, views};
use crate::store::{AssetRow, FaultRow, Micros, SessionRow, WarningRow};
use crate::wire::asset::AssetView;
use crate::wire::service::{FleetEntryView, FleetFaultView, Page, unjudged_view};
use crate::wire::stored::StoredRecord;
use crate::wire::trend::TrendWarningView;

/// The stored data of a page of assets, by asset name.
struct FleetData {
    open: BTreeMap<String, SessionRow>,
    last: BTreeMap<String, Micros>,
    faults: BTreeMap<String, Vec<FleetFaultView>>,
    warnings: BTreeMap<String, Vec<SessionWarnings>>,
    learning: BTreeMap<String, LearningRecord>,
    lost: BTreeMap<String, Micros>,
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
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<FleetEntryView>, ServiceError> {
        let after = cursor.map(views::cursor::<String>).transpose()?.unwrap_or_default();
        let rows = self.inner.handles.store.assets(&after, limit + 1).await?;
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
            warnings: warned.into_iter().flat_map(|warned| warned.warnings).collect(),
            faults: known.faults.remove(&row.name).unwrap_or_default(),
            muted: self.mutes_of(&row.name),
            communication_lost_since: known.lost.remove(&row.name).map(rfc3339),
            calibrated: file.calibration.is_some(),
            learning: learning.state(file.calibration.is_some()),
            session_id: open.as_ref().map(|open| open.id.clone()),
            session: open.map(|open| open.name),
            samples: u64::try_from(progress.n_samples).unwrap_or_default(),
            last_t_s: progress.last_t_s,
            last_seen: seen.map(rfc3339),
            lag_s: presence.as_ref().map(|p| p.lag_s),
            unjudged: presence.and_then(|p| p.unjudged).map(unjudged_view),
            asset: row.name,
        })
    }
}

fn fault(row: FaultRow) -> Result<FleetFaultView, ServiceError> {
    let stored: StoredRecord = views::from_json(&row.record)?;
    Ok(FleetFaultView {
        code: stored.code,
        kind: stored.kind,
        status: views::word(&row.status)?,
        acknowledged: row.acknowledged != 0,
        changed_at: rfc3339(row.changed_at),
    })
}
