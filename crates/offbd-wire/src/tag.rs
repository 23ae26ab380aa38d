//! The tags of rigs, as the API returns them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The tags of an asset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TagsView {
    /// At most 20 words of 1 to 50 bytes: letters, digits, `-`, `_` and `.`. They are stored in
    /// alphabetical order, each once.
    #[schema(max_items = 20)]
    pub tags: Vec<String>,
}

/// A tag in use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TagUseView {
    pub tag: String,
    /// Number of assets that have it.
    pub assets: u64,
}
