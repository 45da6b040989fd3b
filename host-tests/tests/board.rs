//! The real firmware on the emulated board: the whole chain, and what comes from outside.

use host_tests::board::{Bench, HELLO};
use rand::{RngExt, SeedableRng};
use rig_link::messages::{Fault, LoadChoice, Refusal, Request, ResetCause, Setting, State, TableRefusal};
use rig_link::{PROTOCOL_HASH, Versions};
use rig_plant::RigFault;
use rig_plant::board::{CanFrame, Stimulus};
use tsa_table::record::RECORD_MAX;

const MOVE: Request = Request::Move { target_m: 0.012, speed_m_per_s: 0.002, load: LoadChoice::Auto };

#[test]
fn homes_and_moves_a_load_it_was_not_told_of() {
    for (load, twist, seed) in [("0.15kg", "-25", 1), ("1.4kg", "40", 2)] {
        let mut b = Bench::new(&[("load", load), ("twist_at_boot", twist)], seed);
        let homing = b.home();
        assert!(homing < 45.0);
        b.ask(&MOVE).unwrap();
        assert!(b.until(20.0, |b| b.state() == State::Holding), "{:?}", b.last);
        b.run(1.0);
        let error = b.true_position_m() - 0.012;
        let seen = f64::from(b.last.unwrap().load_n.unwrap()) / b.machine.board().truth().load_n - 1.0;
        let stats = b.machine.stats();
        println!(
            "{load}: homed in {homing:.1} s, {:+.1} um at rest, load {:+.1} %, core busy {:.2} %, tick {:.0} instructions \
             mean, {} at most, stack {} B",
            error * 1e6,
            seen * 100.0,
            stats.core_busy * 100.0,
            stats.tick.instructions_mean,
            stats.tick.instructions_max,
            stats.stack_high_water_bytes
        );
        assert!(error.abs() < 50e-6 && seen.abs() < 0.08);
        assert!(stats.core_busy < 0.10);
        // One tick every 10 ms, none lost.
        let expected = b.machine.now_s() / 0.01;
        assert!((stats.tick.count as f64 - expected).abs() < 3.0, "{} ticks of {expected}", stats.tick.count);
        assert!(stats.resets.is_empty() && stats.warnings.is_empty());
    }
}

/// Instructions that no tick may take: 5 % of its 10 ms at an instruction a cycle.
const MOST_INSTRUCTIONS: u64 = 84_000;

/// Every state, and whatever works hardest in it.
#[test]
fn ticks_stay_short() {
    let mut b = Bench::new(&[("load", "0.15kg"), ("friction", "0.2"), ("twist_at_boot", "20")], 13);
    let mut seen = Vec::new();
    let mut after = |b: &Bench, what: &'static str| {
        let most = b.machine.stats().tick.instructions_max;
        println!("{most:5} at most after {what}");
        seen.push((what, most));
    };
    b.home();
    after(&b, "homing");
    let go = |target_m: f32, speed_m_per_s: f32| Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto };
    b.ask(&go(0.012, 0.002)).unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding));
    after(&b, "a move");
    // Turned back in mid-move, more than once and sooner than a forecast is made, faster than the motor.
    b.ask(&go(0.001, 0.02)).unwrap();
    b.run(0.8);
    for (target_m, load) in [(0.010, 1.0), (0.0098, 1.6), (0.004, 2.2), (0.012, 1.2)] {
        b.ask(&Request::Move { target_m, speed_m_per_s: 0.02, load: LoadChoice::Known(load) }).unwrap();
        b.run(0.33);
    }
    after(&b, "new targets");
    b.ask(&go(0.006, 0.002)).unwrap();
    b.run(1.0);
    b.machine.board_mut().set_plant("load", "0.4kg").unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding));
    after(&b, "another load");
    b.ask(&go(0.010, 0.002)).unwrap();
    b.run(1.5);
    b.ask(&Request::Stop).unwrap();
    assert!(b.until(5.0, |b| b.state() == State::Holding));
    b.ask(&Request::Jog { twist_speed_rad_per_s: 2.0 }).unwrap();
    b.run(1.0);
    b.ask(&Request::Stop).unwrap();
    b.run(1.0);
    after(&b, "stop and jog");
    let values = b.settings().values.with(Setting::LvdtGain, 1.01).with(Setting::GearScale, 1.01);
    b.set(&Request::SetSettings(values)).unwrap();
    after(&b, "settings");
    b.machine.board_mut().set_fault(RigFault::LvdtOpen, true);
    assert!(b.until(1.0, |b| b.state() == State::Fault));
    b.run(0.5);
    after(&b, "a fault");
    for (what, seen) in seen {
        assert!(seen < MOST_INSTRUCTIONS, "{seen} after {what}: {}", b.longest_tick);
    }
}

