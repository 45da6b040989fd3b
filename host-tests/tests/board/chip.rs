//! Homing and moving over either transport, the time of a tick, resets of the core, and a table that is sent.

use super::{counters, go, identity, moves};
use host_tests::board::{Bench, uart_scene};
use rand::{RngExt, SeedableRng};
use rig_link::messages::{Fault, LoadChoice, Refusal, Request, ResetCause, State, TableRefusal};
use rmds405::Transport;
use tsa_table::record::RECORD_MAX;

#[test]
fn homes_and_moves_a_load_it_was_not_given_over_bus_or_serial_line() {
    for (transport, load, twist, seed) in
        [(Transport::Can, "0.15kg", "-25", 1), (Transport::Can, "1.4kg", "40", 2), (Transport::Uart, "0.5kg", "6", 2)]
    {
        let keys = [("load", load), ("twist_at_boot", twist)];
        let uart = transport == Transport::Uart;
        let mut b = if uart { Bench::over_uart(&keys, seed) } else { Bench::new(&keys, seed) };
        let homing = b.home();
        moves(&mut b, 0.012);
        b.run(1.0);
        let error = b.true_position_m() - 0.012;
        let load_off = f64::from(b.last.unwrap().load_n.unwrap()) / b.machine.board().truth().load_n - 1.0;
        let stats = b.machine.stats();
        println!(
            "{transport:?} {load}: homed in {homing:.1} s, {:+.1} um at rest, load {:+.1} %, core busy {:.2} %, tick {:.0} \
             instructions mean, {} at most, stack {} B",
            error * 1e6,
            load_off * 100.0,
            stats.core_busy * 100.0,
            stats.tick.instructions_mean,
            stats.tick.instructions_max,
            stats.stack_high_water_bytes
        );
        assert!(homing < 45.0 && error.abs() < 50e-6 && load_off.abs() < 0.08);
        assert!(stats.core_busy < 0.10);
        // One tick every 10 ms, none lost.
        let expected = b.machine.now_s() / 0.01;
        assert!((stats.tick.count as f64 - expected).abs() < 3.0, "{} ticks of {expected}", stats.tick.count);
        assert!(stats.resets.is_empty() && stats.warnings.is_empty(), "{stats:?}");
        assert_eq!(b.machine.board().drive().transport(), Some(transport));
        assert_eq!(counters(&mut b).foreign_frames, 0);
        let scene_hash = if uart { uart_scene().hash() } else { host_tests::scene().hash() };
        assert_eq!(identity(&mut b).scene_hash, scene_hash);
    }
}

/// Instructions that no tick may take: 5 % of its 10 ms at an instruction a cycle.
const MAX_INSTRUCTIONS: u64 = 84_000;

/// What no scenario thinks of: requests of all kinds at any time, refused ones too, under loads that change; now and then
/// several at once by a host that does not wait for its answers.
#[test]
fn ticks_stay_short_whatever_is_asked() {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let mut b = Bench::new(&[("load", "0.5kg"), ("friction", "0.1")], 5);
    b.home();
    let (mut load_kg, mut next_kg, mut wait_s, mut refused) = (0.5f64, 0.5f64, 0.0, 0);
    let end_s = b.machine.now_s() + 90.0;
    while b.machine.now_s() < end_s {
        if wait_s <= 0.0 {
            if b.state() == State::Fault {
                // While the strings still turn it is refused.
                b.run(0.5);
                b.ask(&Request::Clear).unwrap();
                assert!(b.until(0.1, |b| b.state() == State::Ready), "the position was lost: {:?}", b.events);
            }
            let load = if random.random_bool(0.3) {
                LoadChoice::Known(random.random_range(1.0..16.0))
            } else {
                LoadChoice::Auto
            };
            let asked = match random.random_range(0..12) {
                0 => Request::Stop,
                1 => Request::Jog { twist_speed_rad_per_s: random.random_range(-4.0..4.0) },
                _ => Request::Move {
                    target_m: random.random_range(-0.003..0.025),
                    speed_m_per_s: random.random_range(0.0005..0.02),
                    load,
                },
            };
            if random.random_bool(0.3) {
                for _ in 0..random.random_range(1..8) {
                    let (target_m, speed_m_per_s) = (random.random_range(0.0..0.02), random.random_range(0.0005..0.02));
                    b.post(&Request::Move { target_m, speed_m_per_s, load });
                }
            }
            refused += u32::from(b.ask(&asked).is_err());
            wait_s =
                if random.random_bool(0.3) { random.random_range(0.0..6.0) } else { random.random_range(0.0..0.6) };
            if random.random_bool(0.1) {
                next_kg = random.random_range(0.3..1.5);
            }
        }
        load_kg += f64::clamp(next_kg - load_kg, -0.003, 0.003);
        b.machine.board_mut().set_plant("load", &format!("{load_kg}kg")).unwrap();
        b.step();
        wait_s -= 0.01;
    }
    println!("{refused} requests refused; longest: {:?}", b.longest_tick);
    assert!(refused > 10 && b.longest_tick.instructions < MAX_INSTRUCTIONS, "{:?}", b.longest_tick);
}

