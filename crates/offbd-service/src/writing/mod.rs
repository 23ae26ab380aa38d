//! The single writer: changes are submitted through [`Handles`] and committed in groups;
//! committed fault transitions are published as [`Event`]s.

mod commit;
mod events;
mod handles;
mod pace;
mod transfer;
mod write_set;

pub(super) use commit::{Committer, FIRST_RETRY};
pub use events::{Event, EventFeed, EventKind};
pub(super) use events::{Events, line};
pub(super) use handles::Handles;
pub(super) use pace::Pace;
pub(super) use transfer::{TransferRequest, Transfers};
pub(super) use write_set::{EngineGeneration, WriteSet};
