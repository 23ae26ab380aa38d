//! `/cluster`: the nodes and their partitions.

use axum::Json;
use axum::extract::State;
use serde::Deserialize;

use super::Query;
use offbd_service::Service;
use offbd_wire::cluster::ClusterView;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ClusterQuery {
    /// Name of an asset, which need not exist, to learn where it belongs.
    asset: Option<String>,
}

/// Returns the nodes of the cluster that are alive, each with the number of partitions that
/// it owns, as last read from the database by the node that answers. Without a cluster there
/// are no nodes, and one partition.
#[utoipa::path(get, path = "/cluster", tag = "operation", operation_id = "get_cluster",
    params(ClusterQuery), responses((status = 200, body = ClusterView)))]
pub(super) async fn get(
    State(service): State<Service>,
    Query(query): Query<ClusterQuery>,
) -> Json<ClusterView> {
    if query.asset.is_some() {
        // If the database does not answer, the last look at it has to do.
        let _ = service.confirm_ownership().await;
    }
    Json(service.cluster(query.asset.as_deref()))
}
