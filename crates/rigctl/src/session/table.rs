//! The table of a scene is fitted on the host, sent to the board, checked and stored there.

use super::client::Session;
use crate::failure::Failure;
use rig_config::Scene;
use rig_link::messages::{EventKind, Request, TablePart};
use std::path::Path;
use tsa_table::Table;
use tsa_table::fit::Fit;
use tsa_table::record::RECORD_MAX;

/// Longest wait for the board to check the table and to write it (s): an erase of flash takes half a second, and the board
/// writes when the rig stands.
pub(super) const WAIT_S: f64 = 10.0;

/// A table that the board uses now.
#[derive(Clone, Debug)]
pub struct Sent {
    /// The table, with its error bounds.
    pub fit: Fit,
    /// Whether it is in the board's flash.
    pub kept: bool,
}

/// Fits the table of a scene file and sends it. Only the scene's `[rig]` must be the one that the board was built with.
///
/// # Errors
/// As [`send_table`]; if the scene has no table.
pub fn send(session: &mut Session, scene: &Scene, file: &Path) -> Result<Sent, Failure> {
    check_rig(session, scene, file)?;
    let fit = fitted(scene, file)?;
    let kept = send_table(session, scene, file, &fit.table.table())?;
    Ok(Sent { fit, kept })
}

/// The table of a scene file.
///
/// # Errors
/// If it has none; names the file.
pub fn fitted(scene: &Scene, file: &Path) -> Result<Fit, Failure> {
    scene.fit_table().map_err(|error| Failure::failed(format!("{}: {error}", file.display())))
}

fn check_rig(session: &Session, scene: &Scene, file: &Path) -> Result<(), Failure> {
    let name = file.display();
    let (theirs, ours) = (session.require_identity()?.rig_hash, scene.rig_hash());
    if theirs == ours {
        return Ok(());
    }
    Err(Failure::failed(format!(
        "{name}: its [rig] ({ours:08x}) is not the one that the board was built with ({theirs:08x}), and a table cannot change \
         that: build and flash for this scene, `TSA_SCENE={name} cargo xtask flash`"
    )))
}

/// Sends a table and waits until the board uses it; whether it is in the board's flash.
///
/// # Errors
/// Naming `[rig]` of the scene's file where the board's differs; the board's refusal in words.
pub fn send_table(session: &mut Session, scene: &Scene, file: &Path, table: &Table<'_>) -> Result<bool, Failure> {
    check_rig(session, scene, file)?;
    let mut record = [0; RECORD_MAX];
    let length = table
        .write(&mut record)
        .ok_or_else(|| Failure::failed(format!("{}: its table is too large", file.display())))?;
    session.wait_ready()?;
    for part in TablePart::of_record(&record[..length]) {
        session.request(&Request::TablePart(part))?;
    }
    let end_s = session.now_s() + WAIT_S;
    while session.now_s() < end_s {
        session.step()?;
        for (_, kind) in session.take_events() {
            match kind {
                EventKind::TableStored { crc, kept } if crc == table.crc => {
                    session.identify()?;
                    return Ok(kept);
                }
                EventKind::TableRefused(reason) => {
                    return Err(Failure::failed(format!(
                        "the board does not use this table: {reason}; the old one stays"
                    )));
                }
                _ => {}
            }
        }
    }
    Err(Failure::failed(format!("the board did not take the table within {WAIT_S} s")))
}
