//! The emulator as a process: JSON lines on standard input and output, one answer to each request.
//!
//! | request | answer |
//! |---|---|
//! | `{"op":"run","until_s":T,"uart":"<hex>"}` | emulated time, USART2's output as hex, truth every 1 ms, defmt lines |
//! | `{"op":"plant","key":K,"value":V}` | `{"ok":true}`; with `"check":true` only whether it could change while the rig runs |
//! | `{"op":"fault","name":N,"on":B}` | `{"ok":true}` |
//! | `{"op":"power-cycle"}` | `{"ok":true}` |
//! | `{"op":"stats"}` | what the firmware cost |
//! | `{"op":"quit"}` | `{"ok":true}`, and the process ends |
//!
//! Anything else is answered by `{"error":{"kind","message"}}`. Time stands still between requests, so a session is
//! exactly repeatable.

use crate::board::Stimulus;
use crate::flash_file::FlashFile;
use crate::machine::{Machine, MachineError};
use crate::rig::Rig;
use crate::rig::faults::Fault;
use crate::rig::settings::PlantSettings;
use crate::rig::truth::Truth;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::io::{self, Write};

/// USART of the host link.
const HOST_USART: u8 = 2;
/// The firmware's tick, whose instructions are counted.
const TICK_FUNCTION: &str = "control_tick";
/// Longest run in one request (s): a slip of the pen must not hang the caller for ever.
const LONGEST_RUN_S: f64 = 3600.0;

/// A request as it comes. One flat record rather than an enum by `op`: buffering a tagged enum loses plain numbers
/// when another crate turns on serde_json's arbitrary precision.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    op: String,
    until_s: Option<f64>,
    uart: Option<String>,
    key: Option<String>,
    value: Option<String>,
    check: Option<bool>,
    name: Option<String>,
    on: Option<bool>,
}

#[derive(Debug, PartialEq)]
enum Request {
    Run { until_s: f64, uart: String },
    Plant { key: String, value: String, check: bool },
    Fault { name: String, on: bool },
    PowerCycle,
    Stats,
    Quit,
}

fn parse(text: &str) -> Result<Request, String> {
    let line: Line = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let missing = |field: &str| format!("{} needs `{field}`", line.op);
    Ok(match line.op.as_str() {
        "run" => Request::Run {
            until_s: line.until_s.ok_or_else(|| missing("until_s"))?,
            uart: line.uart.unwrap_or_default(),
        },
        "plant" => Request::Plant {
            key: line.key.ok_or_else(|| missing("key"))?,
            value: line.value.ok_or_else(|| missing("value"))?,
            check: line.check.unwrap_or(false),
        },
        "fault" => Request::Fault {
            name: line.name.ok_or_else(|| missing("name"))?,
            on: line.on.ok_or_else(|| missing("on"))?,
        },
        "power-cycle" => Request::PowerCycle,
        "stats" => Request::Stats,
        "quit" => Request::Quit,
        other => return Err(format!("op `{other}` is unknown; known are run, plant, fault, power-cycle, stats, quit")),
    })
}

#[derive(Serialize)]
struct TruthLine {
    #[serde(flatten)]
    truth: Truth,
    /// Tension of one string.
    string_tension_n: f64,
}

/// Serves requests, a line each, until `quit` or their end.
///
/// # Errors
/// When standard output is gone, or the file of the flash cannot be written.
pub fn serve(
    machine: &mut Machine<Rig>,
    mut flash: Option<FlashFile>,
    requests: impl Iterator<Item = io::Result<String>>,
    mut output: impl Write,
) -> anyhow::Result<()> {
    machine.board_mut().record();
    // Another ELF than ours may have no such function; then its statistics stay empty.
    let _ = machine.watch_function(TICK_FUNCTION);
    for line in requests {
        let line = line?;
        if line.trim().is_empty() {
            continue;
        }
        let (answer, quit) = match parse(&line) {
            Ok(Request::Quit) => (json!({"ok": true}), true),
            Ok(request) => (answer(machine, request), false),
            Err(error) => (failure("request", &error), false),
        };
        // Before the answer: whoever has it may end this process.
        if let Some(flash) = &mut flash {
            flash.follow(machine)?;
        }
        writeln!(output, "{answer}")?;
        output.flush()?;
        if quit {
            break;
        }
    }
    Ok(())
}

fn failure(kind: &str, message: &str) -> Value {
    json!({"error": {"kind": kind, "message": message}})
}

