//! What each command does, a file each; none of them knows another. What two of them share is below: the session, the
//! player of scripts, the log, the checks of `doctor`.
//!
//! - Without a rig: [`solve`], [`lookup`], [`identify`], [`dry_run`], [`replay`], [`export`].
//! - On the emulated board: [`demo`], [`selftest`].
//! - On the emulated board or a real one: [`home`], [`move_to`], [`jog`], [`request`] (stop, hold, clear), [`play`],
//!   [`record`], [`sweep`], [`monitor`], [`status`], [`doctor`], [`config`], [`calibrate`], [`table_board`],
//!   [`serve`].

pub mod calibrate;
pub mod config;
pub mod demo;
pub mod doctor;
pub mod dry_run;
pub mod export;
pub mod home;
pub mod identify;
pub mod jog;
pub mod lookup;
pub mod monitor;
pub mod move_to;
pub mod play;
pub mod record;
pub mod replay;
pub mod request;
pub mod selftest;
pub mod serve;
pub mod solve;
pub mod status;
pub mod sweep;
pub mod table_board;
pub mod track;
