//! What each command does, a file each; none of them knows another. What two of them share is below: the session, the
//! player of scripts, the log, the checks of `doctor`.
//!
//! - Without a rig: [`solve`], [`lookup`], [`identify`], `dry_run` (`move --dry-run`), [`replay`], [`export`].
//! - On the emulated board: [`demo`], [`selftest`].
//! - On the emulated board or a real one: [`motion`] (home, move, track, jog, stop, clear), [`play`] (play, record), [`sweep`],
//!   [`monitor`], [`status`], [`doctor`], [`config`], [`calibrate`], [`table`], [`serve`].

pub mod calibrate;
pub mod config;
pub mod demo;
pub mod doctor;
mod dry_run;
pub mod export;
pub mod identify;
pub mod lookup;
pub mod monitor;
pub mod motion;
pub mod play;
pub mod replay;
pub mod response;
pub mod selftest;
pub mod serve;
pub mod solve;
pub mod status;
pub mod sweep;
pub mod table;
