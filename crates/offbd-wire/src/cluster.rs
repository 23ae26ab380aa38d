//! Views of a cluster.

use serde::Serialize;
use utoipa::ToSchema;

/// The nodes of a cluster and their partitions.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct ClusterView {
    /// The nodes that are alive.
    pub nodes: Vec<NodeView>,
    /// Number of partitions.
    pub partitions: usize,
    /// Partitions without an owner that is alive. Requests about their assets are answered
    /// with 503 until a node has taken them.
    pub unowned: usize,
    /// Where the asset of the query belongs.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub asset: Option<PlaceView>,
}

/// Where an asset belongs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct PlaceView {
    pub partition: u32,
    /// Name of the node that owns it; null if none that is alive does.
    pub owner: Option<String>,
}

/// A node of a cluster.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct NodeView {
    pub name: String,
    /// Where other nodes reach it, `HOST:PORT`.
    pub address: String,
    pub version: String,
    /// Number of partitions that it owns.
    pub partitions: usize,
    /// Whether it hands its partitions over to stop.
    pub leaving: bool,
    /// Whether it is the node that answers.
    pub answering: bool,
}
