//! The formats of the API and of files: asset files, session files, telemetry batches, verdict
//! lines; and the judgement of one session.
//!
//! Parsing has two stages: a document becomes a *view*, which is only checked for syntax,
//! and the view becomes a domain value, whose constructor checks everything else. Views
//! implement `Serialize`, domain types do not; conversions are written by hand. Nothing
//! here uses sockets or SQL.

#![cfg_attr(
    not(all(feature = "mcap", feature = "parquet", feature = "xlsx")),
    allow(
        dead_code,
        unused_imports,
        unused_variables,
        reason = "what only the formats left out use"
    )
)]

pub mod access;
pub mod advice;
pub mod alarm;
pub mod asset;
pub mod basis;
pub mod bus;
pub mod certificate;
pub mod cluster;
pub mod difference;
pub mod drive_cycle;
mod fault_kind;
pub mod fmu;
pub mod foreign_file;
pub mod inspection;
pub mod json;
pub mod judging;
pub mod learning;
pub mod link;
pub mod mapping;
pub mod memory;
pub mod notification;
pub mod problem;
pub mod provenance;
pub mod recording;
pub mod remark;
pub mod series;
pub mod service;
pub mod session_csv;
pub mod session_file;
pub mod sovd;
pub mod stored;
pub mod table;
pub mod tag;
pub mod telemetry;
pub mod trace;
pub mod trend;
pub mod trial;
pub mod verdict;
pub mod words;