/// What no scenario thinks of: requests of all kinds at any time, refused ones too, under loads that change; now and then
/// several at once by a host that does not wait for its answers.
#[test]
fn ticks_stay_short_whatever_is_asked() {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let mut b = Bench::new(&[("load", "0.5kg"), ("friction", "0.1")], 5);
    b.home();
    let (mut load_kg, mut next_kg, mut wait_s, mut refused) = (0.5f64, 0.5f64, 0.0, 0);
    let end_s = b.machine.now_s() + 120.0;
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
    println!("{refused} requests refused; longest: {}", b.longest_tick);
    assert!(refused > 10 && b.longest_tick.instructions < MOST_INSTRUCTIONS, "{}", b.longest_tick);
}

#[test]
fn noise_on_the_link_and_strangers_on_the_bus_are_ignored_and_counted() {
    let mut b = Bench::new(&[], 3);
    b.home();
    let before = b.machine.board().truth().twist_rad;
    let mut x = 0x2545_f491u32;
    for k in 0..300 {
        let noise: Vec<u8> = (0..20)
            .map(|_| {
                x ^= x << 13;
                x ^= x >> 17;
                x ^= x << 5;
                (x >> 24) as u8
            })
            .collect();
        b.raw(noise);
        // Ours by its id but too short, somebody else's, and one with 29 bits that looks like ours.
        for (id, extended, dlc) in [(0x01B, false, 4), (0x123, false, 8), (0x01B, true, 8)] {
            b.machine.send(Stimulus::Can(CanFrame { id, extended, remote: false, dlc, data: [k as u8; 8] }));
        }
        b.step();
        if k % 50 == 49 {
            // A delimiter ends whatever the noise began; the next good message is not lost.
            b.raw(vec![0]);
            assert!(b.ask(&Request::Status).is_ok());
        }
    }
    let counters = b.last.unwrap().counters;
    assert!(counters.link_errors > 10, "{counters:?}");
    assert!(counters.foreign_frames >= 250, "{counters:?}");
    assert_eq!(b.state(), State::Ready);
    assert!((b.machine.board().truth().twist_rad - before).abs() < 0.01, "something moved");
    b.ask(&MOVE).unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding));
}

#[test]
fn a_tool_of_another_build_is_refused_politely_but_may_stop() {
    let mut b = Bench::new(&[], 4);
    assert!(b.until(5.0, |b| b.state() == State::Unhomed));
    let mismatch = Err(Refusal::NotGreeted);
    let another = Versions::new(PROTOCOL_HASH ^ 1, "9.8.7", "");
    assert_eq!(b.ask(&Request::HOME), mismatch);
    assert_eq!(b.ask(&Request::Hello(another)), mismatch);
    let board = b.versions.expect("it greets every tool");
    let message = another.check_board(&board).expect_err("another protocol").to_string();
    assert!(message.contains("9.8.7") && message.contains(board.git()) && !board.git().is_empty(), "{message}");
    assert!(b.identity.is_none(), "nothing that another tool could misread");
    assert_eq!(b.ask(&Request::HOME), mismatch);
    assert!(b.ask(&Request::Stop).is_ok());
    assert!(b.ask(&HELLO).is_ok());
    b.run(0.1);
    let identity = b.identity.clone().unwrap();
    assert_eq!(identity.scene_hash, host_tests::scene().hash());
    assert_eq!(identity.reset_cause, ResetCause::PowerOn);
    assert_eq!(identity.table.crc, host_tests::table().crc, "firmware and desktop have the same table");
    assert!(b.ask(&Request::HOME).is_ok());
}

#[test]
fn a_lost_host_ends_a_motion_in_hold() {
    let mut b = Bench::new(&[], 5);
    b.home();
    b.ask(&MOVE).unwrap();
    b.run(2.0);
    b.heartbeat = false;
    assert!(b.until(0.6, |b| b.last.is_some_and(|t| t.fault == Some(Fault::HostSilent))));
    let position = b.true_position_m();
    b.run(3.0);
    assert!((b.true_position_m() - position).abs() < 0.1e-3);
}

