//! The messages to a shard.

use super::actor::Asset;
use super::command::AssetCommand;
use crate::service::ServiceError;

/// A message to a shard.
pub(super) enum ShardMessage {
    /// A command for an asset.
    Command { asset: String, command: AssetCommand },
    /// Loading an asset takes long, because its engine must evaluate a long recording.
    Rebuilding { asset: String, retry_after_s: u64 },
    /// An asset is loaded, or cannot be loaded.
    Loaded { asset: String, result: Box<LoadResult> },
}

/// A loaded asset, or why it cannot be loaded.
pub(super) type LoadResult = Result<Box<Asset>, ServiceError>;