fn answer(machine: &mut Machine<Rig>, request: Request) -> Value {
    match request {
        Request::Run { until_s, uart } => run(machine, until_s, &uart),
        Request::Plant { key, value, check: true } => match PlantSettings::default().set_at_run_time(&key, &value) {
            Ok(()) => json!({"ok": true}),
            Err(error) => failure("plant", &error.to_string()),
        },
        Request::Plant { key, value, check: false } => match machine.board_mut().set_plant(&key, &value) {
            Ok(()) => json!({"ok": true}),
            Err(error) => failure("plant", &error.to_string()),
        },
        // The faults that are the chip's and not the rig's.
        Request::Fault { name, on } if name == "task-hang" => {
            machine.hang(on);
            json!({"ok": true})
        }
        Request::Fault { name, on } if name == "adc-stall" => {
            machine.soc_mut().stall_adc(on);
            json!({"ok": true})
        }
        Request::Fault { name, on } if matches!(name.as_str(), "can-dominant" | "can-open") => {
            let mut line = machine.soc_mut().can_line();
            *(if name == "can-open" { &mut line.open } else { &mut line.dominant }) = on;
            machine.soc_mut().set_can_line(line);
            json!({"ok": true})
        }
        Request::Fault { name, on } if name == "rtt-stalled" => {
            machine.stall_rtt(on);
            json!({"ok": true})
        }
        Request::Fault { name, on } if name == "no-hse" => {
            machine.feed_hse(!on);
            json!({"ok": true})
        }
        Request::Fault { name, on } if name == "brown-out" => {
            if on {
                machine.brown_out();
            }
            json!({"ok": true})
        }
        Request::Fault { name, on: true } if name == "crash" => match machine.crash() {
            Ok(()) => json!({"ok": true}),
            Err(error) => failure("machine", &error.to_string()),
        },
        Request::Fault { name, on } => match name.parse::<Fault>() {
            Ok(fault) => match machine.board_mut().try_fault(fault, on) {
                Ok(()) => json!({"ok": true}),
                Err(error) => failure("fault", &error.to_string()),
            },
            Err(error) => failure("fault", &error.to_string()),
        },
        Request::PowerCycle => {
            machine.board_mut().power_cycle();
            machine.power_cycle();
            json!({"ok": true})
        }
        Request::Stats => stats(machine),
        Request::Quit => json!({"ok": true}),
    }
}

fn run(machine: &mut Machine<Rig>, until_s: f64, uart: &str) -> Value {
    let now_s = machine.now_s();
    if !until_s.is_finite() || until_s > now_s + LONGEST_RUN_S {
        return failure("request", &format!("until_s {until_s} is more than {LONGEST_RUN_S} s after {now_s}"));
    }
    match bytes_of(uart) {
        Some(bytes) if bytes.is_empty() => {}
        Some(bytes) => machine.send(Stimulus::Uart { usart: HOST_USART, bytes }),
        None => return failure("request", "uart is not a string of hexadecimal digits, two for a byte"),
    }
    let stopped = machine.run_until(until_s).err();
    let log: Vec<String> = machine.defmt_lines().iter().map(ToString::to_string).collect();
    if let Some(error) = stopped {
        let kind = match error {
            MachineError::Fault { .. } => "strict",
            MachineError::Memory { .. } => "memory",
            MachineError::Undefined { .. } => "panic",
            _ => "machine",
        };
        return json!({"error": {"kind": kind, "message": error.to_string(), "log": log}});
    }
    let records = machine.board_mut().take_records();
    let truth: Vec<TruthLine> =
        records.into_iter().map(|truth| TruthLine { string_tension_n: truth.tension_n, truth }).collect();
    let uart = hex_of(&machine.board_mut().take_host_bytes());
    json!({"t_s": machine.now_s(), "uart": uart, "truth": truth, "log": log})
}

fn stats(machine: &Machine<Rig>) -> Value {
    let stats = machine.stats();
    let resets: Vec<Value> =
        stats.resets.iter().map(|(t_s, cause)| json!({"t_s": t_s, "cause": format!("{cause:?}")})).collect();
    json!({
        "instructions_per_tick_mean": stats.tick.instructions_mean,
        "instructions_per_tick_max": stats.tick.instructions_max,
        "ticks": stats.tick.count,
        "plant_tier": machine.board().tier().name(),
        "core_busy": stats.core_busy,
        "instructions": stats.instructions,
        "stack_high_water_bytes": stats.stack_high_water_bytes,
        "resets": resets,
        "emulated_s": machine.now_s(),
    })
}

fn hex_of(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn bytes_of(hex: &str) -> Option<Vec<u8>> {
    if !hex.len().is_multiple_of(2) || !hex.is_ascii() {
        return None;
    }
    (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(hex.get(i..i + 2)?, 16).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_goes_both_ways_and_refuses_the_rest() {
        assert_eq!(bytes_of("00ff7a"), Some(vec![0, 255, 122]));
        assert_eq!(hex_of(&[0, 255, 122]), "00ff7a");
        for bad in ["0", "0g", "é0", "0x11"] {
            assert!(bytes_of(bad).is_none(), "{bad}");
        }
    }

    #[test]
    fn requests_are_taken_as_documented() {
        assert_eq!(parse(r#"{"op":"run","until_s":1.5}"#), Ok(Request::Run { until_s: 1.5, uart: String::new() }));
        assert_eq!(parse(r#"{"op":"power-cycle"}"#), Ok(Request::PowerCycle));
        for bad in [r#"{"op":"dance"}"#, r#"{"op":"run"}"#, r#"{"op":"run","until_s":1.5,"uarts":""}"#, "17", ""] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
