//! GDB's remote protocol against programs assembled by hand: whatever the debugger does, the run stays the same.

use crate::fixture::{Recorder, machine};
use crate::gdb_client::Gdb;
use crate::listings::{CONDITIONS, Listing, PROCESS_STACK, SYSTICK};
use crate::program::START;
use rig_emulator::gdb::Server;
use rig_emulator::machine::Machine;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const RAM: u32 = 0x2000_0000;
const FLASH: u32 = 0x0800_0000;

/// What a run leaves: instructions, exceptions and all of RAM.
fn result(machine: &mut Machine<Recorder>) -> (u64, u64, Vec<u8>) {
    let stats = machine.stats();
    (stats.instructions, stats.exceptions, machine.soc_mut().memory.ram.to_vec())
}

/// A run that a debugger is there for from the first instruction, and what it leaves.
fn debugged(program: &Listing, t_s: f64, debugger: impl FnOnce(&str) + Send) -> (u64, u64, Vec<u8>) {
    let mut machine = machine(&program.elf());
    let server = Server::bind("127.0.0.1:0", true, Arc::default()).expect("a free port");
    let address = server.address().expect("an address").to_string();
    machine.attach(Box::new(server));
    std::thread::scope(|scope| {
        let client = scope.spawn(|| debugger(&address));
        machine.run_until(t_s).expect("it runs");
        client.join().expect("the debugger is content");
    });
    result(&mut machine)
}

fn undisturbed(program: &Listing, t_s: f64) -> (u64, u64, Vec<u8>) {
    let mut machine = machine(&program.elf());
    machine.run_until(t_s).expect("it runs");
    result(&mut machine)
}

#[test]
fn breakpoints_and_steps_change_nothing() {
    let program = &SYSTICK;
    let handler = program.handler();
    let after = debugged(program, 20e-3, |address| {
        let mut gdb = Gdb::connect(address);
        assert!(gdb.ask("?").starts_with(['S', 'T']));
        assert_eq!(gdb.pc(), START);
        assert_eq!(gdb.ask(&format!("Z0,{handler:x},2")), "OK");
        // In the middle of a block, too.
        assert_eq!(gdb.ask(&format!("Z1,{:x},2", handler + 4)), "OK");
        for round in 1..=5 {
            assert!(gdb.ask("c").contains("swbreak"));
            assert_eq!(gdb.pc(), handler);
            assert_eq!(gdb.memory(RAM, 1), [round - 1]);
            assert!(gdb.ask("c").starts_with('T'));
            assert_eq!(gdb.pc(), handler + 4);
            let registers = gdb.registers();
            assert_eq!((registers[3], registers[16] & 0x1FF), (round, 15), "the count goes up; in SysTick's handler");
            // The store, the return, the branch after WFI, WFI itself and the handler's first instruction.
            let mut steps = Vec::new();
            for _ in 0..4 {
                assert!(gdb.ask("s").starts_with(['S', 'T']));
                steps.push(gdb.pc());
            }
            assert_eq!(steps, [handler + 6, START + 24, START + 22, handler], "round {round}");
            // A breakpoint that the core stands at has been reached.
            assert!(gdb.ask("s").starts_with(['S', 'T']));
            assert_eq!(gdb.pc(), handler + 2);
            assert!(gdb.ask("c").starts_with('T'));
            assert_eq!(gdb.pc(), handler + 4);
            assert_eq!(gdb.ask(&format!("z0,{handler:x},2")), "OK");
            assert_eq!(gdb.ask(&format!("Z0,{handler:x},2")), "OK");
            // Back to an even count of rounds for the next.
            gdb.ask(&format!("M{RAM:x},4:{:02x}000000", round));
            gdb.ask("s");
            gdb.ask(&format!("M{RAM:x},4:{:02x}000000", round));
        }
        assert_eq!(gdb.ask(&format!("M{RAM:x},4:0a000000")), "OK", "ten interrupts have been counted");
        assert_eq!(gdb.ask("D"), "OK");
    });
    assert_eq!(after, undisturbed(program, 20e-3));
}

#[test]
fn a_program_stepped_from_end_to_end_takes_the_same_time() {
    for (program, steps) in [(&SYSTICK, 150), (&CONDITIONS, 150), (&PROCESS_STACK, 15)] {
        let after = debugged(program, 50e-3, |address| {
            let mut gdb = Gdb::connect(address);
            for _ in 0..steps {
                assert!(gdb.ask("s").starts_with(['S', 'T']));
            }
            assert_eq!(gdb.ask("D"), "OK");
        });
        assert_eq!(after, undisturbed(program, 50e-3));
    }
}

#[test]
fn a_breakpoint_inside_an_it_block_stops_at_the_it() {
    let it = START + 10;
    let after = debugged(&CONDITIONS, 1e-4, |address| {
        let mut gdb = Gdb::connect(address);
        assert_eq!(gdb.ask(&format!("Z0,{:x},2", it + 6)), "OK");
        for round in 1..=4 {
            assert!(gdb.ask("c").starts_with('T'));
            let registers = gdb.registers();
            assert_eq!((registers[15], registers[1]), (it, round));
            assert_eq!((registers[2], registers[3]), ((round - 1) / 2, round / 2));
        }
        // The whole of it is one step.
        gdb.ask("s");
        assert_eq!(gdb.pc(), it + 10);
        assert_eq!(gdb.ask(&format!("z0,{:x},2", it + 6)), "OK");
        assert_eq!(gdb.ask("D"), "OK");
    });
    assert_eq!(after, undisturbed(&CONDITIONS, 1e-4));
}

