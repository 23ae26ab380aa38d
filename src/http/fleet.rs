//! `/fleet`: all rigs at a glance. In a cluster, what only the owner of a rig knows is gathered
//! from the other nodes.

use std::collections::BTreeMap;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::extract::{OriginalUri, State};
use axum::http::header::{AUTHORIZATION, COOKIE};
use axum::http::{HeaderMap, Request, StatusCode, Uri};
use axum::{Extension, Json};
use futures_util::future::join_all;
use serde::Deserialize;
use tokio::time::timeout;

use super::forward::{Forwarder, is_forwarded};
use super::{Problem, Query, page_limit};
use crate::service::{FleetQuery, Route, Service};
use crate::wire::service::{FleetEntryView, FleetView};

/// Longest wait for the other nodes. Chosen: the page asks every few seconds.
const GATHER_TIMEOUT: Duration = Duration::from_secs(1);

/// Longest answer of another node, bytes: 500 entries, all with faults.
const MAX_ANSWER_BYTES: usize = 16 << 20;

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
    OriginalUri(uri): OriginalUri,
    Extension(forwarder): Extension<Forwarder>,
    headers: HeaderMap,
) -> Result<Json<FleetView>, Problem> {
    let FleetListQuery { name, has_fault, has_session, tag, cursor, limit } = query;
    let query = FleetQuery { name, has_fault, has_session, tag, cursor };
    let page = service.fleet(query, page_limit(limit)).await?;
    let mut fleet = FleetView { items: page.items, next: page.next, missing_nodes: Vec::new() };
    if service.is_node() && !is_forwarded(&service, &headers) {
        let gathering = Gathering { service: &service, forwarder: &forwarder, uri, headers };
        gathering.complete(&mut fleet).await;
    }
    Ok(Json(fleet))
}

/// A question to all other nodes.
struct Gathering<'a> {
    service: &'a Service,
    forwarder: &'a Forwarder,
    uri: Uri,
    /// The headers of the request, with the caller's credentials.
    headers: HeaderMap,
}

impl Gathering<'_> {
    /// Replaces the entries of assets of other nodes by what those say.
    async fn complete(&self, fleet: &mut FleetView) {
        let others = self.service.other_nodes();
        let asked = others.iter().map(async |(name, address)| {
            let answer = timeout(GATHER_TIMEOUT, self.ask(address)).await;
            (name, answer.ok().flatten())
        });
        let mut entries: BTreeMap<&str, BTreeMap<String, FleetEntryView>> = BTreeMap::new();
        for (name, answer) in join_all(asked).await {
            match answer {
                Some(FleetView { items, .. }) => {
                    let by_asset = items.into_iter().map(|entry| (entry.asset.clone(), entry));
                    entries.insert(name, by_asset.collect());
                }
                None => fleet.missing_nodes.push(name.clone()),
            }
        }
        for entry in &mut fleet.items {
            let owner = self.service.route(&entry.asset);
            let found = match &owner {
                Route::Here => continue,
                Route::Nowhere => None,
                Route::Node { name, .. } => {
                    entries.get_mut(name.as_str()).and_then(|known| known.remove(&entry.asset))
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

    /// Asks another node for the same page; `None` if it does not answer as it should.
    async fn ask(&self, address: &str) -> Option<FleetView> {
        let mut request = Request::get(self.uri.clone()).body(Body::empty()).ok()?;
        for name in [AUTHORIZATION, COOKIE] {
            if let Some(value) = self.headers.get(&name) {
                request.headers_mut().insert(name, value.clone());
            }
        }
        let answer = self.forwarder.send(self.service, address, request).await.ok()?;
        if answer.status() != StatusCode::OK {
            return None;
        }
        let bytes = to_bytes(answer.into_body(), MAX_ANSWER_BYTES).await.ok()?;
        serde_json::from_slice(&bytes).ok()
    }
}
