//! Checks of the board's identity: image, protocol, last reset, clock, scene and table; and of its settings.

use super::{Check, check};
use crate::board_settings;
use crate::failure::Failure;
use crate::units::{N, PERCENT, TURNS, UM};
use rig_config::Scene;
use rig_link::{Clock, Identity, PROTOCOL_HASH, ResetCause, SettingsReport, TableIdentity};

/// Checks of a board's identity against the tool and the scene.
///
/// # Errors
/// If the scene does not say what its table must cover.
pub fn checks(id: &Identity, scene: &Scene) -> Result<Vec<Check>, Failure> {
    let (envelope, accuracy) = scene.table_requirement()?;
    let turns = envelope.turns;
    let t = &id.table;
    let close = |a: f64, b: f32| (a - f64::from(b)).abs() < 1e-5 * a.abs().max(1.0);
    let accurate = f64::from(t.contraction_error_m) <= accuracy.contraction_m
        && f64::from(t.tr_relative_error) <= accuracy.tr_relative;
    let covers = (f64::from(t.load_min_n) <= envelope.load_n[0] || close(envelope.load_n[0], t.load_min_n))
        && (f64::from(t.load_max_n) >= envelope.load_n[1] || close(envelope.load_n[1], t.load_max_n))
        && (f64::from(t.turns_max) >= turns[1] || close(turns[1], t.turns_max));
    let asked_for = matches!(id.reset_cause, ResetCause::PowerOn | ResetCause::Pin | ResetCause::Software);
    Ok(vec![
        firmware(id),
        check(
            "protocol",
            id.protocol_hash == PROTOCOL_HASH,
            format!("board {:08x}, tool {PROTOCOL_HASH:08x}", id.protocol_hash),
            "build both from one tree",
        ),
        check(
            "reset",
            asked_for,
            format!("last started by {}, {} boots since power came on", id.reset_cause, id.boot_count),
            match id.reset_cause {
                ResetCause::BrownOut => "the supply dipped: look at the board's supply and its ground",
                ResetCause::Watchdog => "the firmware hung: see the last panic, then `clear` and `home`",
                _ => "nobody asked for it: look at supply and reset wiring",
            },
        ),
        clock(id.clock),
        brown_out(id.brown_out_level),
        check(
            "panic",
            id.last_panic.is_none(),
            id.last_panic.as_ref().map_or("none".to_owned(), |text| format!("the run before ended with: {text}")),
            "report it with a `record` of what led to it; `clear` and `home` to go on",
        ),
        check(
            "scene",
            id.scene_hash == scene.hash(),
            format!("board {:08x}, --scene {:08x}", id.scene_hash, scene.hash()),
            "name the board's scene with --scene, or `table --board`, or build and flash for this one",
        ),
        check(
            "rig",
            id.rig_hash == scene.rig_hash(),
            format!("built with [rig] {:08x}, --scene has {:08x}", id.rig_hash, scene.rig_hash()),
            "the scene's [rig], [envelope] or [accuracy] is not what this firmware was built with: build and flash",
        ),
        check(
            "table",
            accurate && covers,
            format!(
                "{}; the scene asks for {} and {} over {} and {}",
                table(t),
                UM.exact(accuracy.contraction_m),
                PERCENT.exact(accuracy.tr_relative),
                N.range(envelope.load_n),
                TURNS.exact(turns[1])
            ),
            "build and flash for the scene, or `table --board`",
        ),
    ])
}

/// The board's table in words.
pub fn table(t: &TableIdentity) -> String {
    format!(
        "{}, {} bytes, {}: contraction within {}, TR within {} for {}, {}",
        t.form,
        t.bytes,
        if t.sent { "sent by the host" } else { "built in" },
        UM.error(t.contraction_error_m),
        PERCENT.error(t.tr_relative_error),
        N.range([t.load_min_n, t.load_max_n]),
        TURNS.range([t.turns_min, t.turns_max])
    )
}

/// The settings: whether those in flash are used.
pub fn settings(report: &SettingsReport) -> Check {
    let remedy = board_settings::remedy(report.kept);
    check("settings", remedy.is_none(), board_settings::origin(report), remedy.unwrap_or_default())
}

/// The image's version.
fn firmware(id: &Identity) -> Check {
    let tool = env!("CARGO_PKG_VERSION");
    let seen = format!("{} (git {}), tool {tool}", id.version, id.git);
    check("firmware", id.version == tool, seen, "build and flash the firmware that goes with this tool")
}

/// The source of the board's clock.
fn clock(clock: Clock) -> Check {
    let seen = match clock {
        Clock::Hse => "the ST-LINK's 8 MHz",
        Clock::Hsi => "the chip's own oscillator: the ST-LINK's 8 MHz was missing at the last start",
    };
    let advice =
        "solder bridges SB16 and SB50, power by the ST-LINK's USB socket; then reset. Do not rely on the CAN bit rate";
    check("clock", clock == Clock::Hse, seen, advice)
}

/// The chip's brown-out reset, an option byte.
fn brown_out(level: u8) -> Check {
    let seen = match level {
        0 => "the reset by a dip of the supply is off".to_owned(),
        level => format!("reset by a dip of the supply at level {level}, wanted 3"),
    };
    let advice = "below 2.7 V the chip may do anything, and a dip passes for power-on: set level 3 (docs/tutorial/first-board.md)";
    check("brown-out", level == 3, seen, advice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::identity;

    #[test]
    fn an_image_of_another_version_needs_attention() {
        assert!(firmware(&identity("abcdef0")).ok);
        let old = Identity { version: "0.0.1".parse().expect("fits"), ..identity("abcdef0") };
        assert!(!firmware(&old).ok);
    }

    #[test]
    fn a_board_on_its_own_clock_or_without_brown_out_reset_needs_attention() {
        assert!(clock(Clock::Hse).ok && brown_out(3).ok);
        for bad in [clock(Clock::Hsi), brown_out(0), brown_out(2)] {
            assert!(!bad.ok && bad.advice.is_some(), "{bad:?}");
        }
        assert!(brown_out(0).seen.contains("off"));
    }
}
