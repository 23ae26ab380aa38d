//! The settings with which a recording is evaluated again.

use super::{ServiceError, views};
use offbd_core::engine::{Rig, Setup};
use offbd_core::vocabulary::Invalid;
use offbd_store::{Micros, SessionRow, Store};
use offbd_wire::asset::{self, CalibrationView};
use offbd_wire::service::ReplaySettingsView;

/// Calibrations that are read per query in the search for the requested one.
const PAGE: u32 = 64;

/// Returns the calibration that `settings` request.
///
/// # Errors
/// [`ServiceError::Invalid`] if the asset has no such calibration that is done.
pub(super) async fn calibration(
    store: &Store,
    asset: &str,
    settings: &ReplaySettingsView,
) -> Result<Option<CalibrationView>, ServiceError> {
    let Some(id) = &settings.calibration else { return Ok(None) };
    let found = find_calibration(store, asset, id).await?;
    let unknown = || {
        let reason = format!("asset `{asset}` has no completed calibration `{id}`");
        Invalid::new("/calibration", reason)
    };
    Ok(Some(found.ok_or_else(unknown)?))
}

/// Returns the completed calibration of `asset` with `id`, its own or that of its job; `None`
/// if there is none.
pub(super) async fn find_calibration(
    store: &Store,
    asset: &str,
    id: &str,
) -> Result<Option<CalibrationView>, ServiceError> {
    let mut before = None::<(Micros, String)>;
    loop {
        let from = before.as_ref().map(|(made_at, id)| (*made_at, id.as_str()));
        let rows = store.calibrations(asset, from, PAGE).await?;
        let Some(last) = rows.last() else { return Ok(None) };
        before = Some((last.made_at, last.id.clone()));
        for row in &rows {
            let Some(document) = &row.document else { continue };
            let view: CalibrationView = views::from_json(document)?;
            if row.id == id || view.id == id {
                return Ok(Some(view));
            }
        }
    }
}

/// Returns the set-up for a replay of `session`, with the calibration `learnt` if it is not
/// the recorded one.
pub(super) fn setup(
    session: &SessionRow,
    settings: &ReplaySettingsView,
    learnt: Option<&CalibrationView>,
) -> Result<Setup, ServiceError> {
    let mut file = asset::view(&rig(session, settings)?);
    if learnt.is_some() {
        file.calibration = learnt.cloned();
    }
    let diagnostics = file.diagnostics.get_or_insert_default();
    diagnostics.debounce_s = settings.debounce_s.or(diagnostics.debounce_s);
    let rate = &mut diagnostics.false_alarms_per_rig_year;
    *rate = settings.false_alarms_per_rig_year.or(*rate);
    // In the body these settings are at the top level, not in an asset file.
    let top = |e: Invalid| {
        let element = e.element.strip_prefix("/diagnostics").unwrap_or(&e.element).to_owned();
        Invalid::new(element, e.reason)
    };
    Ok(Setup::new(asset::rig(&file).map_err(top)?, settings.profile.map(Into::into))?)
}

fn rig(session: &SessionRow, settings: &ReplaySettingsView) -> Result<Rig, ServiceError> {
    let Some(patch) = &settings.asset else { return views::rig(&session.setup) };
    let mut document: serde_json::Value = views::from_json(&session.setup)?;
    merge(&mut document, patch);
    let bytes = views::to_json(&document)?.into_bytes();
    let within = |e: Invalid| Invalid::new(format!("/asset{}", e.element), e.reason);
    Ok(asset::parse(&bytes).map_err(within)?)
}

/// Applies a JSON merge patch (RFC 7396).
fn merge(target: &mut serde_json::Value, patch: &serde_json::Value) {
    use serde_json::Value;
    let Value::Object(patch) = patch else {
        *target = patch.clone();
        return;
    };
    if !target.is_object() {
        *target = Value::Object(serde_json::Map::new());
    }
    let Value::Object(target) = target else { return };
    for (key, value) in patch {
        if value.is_null() {
            target.remove(key);
        } else {
            merge(target.entry(key.clone()).or_insert(Value::Null), value);
        }
    }
}