#[test]
fn rig_faults_reach_the_firmware() {
    for (fault, expected) in [
        (RigFault::CanSilent, Fault::DriveSilent),
        (RigFault::LvdtOpen, Fault::LvdtOpen),
        (RigFault::DriveStall, Fault::DriveStall),
    ] {
        let mut b = Bench::new(&[], 6);
        assert!(b.until(5.0, |b| b.state() == State::Unhomed));
        b.machine.board_mut().set_fault(fault, true);
        assert!(b.until(1.0, |b| b.state() == State::Fault), "{fault:?}");
        assert_eq!(b.last.unwrap().fault, Some(expected));
    }
    let mut b = Bench::new(&[], 7);
    assert!(b.until(5.0, |b| b.state() == State::Unhomed));
    b.machine.board_mut().set_fault(RigFault::Estop, true);
    assert!(b.until(0.1, |b| b.state() == State::EStop));
}

#[test]
fn a_hung_core_is_reset_by_the_watchdog_and_stays_in_fault() {
    let mut b = Bench::new(&[], 12);
    b.home();
    b.ask(&MOVE).unwrap();
    b.run(2.0);
    let hung_at = b.machine.now_s();
    let twist = b.machine.board().truth().twist_rad;
    b.machine.hang(true);
    b.machine.run_until(hung_at + 0.4).unwrap();
    // The drive stops at its last target instead of running on.
    let moved = (b.machine.board().truth().twist_rad - twist).abs();
    assert!(moved < 1.3, "the motor went on for {moved} rad");
    b.run(0.6);
    let resets = b.machine.stats().resets;
    assert_eq!(resets.len(), 1, "{resets:?}");
    let after_s = resets[0].0 - hung_at;
    assert!((0.2..0.6).contains(&after_s), "reset {after_s} s after the hang");
    b.run(4.0);
    let last = b.last.unwrap();
    assert_eq!((last.state, last.fault), (State::Fault, Some(Fault::WatchdogReset)));
    assert_eq!(last.twist_rad, None);
    b.ask(&HELLO).unwrap();
    b.run(0.1);
    let identity = b.identity.clone().unwrap();
    assert_eq!((identity.reset_cause, identity.boot_count), (ResetCause::Watchdog, 2));
    assert_eq!(b.ask(&Request::HOME), Err(Refusal::InFault { fault: Fault::WatchdogReset }));
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed));
}

#[test]
fn a_fault_of_the_core_is_kept_over_the_reset_and_told() {
    let mut b = Bench::new(&[], 13);
    b.home();
    b.ask(&MOVE).unwrap();
    b.run(2.0);
    let before = b.machine.board().drive().counters.restarts;
    b.machine.crash().unwrap();
    b.run(0.2);
    let resets = b.machine.stats().resets;
    assert_eq!(resets.len(), 1, "{resets:?}");
    let last = b.last.unwrap();
    assert_eq!((last.state, last.fault, last.twist_rad), (State::Fault, Some(Fault::Panicked), None));
    // Stopped before anything else is said to it: until then it stood at its last target.
    assert!(b.machine.board().drive().counters.restarts > before);
    assert_eq!(b.machine.board().drive().mode(), None);
    b.ask(&HELLO).unwrap();
    b.run(0.1);
    let identity = b.identity.clone().unwrap();
    assert_eq!((identity.reset_cause, identity.boot_count), (ResetCause::Software, 2));
    let text = identity.last_panic.unwrap();
    println!("{text}");
    assert!(text.starts_with("hard fault at 0x08"), "{text}");
    b.run(3.0);
    assert_eq!(b.ask(&Request::HOME), Err(Refusal::InFault { fault: Fault::Panicked }));
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed));
}

