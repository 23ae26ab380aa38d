//! `/fleet`: all rigs at a glance. In a cluster, what only the owner of a rig knows is gathered
//! from the other nodes.

use std::collections::BTreeMap;

use axum::Json;
use axum::extract::State;
use serde::Deserialize;

use super::gather::Gathering;
use super::{Problem, Query, page_limit};
use offbd_service::{FleetQuery, Route, Service};
use offbd_wire::service::{FleetEntryView, FleetView};

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct FleetListQuery {
    /// Only assets whose name begins with this.
    name: Option<String>,
    /// Only assets with, or without, a pending or confirmed fault.
    has_fault: Option<bool>,
    /// Only assets with, or without, an open session.
    has_session: Option<bool>,
    /// Only assets with this tag.
    tag: Option<String>,
    /// `next` of the previous page.
    cursor: Option<String>,
    /// Items per page, 1 to 500; 50 by default.
    #[param(format = Int32, minimum = 1, maximum = 500)]
    limit: Option<u32>,
}

/// Returns an overview of the fleet: for each asset, sorted by name, its open session, when its
/// last telemetry arrived, and its active faults. In a cluster, the nodes that did not answer in
/// time are named, and the entries of their assets are marked as stale.
#[utoipa::path(get, path = "/fleet", tag = "assets", operation_id = "get_fleet",
    params(FleetListQuery),
    responses((status = 200, body = FleetView), (status = 400, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Query(query): Query<FleetListQuery>,
    gathering: Gathering,
) -> Result<Json<FleetView>, Problem> {
    let FleetListQuery { name, has_fault, has_session, tag, cursor, limit } = query;
    let query = FleetQuery { name, has_fault, has_session, tag, cursor };
    let page = service.fleet(query, page_limit(limit)).await?;
    let mut fleet = FleetView { items: page.items, next: page.next, missing_nodes: Vec::new() };
    if gathering.is_needed() {
        complete(&mut fleet, &service, &gathering).await;
    }
    Ok(Json(fleet))
}

/// Replaces the entries of assets of other nodes by what those say.
async fn complete(fleet: &mut FleetView, service: &Service, gathering: &Gathering) {
    let mut entries: BTreeMap<String, BTreeMap<String, FleetEntryView>> = BTreeMap::new();
    for (name, answer) in gathering.ask_all().await {
        match answer {
            Some(FleetView { items, .. }) => {
                let by_asset = items.into_iter().map(|entry| (entry.asset.clone(), entry));
                entries.insert(name, by_asset.collect());
            }
            None => fleet.missing_nodes.push(name),
        }
    }
    for entry in &mut fleet.items {
        let owner = service.route(&entry.asset);
        let found = match &owner {
            Route::Here => continue,
            Route::Nowhere => None,
            Route::Node { name, .. } => {
                entries.get_mut(name).and_then(|known| known.remove(&entry.asset))
            }
        };
        match found {
            Some(found) => *entry = found,
            None => {
                // Nobody knows when its data last arrived.
                entry.stale = true;
                entry.silent = false;
            }
        }
    }
}
