//! `/cluster`: the nodes and their partitions.

use axum::Json;
use axum::extract::State;

use crate::service::Service;
use crate::wire::cluster::ClusterView;

/// Returns the nodes of the cluster that are alive, each with the number of partitions that
/// it owns, as last read from the database by the node that answers. Without a cluster there
/// are no nodes, and one partition.
#[utoipa::path(get, path = "/cluster", tag = "operation", operation_id = "get_cluster",
    responses((status = 200, body = ClusterView)))]
pub(super) async fn get(State(service): State<Service>) -> Json<ClusterView> {
    Json(service.cluster())
}