#[test]
fn after_a_power_cycle_the_twist_is_unknown() {
    let mut b = Bench::new(&[], 8);
    b.home();
    b.machine.board_mut().power_cycle();
    b.machine.power_cycle();
    b.run(0.05);
    assert!(b.until(6.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert_eq!(b.last.unwrap().twist_rad, None);
    b.home();
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let run = |seed| {
        let mut b = Bench::new(&[("twist_at_boot", "6")], seed);
        b.home();
        b.bytes
    };
    assert_eq!(run(9), run(9));
    assert_ne!(run(9), run(10));
}

#[test]
fn the_board_uses_and_keeps_a_table_that_it_is_sent_and_falls_back() {
    let mut b = Bench::new(&[], 9);
    b.home();
    b.ask(&Request::Move { target_m: 0.004, speed_m_per_s: 0.002, load: LoadChoice::Auto }).unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding), "{:?}", b.last);
    let (built_in, gap) = (b.identity.clone().unwrap().table, b.machine.board().truth().gap_m);
    assert!(!built_in.sent);

    // Another law, another envelope and another accuracy, of more powers than the built-in one.
    let mut scene = host_tests::scene().clone();
    scene.string.k2 *= 1.05;
    scene.envelope.as_mut().unwrap().load_n[1] *= 0.8;
    let fit = scene.fit_table().unwrap();
    let (ticks, start) = (b.machine.stats().tick.count, b.machine.now_s());
    assert_eq!(b.send_table(&fit.table.table()), Ok(true));
    let lost = (b.machine.now_s() - start) / 0.01 - (b.machine.stats().tick.count - ticks) as f64;
    let stats = b.machine.stats();
    println!(
        "{lost:.0} ticks lost, core busy {:.0} %, stack {} B",
        stats.core_busy * 100.0,
        stats.stack_high_water_bytes
    );
    assert!(lost < 20.0, "{lost} ticks lost");
    // A quarter of the 64 KiB (memory.x) stays free.
    assert!(stats.stack_high_water_bytes < 48 * 1024, "{} B of stack", stats.stack_high_water_bytes);
    // Nothing moved, and nothing does before it is homed again.
    assert!((b.machine.board().truth().gap_m - gap).abs() < 30e-6);
    assert_eq!(b.state(), State::Unhomed);
    assert_eq!(b.ask(&MOVE), Err(Refusal::NotHomed));
    b.identity = None;
    b.ask(&Request::Status).unwrap();
    assert!(b.until(0.1, |b| b.identity.is_some()));
    let table = b.identity.clone().unwrap().table;
    assert!(table.sent && table.crc == fit.table.crc && table.load_max_n == fit.table.metadata.load_max_n);

    // Still there after a reset, and refused when a bit of it has flipped.
    let image = b.machine.flash_image();
    let boots = |image: &[u8]| {
        let mut b = Bench::new(&[], 9);
        b.machine.set_flash_image(image).unwrap();
        b.machine.power_cycle();
        b.run(0.3);
        b.ask(&HELLO).unwrap();
        assert!(b.until(0.5, |b| b.identity.is_some()));
        b.identity.clone().unwrap().table
    };
    assert_eq!(boots(&image), table);
    let words: Vec<usize> = (0x4000..0x1_0000).filter(|k| image[*k] != 0xFF).collect();
    let mut broken = image.clone();
    broken[words[words.len() / 2]] ^= 4;
    assert_eq!(boots(&broken), built_in);

    // As often as wanted between two starts; the newest is the one that is kept.
    for k in 0..5 {
        scene.string.k2 *= 1.001 + 0.001 * f64::from(k);
        let sent = scene.fit_table().unwrap().table;
        assert_eq!(b.send_table(&sent.table()), Ok(true));
        assert_eq!(boots(&b.machine.flash_image()).crc, sent.crc);
    }

    // What is no table is refused by name, and the one in use stays.
    b.ask(&Request::Status).unwrap();
    b.run(0.1);
    let before = b.identity.clone().unwrap().table;
    let mut record = [0; RECORD_MAX];
    let length = host_tests::table().write(&mut record).unwrap();
    let damaged = |place: usize| {
        let mut record = record[..length].to_vec();
        record[place] ^= 4;
        record
    };
    assert_eq!(b.send_record(&damaged(length - 1)), Err(TableRefusal::Damaged));
    assert_eq!(b.send_record(&damaged(8)), Err(TableRefusal::Version));
    let mut backwards = *host_tests::table();
    std::mem::swap(&mut backwards.metadata.load_min_n, &mut backwards.metadata.load_max_n);
    backwards.crc = backwards.checksum();
    assert_eq!(b.send_table(&backwards), Err(TableRefusal::Range));
    b.ask(&Request::Status).unwrap();
    b.run(0.1);
    assert_eq!(b.identity.clone().unwrap().table, before);
}