#[test]
fn registers_and_memory_are_read_and_written() {
    debugged(&CONDITIONS, 1e-4, |address| {
        let mut gdb = Gdb::connect(address);
        let description = gdb.ask("qXfer:features:read:target.xml:0,ffb");
        assert!(description.contains("org.gnu.gdb.arm.m-profile") && description.contains("xpsr"), "{description}");
        gdb.ask("s");
        let all = gdb.ask("g");
        assert_eq!(all.len(), 2 * (4 * 17 + 8 * 16 + 4));
        // r1 and the flags.
        let changed = format!("{}efbeadde{}", &all[..8], &all[16..]);
        assert_eq!(gdb.ask(&format!("G{changed}")), "OK");
        assert_eq!(gdb.registers()[1], 0xDEAD_BEEF);
        gdb.ask("s");
        assert_eq!(gdb.registers()[1], 0xDEAD_BEF0, "the core goes on with what was written");
        assert_eq!(gdb.memory(FLASH, 2), [0x2002_0000, START + 1]);
        assert_eq!(gdb.ask(&format!("M{:x},4:78563412", RAM + 0x40)), "OK");
        assert_eq!(gdb.memory(RAM + 0x40, 1), [0x1234_5678]);
        // Flash is not written, a peripheral not read, and nothing is where nothing is.
        for refused in [format!("M{FLASH:x},4:00000000"), "m40023800,4".into(), "m0,4".into(), "m2001fffe,4".into()] {
            assert!(gdb.ask(&refused).starts_with('E'), "{refused}");
        }
        assert_eq!(gdb.ask("D"), "OK");
    });
}

#[test]
fn ctrl_c_stops_a_run_and_a_client_that_vanishes_leaves_nothing_behind() {
    let after = debugged(&SYSTICK, 1.0, |address| {
        let mut gdb = Gdb::connect(address);
        gdb.send("c");
        gdb.interrupt();
        assert!(gdb.answer().contains("02"), "SIGINT");
        assert_eq!(gdb.ask(&format!("Z0,{:x},2", SYSTICK.handler())), "OK");
        assert!(gdb.ask("c").starts_with('T'));
        // And gone, at a breakpoint.
    });
    assert_eq!(after, undisturbed(&SYSTICK, 1.0));
}

#[test]
fn garbage_and_silence_hold_nothing_up() {
    let mut machine = machine(&SYSTICK.elf());
    let server = Server::bind("127.0.0.1:0", false, Arc::default()).expect("a free port");
    let address = server.address().expect("an address").to_string();
    machine.attach(Box::new(server));
    let address = &address;
    let talk = move || {
        for garbage in [&b"GET / HTTP/1.1\r\n\r\n"[..], &[0xFF; 5000], &[0; 1]] {
            let mut stream = TcpStream::connect(address).expect("somebody listens");
            let _ = stream.write_all(garbage);
            // Shown out, with the reset that unread bytes get or without.
            let _ = stream.read(&mut [0]);
        }
        // What begins like a packet and is none.
        for garbage in [&b"$g#00"[..], b"+$\xFF\xFE\xFD#99", b"$vCont;q#zz"] {
            let mut stream = TcpStream::connect(address).expect("somebody listens");
            let _ = stream.write_all(garbage);
            let _ = stream.shutdown(std::net::Shutdown::Write);
            let _ = stream.read_to_end(&mut Vec::new());
        }
    };
    std::thread::scope(|scope| {
        let client = scope.spawn(talk);
        while !client.is_finished() {
            machine.run_until(machine.now_s() + 1e-3).expect("it runs");
        }
    });
    // Nobody waits for who says nothing.
    let _silent = TcpStream::connect(address).expect("somebody listens");
    machine.run_until(machine.now_s() + 0.1).expect("it runs");
    let t_s = machine.now_s();
    assert_eq!(result(&mut machine), undisturbed(&SYSTICK, t_s));
}

#[test]
fn a_failure_can_be_looked_at() {
    let mut machine = machine(&SYSTICK.elf());
    let server = Server::bind("127.0.0.1:0", true, Arc::default()).expect("a free port");
    let address = server.address().expect("an address").to_string();
    machine.attach(Box::new(server));
    std::thread::scope(|scope| {
        let client = scope.spawn(|| {
            let mut gdb = Gdb::connect(&address);
            // Into nowhere.
            let all = gdb.ask("g");
            assert_eq!(gdb.ask(&format!("G{}00000010{}", &all[..15 * 8], &all[16 * 8..])), "OK");
            assert!(gdb.ask("c").contains("0b"), "SIGSEGV");
            assert_eq!(gdb.registers().len(), 17);
            assert!(gdb.ask("c").starts_with('X'), "it has ended");
        });
        assert!(machine.run_until(0.1).is_err());
        client.join().expect("the debugger is content");
    });
}

#[test]
fn a_port_that_is_taken_is_named_and_a_host_that_has_gone_ends_the_wait() {
    let gone = Arc::new(AtomicBool::new(false));
    let server = Server::<Recorder>::bind("127.0.0.1:0", true, gone.clone()).expect("a free port");
    let address = server.address().expect("an address").to_string();
    for bad in [address.as_str(), "127.0.0.1", "nonsense:x"] {
        let error = Server::<Recorder>::bind(bad, false, Arc::default()).err().expect("refused");
        assert!(format!("{error:#}").contains(bad), "{error:#}");
    }
    let mut machine = machine(&SYSTICK.elf());
    machine.attach(Box::new(server));
    gone.store(true, Ordering::Relaxed);
    machine.run_until(0.1).expect("it runs without");
}
