//! The asset as an actor: its commands ([`AssetCommand`]), the threads that execute them
//! ([`Shards`]), and its state: the rig, the fault memory, the open session with the
//! engine, and the progress of its automatic calibration.
//!
//! Nothing here writes to the store: the changes that result from a command are collected
//! in a [`turn::Turn`] and handed to the writer. The reply is sent once they are durable.
//!
//! - `command`, `message`, `shards`, `shard`, `turn`: commands, their queues, the threads, the
//!   execution of a command.
//! - `actor`, `loader`, `load`, `state`: the asset, loading it from the store, queries.
//! - `ingest`, `outcomes`, `sessions`, `session`, `part`, `parts`, `recent`: samples, sessions,
//!   the engine of a session.
//! - `recorded`, `restart`, `ended_session`, `sent_before`: which samples are there already, and when a device
//!   has restarted.
//! - `memory`, `trend`: the fault memory, servo estimates over the sessions.
//! - `learning`, `learning_record`: automatic calibration.
//! - `registry`, `presence`: the asset file, the time of the last telemetry.
//! - `link_health`, `link_tally`: how the samples arrive.

mod actor;
mod command;
mod ended_session;
mod ingest;
mod learning;
mod learning_record;
mod link_health;
mod link_tally;
mod load;
mod loader;
mod memory;
mod message;
mod outcomes;
mod part;
mod parts;
mod presence;
mod recent;
mod recorded;
mod registry;
mod reply;
mod restart;
mod retransmission;
mod sent_before;
mod session;
mod session_rate;
mod sessions;
mod shard;
mod shards;
mod state;
mod trend;
mod turn;

pub(super) use actor::Asset;
pub(super) use command::AssetCommand;
pub(super) use learning::ACTOR as LEARNING_ACTOR;
pub(super) use learning_record::{LearningRecord, MotionSeconds, TrainingSession};
pub(super) use load::stored;
pub(super) use loader::{Loader, MANY_SAMPLES};
pub(super) use presence::Presences;
pub(super) use reply::{Answer, Reply};
pub(super) use shard::Shard;
pub(super) use shards::Shards;
pub(super) use trend::{MAX_ROWS as MAX_TREND_ROWS, TrendPoint, points as trend_points};
pub(super) use turn::Environment;
