//! The table of a scene is fitted on the host, sent to the board, checked and stored there.

use super::client::Session;
use crate::failure::Failure;
use rig_config::Scene;
use rig_link::messages::{EventKind, Request, TablePart, TableRefusal};
use std::path::Path;
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
/// Naming `[rig]` where it differs; if the scene has no table; the board's refusal in words.
pub fn send(session: &mut Session, scene: &Scene, file: &Path) -> Result<Sent, Failure> {
    let name = file.display();
    let (theirs, ours) = (session.require_identity()?.rig_hash, scene.rig_hash());
    if theirs != ours {
        return Err(Failure::failed(format!(
            "{name}: its [rig] ({ours:08x}) is not the one that the board was built with ({theirs:08x}), and a table cannot change \
             that: build and flash for this scene, `TSA_SCENE={name} cargo xtask flash`"
        )));
    }
    let fit = scene.fit_table().map_err(|error| Failure::failed(format!("{name}: {error}")))?;
    let table = fit.table.table();
    let mut record = [0; RECORD_MAX];
    let length = table.write(&mut record).ok_or_else(|| Failure::failed(format!("{name}: its table is too large")))?;
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
                    return Ok(Sent { fit, kept });
                }
                EventKind::TableRefused(reason) => return Err(refused(reason)),
                _ => {}
            }
        }
    }
    Err(Failure::failed(format!("the board did not take the table within {WAIT_S} s")))
}

fn refused(reason: TableRefusal) -> Failure {
    Failure::failed(format!("the board does not use this table: {reason}; the old one stays"))
}
