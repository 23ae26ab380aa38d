//! The messages to a shard.

use std::sync::Arc;

use super::actor::Asset;
use tokio::sync::oneshot;

use super::command::AssetCommand;
use crate::ServiceError;
use offbd_store::PartitionId;

/// A message to a shard.
pub(super) enum ShardMessage {
    /// A command for an asset.
    Command { asset: String, command: AssetCommand },
    /// Loading an asset takes long, because its engine must evaluate a long recording.
    Rebuilding { asset: String, retry_after_s: u64 },
    /// An asset is loaded, or cannot be loaded, as of this epoch of its partition.
    Loaded { asset: String, epoch: i64, result: Box<LoadResult> },
    /// Drop the engines of these partitions. If the partitions were `lost`, changes of the
    /// engines that are not committed yet are refused.
    Release { partitions: Arc<[PartitionId]>, lost: bool, done: oneshot::Sender<()> },
}

/// A loaded asset, or why it cannot be loaded.
pub(super) type LoadResult = Result<Box<Asset>, ServiceError>;