/// A core that hangs or whose stack leaves the RAM (it lies below the variables, memory.x) is reset by the watchdog; one with
/// a fault resets itself and says where. The board waits for the operator, and what the run before has left in its variables
/// is whole. What the drive does meanwhile is in `old_target`.
#[test]
fn a_core_that_hangs_overflows_its_stack_or_crashes_is_reset_and_the_board_waits() {
    type Happens = fn(&mut Bench);
    for (happens, cause, raised) in [
        ((|b| b.machine.hang(true)) as Happens, ResetCause::Watchdog, Fault::WatchdogReset),
        (|b| b.machine.overflow_stack(), ResetCause::Watchdog, Fault::WatchdogReset),
        (|b| b.machine.crash().unwrap(), ResetCause::Software, Fault::Panicked),
    ] {
        let mut b = super::standing(&[], 12);
        let began_s = b.machine.now_s();
        happens(&mut b);
        b.run(1.0);
        let resets = b.machine.stats().resets;
        let [(at_s, _)] = resets[..] else { panic!("{resets:?}") };
        let crashed = cause == ResetCause::Software;
        assert!(crashed || (0.2..0.6).contains(&(at_s - began_s)), "reset {} s later", at_s - began_s);
        b.run(3.0);
        b.greet();
        let last = b.last.unwrap();
        assert_eq!((last.state, last.fault, last.twist_rad), (State::Fault, Some(raised), None));
        let identity = identity(&mut b);
        assert_eq!((identity.reset_cause, identity.boot_count), (cause, 2));
        let panic = identity.last_panic.unwrap_or_default();
        assert_eq!(panic.starts_with("hard fault at 0x08"), crashed, "{panic}");
        assert_eq!(b.ask(&Request::HOME), Err(Refusal::InFault { fault: raised }));
        b.ask(&Request::Clear).unwrap();
        assert!(b.until(6.0, |b| b.state() == State::Unhomed));
    }
}

#[test]
fn the_board_uses_and_keeps_a_table_that_it_is_sent_and_falls_back() {
    let mut b = Bench::new(&[], 9);
    b.home();
    moves(&mut b, 0.004);
    let (built_in, gap) = (identity(&mut b).table, b.machine.board().truth().gap_m);
    assert!(!built_in.sent && built_in.crc == host_tests::table().crc, "firmware and desktop have the same table");

    // Another law, another envelope and another accuracy, of more powers than the built-in one.
    let mut scene = host_tests::scene().clone();
    scene.string.k2 *= 1.05;
    scene.envelope.as_mut().unwrap().load_n[1] *= 0.8;
    let fit = scene.fit_table().unwrap();
    let (ticks, start) = (b.machine.stats().tick.count, b.machine.now_s());
    assert_eq!(b.send_table(&fit.table.table()), Ok(true));
    let stats = b.machine.stats();
    let lost = (b.machine.now_s() - start) / 0.01 - (stats.tick.count - ticks) as f64;
    assert!(lost < 20.0, "{lost} ticks lost");
    // A quarter of the 64 KiB (memory.x) stays free.
    assert!(stats.stack_high_water_bytes < 48 * 1024, "{} B of stack", stats.stack_high_water_bytes);
    // Nothing moved, and nothing does before it is homed again.
    assert!((b.machine.board().truth().gap_m - gap).abs() < 30e-6);
    assert_eq!(b.state(), State::Unhomed);
    assert_eq!(b.ask(&go(0.012)), Err(Refusal::NotHomed));
    let table = identity(&mut b).table;
    assert!(table.sent && table.crc == fit.table.crc && table.load_max_n == fit.table.metadata.load_max_n);

    // Still there after a reset, and refused when a bit of it has flipped.
    let boots = |image: &[u8]| {
        let mut b = Bench::new(&[], 9);
        super::with_flash(&mut b, image);
        identity(&mut b).table
    };
    let mut image = b.machine.flash_image();
    assert_eq!(boots(&image), table);
    let words: Vec<usize> = super::STORE.filter(|k| image[*k] != 0xFF).collect();
    image[words[words.len() / 2]] ^= 4;
    assert_eq!(boots(&image), built_in);

    // As often as wanted between two starts; the newest is the one that is kept.
    for k in 1..4 {
        scene.string.k2 *= 1.0 + 0.001 * f64::from(k);
        let sent = scene.fit_table().unwrap().table;
        assert_eq!(b.send_table(&sent.table()), Ok(true));
        assert_eq!(boots(&b.machine.flash_image()).crc, sent.crc);
    }

    // What is no table is refused by name, and the one in use stays.
    let before = identity(&mut b).table;
    let mut record = [0; RECORD_MAX];
    let length = host_tests::table().write(&mut record).unwrap();
    for (place, refusal) in [(length - 1, TableRefusal::Damaged), (8, TableRefusal::Version)] {
        let mut damaged = record[..length].to_vec();
        damaged[place] ^= 4;
        assert_eq!(b.send_record(&damaged), Err(refusal));
    }
    let mut backwards = *host_tests::table();
    std::mem::swap(&mut backwards.metadata.load_min_n, &mut backwards.metadata.load_max_n);
    backwards.crc = backwards.checksum();
    assert_eq!(b.send_table(&backwards), Err(TableRefusal::Range));
    assert_eq!(identity(&mut b).table, before);
}
