//! The commands of offbd that work on files alone: they judge, calibrate and convert recordings.

pub mod calibrate;
pub mod drive_cycle;
pub mod export;
pub mod inspect;
pub mod judge;
pub mod recordings;
pub mod replay;
pub mod trends;
