//! The configuration of a node of a cluster.

use std::net::SocketAddr;

use super::{ConfigError, within};
use offbd_store::{Location, MAX_PARTITIONS, NodeIdentity, Partitions};

/// Number of partitions without a setting. Chosen: several for each node of a cluster as
/// large as one database supports.
const PARTITIONS: usize = 64;

section! {
    /// A node of a cluster. All nodes use one PostgreSQL database.
    pub struct ClusterConfig {
        /// Name of the node, unique in the cluster: 1 to 64 letters, digits, `-`, `_` and `.`. A
        /// node that restarts with the same name gets the same partitions again.
        pub name: String,
        /// Address for the other nodes. Not encrypted: use a private network.
        pub listen: SocketAddr,
        /// Address at which they reach the node, `HOST:PORT`; by default `cluster.listen`.
        /// Required if that is an unspecified address such as 0.0.0.0.
        pub advertise: Option<String>,
        /// Number of partitions, the same for all nodes; fixed by the first start.
        #[serde(default = "partitions")]
        pub partitions: usize,
    }
}

const fn partitions() -> usize {
    PARTITIONS
}

impl ClusterConfig {
    /// The number of partitions.
    #[must_use]
    pub fn partitions(&self) -> Partitions {
        Partitions::new(u32::try_from(self.partitions).unwrap_or(MAX_PARTITIONS))
    }

    /// The identity of this start of the node, with the address that it listens on.
    #[must_use]
    pub fn identity(&self, listening: SocketAddr) -> NodeIdentity {
        NodeIdentity {
            id: uuid::Uuid::now_v7().to_string(),
            name: self.name.clone(),
            address: self.advertise.clone().unwrap_or_else(|| listening.to_string()),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    pub(super) fn check(&self, location: &Location) -> Result<(), ConfigError> {
        let invalid = |key, reason: &str| Err(ConfigError::Invalid { key, reason: reason.into() });
        if location.file().is_some() {
            let reason = "needs a PostgreSQL database that all nodes share: set `database`";
            return invalid("cluster", reason);
        }
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if self.name.is_empty() || self.name.len() > 64 || !self.name.chars().all(is_plain) {
            let reason = "must be 1 to 64 letters, digits, `-`, `_` and `.`";
            return invalid("cluster.name", reason);
        }
        let is_authority = |text: &String| text.parse::<hyper::http::uri::Authority>().is_ok();
        if !self.advertise.iter().all(is_authority) {
            return invalid("cluster.advertise", "is not HOST:PORT");
        }
        if self.advertise.is_none() && self.listen.ip().is_unspecified() {
            let reason = "is missing, and other nodes cannot connect to the address of \
                          `cluster.listen`";
            return invalid("cluster.advertise", reason);
        }
        within("cluster.partitions", self.partitions, 1, MAX_PARTITIONS as usize)
    }
}
