//! The emulator as a process: requests on standard input, answers on standard output ([`rig_plant::control`]).

use crate::flash_file::FlashFile;
use crate::machine::{Machine, MachineError};
use rig_plant::board::Stimulus;
use rig_plant::rig::{EmulatedRig, HOST_USART};
use rig_plant::{Answer, ChipFault, Fault, Request, Run, Stats};
use std::io::{self, Write};

/// The firmware's tick, whose instructions are counted.
const TICK_FUNCTION: &str = "control_tick";
/// Longest run in one request (s): a typing error must not hang the caller indefinitely.
const LONGEST_RUN_S: f64 = 3600.0;

/// How often a run looks whether the plant's program goes on (s).
const LOOK_AT_PLANT_S: f64 = 0.01;

/// Serves requests, a line each, until their end.
///
/// # Errors
/// When standard output is gone, or the file of the flash cannot be written.
pub fn serve(
    machine: &mut Machine<EmulatedRig>,
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
        let answer = match serde_json::from_str(&line) {
            Ok(request) => answer(machine, request),
            Err(error) => failure("request", error),
        };
        // Before the answer: whoever has it may end this process.
        if let Some(flash) = &mut flash {
            flash.follow(machine)?;
        }
        writeln!(output, "{}", serde_json::to_string(&answer)?)?;
        output.flush()?;
    }
    Ok(())
}

fn failure(kind: &str, message: impl ToString) -> Answer {
    Answer::Error { kind: kind.into(), message: message.to_string() }
}

fn answer(machine: &mut Machine<EmulatedRig>, request: Request) -> Answer {
    match request {
        Request::Run { until_s, uart } => return run(machine, until_s, uart),
        Request::Stats => return Answer::Stats(stats(machine)),
        Request::Plant(change) => {
            if let Err(error) = machine.board_mut().change_plant(change) {
                return failure("plant", error);
            }
        }
        Request::Fault { fault: Fault::Rig(fault), on } => {
            if let Err(error) = machine.board_mut().try_fault(fault, on) {
                return failure("fault", error);
            }
        }
        Request::Fault { fault: Fault::Chip(fault), on } => {
            if let Err(error) = chip_fault(machine, fault, on) {
                return failure("machine", error);
            }
        }
        Request::PowerCycle => {
            machine.board_mut().power_cycle();
            machine.power_cycle();
        }
    }
    Answer::Done
}

fn chip_fault(machine: &mut Machine<EmulatedRig>, fault: ChipFault, on: bool) -> Result<(), MachineError> {
    match fault {
        ChipFault::TaskHang => machine.hang(on),
        ChipFault::AdcStall => machine.soc_mut().stall_adc(on),
        ChipFault::CanDominant | ChipFault::CanOpen => {
            let mut line = machine.soc_mut().can.line();
            *(if fault == ChipFault::CanOpen { &mut line.open } else { &mut line.dominant }) = on;
            machine.soc_mut().set_can_line(line);
        }
        ChipFault::RttStalled => machine.stall_rtt(on),
        ChipFault::NoHse => machine.feed_hse(!on),
        ChipFault::HseLate => machine.soc_mut().hse_late = on,
        ChipFault::StackOverflow if on => machine.overflow_stack(),
        ChipFault::BrownOut if on => machine.brown_out(),
        ChipFault::Crash if on => machine.crash()?,
        ChipFault::BrownOut | ChipFault::Crash | ChipFault::StackOverflow => {}
    }
    Ok(())
}

fn run(machine: &mut Machine<EmulatedRig>, until_s: f64, uart: Vec<u8>) -> Answer {
    let now_s = machine.now_s();
    if !until_s.is_finite() || until_s > now_s + LONGEST_RUN_S {
        return failure("request", format!("until_s {until_s} is more than {LONGEST_RUN_S} s after {now_s}"));
    }
    if !uart.is_empty() {
        machine.send(Stimulus::Uart { usart: HOST_USART, bytes: uart });
    }
    let stopped = run_until(machine, until_s).err();
    let log = machine.defmt_lines().iter().map(ToString::to_string).collect();
    if let Some(error) = stopped {
        let kind = match error {
            MachineError::Fault { .. } => "strict",
            MachineError::Memory { .. } => "memory",
            MachineError::Undefined { .. } => "panic",
            _ => "machine",
        };
        return failure(kind, error);
    }
    if let Some(error) = machine.board().plant_failure() {
        return failure("plant", error);
    }
    let t_s = machine.now_s();
    let rig = machine.board_mut();
    Answer::Run(Run { t_s, uart: rig.take_host_bytes(), truth: rig.take_records(), log })
}

/// Runs to a time, or to shortly after the plant's program has failed.
fn run_until(machine: &mut Machine<EmulatedRig>, until_s: f64) -> Result<(), MachineError> {
    if machine.board().plant().built_in().is_some() {
        return machine.run_until(until_s);
    }
    // The machine may stop a cycle before the time, so that its own clock would not do to count.
    let mut stop_s = machine.now_s();
    while stop_s < until_s && machine.board().plant_failure().is_none() {
        stop_s = until_s.min(stop_s + LOOK_AT_PLANT_S);
        machine.run_until(stop_s)?;
    }
    Ok(())
}

fn stats(machine: &Machine<EmulatedRig>) -> Stats {
    let stats = machine.stats();
    Stats {
        instructions_per_tick_mean: stats.tick.instructions_mean,
        instructions_per_tick_max: stats.tick.instructions_max as f64,
        plant_tier: machine.board().tier().name().into(),
        core_busy: stats.core_busy,
        stack_high_water_bytes: stats.stack_high_water_bytes.into(),
    }
}
