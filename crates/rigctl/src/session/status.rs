//! Everything that a board reports about itself, at one time.

use super::client::Session;
use super::link::STEP_S;
use super::row::Row;
use crate::failure::Failure;
use rig_link::{Counters, Fault, Identity, Sensors, SettingsReport};

/// How long the telemetry is listened to (s).
const LISTEN_S: f64 = 1.0;

/// A board's report.
pub struct Status {
    /// Version, hashes, table, last reset.
    pub identity: Identity,
    /// Settings, and whether they are in flash.
    pub settings: SettingsReport,
    /// Readings of the sensors.
    pub sensors: Sensors,
    /// The newest telemetry.
    pub row: Row,
    /// Counters of link and ticks.
    pub counters: Counters,
    /// Every fault that is raised, the gravest first.
    pub faults: Vec<Fault>,
    /// Telemetry messages a second.
    pub telemetry_hz: f64,
}

/// Listens to the board, then asks it for settings and sensors.
///
/// # Errors
/// If it does not answer.
pub fn status(session: &mut Session) -> Result<Status, Failure> {
    session.take_rows();
    session.until(LISTEN_S, |_| false)?;
    let mut rows = session.take_rows();
    let telemetry_hz = rows.len() as f64 / LISTEN_S;
    let row = rows.pop().ok_or_else(|| Failure::failed("no telemetry from the board"))?;
    let identity = session.require_identity()?.clone();
    let (settings, sensors) = (session.settings()?, session.sensors()?);
    let telemetry = session.telemetry();
    Ok(Status {
        identity,
        settings,
        sensors,
        row,
        counters: telemetry.map(|t| t.counters).unwrap_or_default(),
        faults: telemetry.map_or(Vec::new(), |t| t.faults.iter().collect()),
        telemetry_hz,
    })
}

/// The newest telemetry, after a few more messages.
///
/// # Errors
/// If the port fails.
pub fn newest_row(session: &mut Session) -> Result<Option<Row>, Failure> {
    session.until(10.0 * STEP_S, |_| false)?;
    Ok(session.take_rows().pop())
}
