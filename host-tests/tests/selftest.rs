//! The self-test's image on an emulated board without a rig: it passes there, and names whatever is broken on purpose.

use host_tests::board::{Bench, selftest};
use rig_emulator::jumpers::{self, Broken, End, Ends, Jumper, JumperBoard};
use rig_emulator::machine::{Config, Machine, ResetCause};
use rig_emulator::soc::can::Line;
use rig_link::messages::{Request, Setting};

/// Sectors 1 to 3 (src/flash_store.rs).
const STORE: std::ops::Range<usize> = 0x4000..0x1_0000;
const CHECKS: usize = 17;

fn board(broken: Broken, config: Config) -> Machine<JumperBoard> {
    Machine::new(&selftest(), JumperBoard::new(&Jumper::SELFTEST, broken), config).unwrap()
}

fn sound() -> Machine<JumperBoard> {
    board(Broken::default(), Config::default())
}

/// Runs it to its end; what it printed. `at` is given each line and the machine.
fn log(machine: &mut Machine<JumperBoard>, mut at: impl FnMut(&str, &mut Machine<JumperBoard>)) -> Vec<String> {
    let mut lines = Vec::new();
    let end = jumpers::run(machine, &Ends::selftest(), |line, machine| {
        lines.push(line.to_owned());
        at(line, machine);
    });
    let well = lines.last().is_some_and(|line| line.ends_with("checks ok"));
    assert_eq!(end, if well { End::Passed } else { End::Failed }, "{lines:#?}");
    lines
}

/// What, expected, seen, verdict.
fn rows(lines: &[String]) -> Vec<[String; 4]> {
    let rows = lines.iter().filter(|line| line.starts_with("| "));
    let cells = |line: &String| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let rows = rows.map(|line| <[String; 6]>::try_from(cells(line)).unwrap_or_else(|_| panic!("{line}")));
    // The first are the headings.
    rows.skip(1).map(|[_, what, expected, seen, verdict, _]| [what, expected, seen, verdict]).collect()
}

/// Exactly these rows are not ok; each with its verdict, and words that must be in what was seen.
fn names(lines: &[String], wanted: &[(&str, &str, &str)]) {
    let rows = rows(lines);
    assert_eq!(rows.len(), CHECKS, "{lines:#?}");
    for [what, _, seen, verdict] in &rows {
        match wanted.iter().find(|(name, ..)| name == what) {
            None => assert_eq!(verdict, "ok", "{what}: {lines:#?}"),
            Some((_, bad, words)) => {
                assert_eq!(verdict, bad, "{what}: {lines:#?}");
                assert!(seen.contains(words), "{what}: {seen}");
            }
        }
    }
    let end = lines.last().unwrap();
    assert!(
        !end.contains(" ok") && wanted.iter().all(|(name, bad, _)| end.contains(name) && end.contains(bad)),
        "{end}"
    );
}

fn is_named(mut machine: Machine<JumperBoard>, wanted: &[(&str, &str, &str)]) {
    names(&log(&mut machine, |_, _| {}), wanted);
}

#[test]
fn a_sound_board_passes_every_check() {
    let mut machine = sound();
    let lines = log(&mut machine, |_, _| {});
    let rows = rows(&lines);
    assert_eq!(rows.len(), CHECKS, "{lines:#?}");
    assert!(rows.iter().all(|[.., verdict]| verdict == "ok"), "{lines:#?}");
    assert_eq!(lines.last().unwrap(), &format!("selftest ended: all {CHECKS} checks ok"));
    assert!(lines.iter().any(|line| line.contains("unique id") && line.ends_with("the emulated board")), "{lines:#?}");
    let causes: Vec<ResetCause> = machine.stats().resets.iter().map(|(_, cause)| *cause).collect();
    assert_eq!(causes, [ResetCause::Software, ResetCause::Watchdog]);
    assert!(rows.iter().any(|[.., seen, _]| seen.contains("emulated: timing table")));
}

#[test]
fn another_chip_is_not_said_to_be_emulated() {
    let lines = log(&mut board(Broken::default(), Config { unique_id: [7; 12], ..Config::default() }), |_, _| {});
    assert!(lines.iter().all(|line| !line.contains("emulated")), "{lines:#?}");
    assert!(lines.iter().any(|line| line.contains(&"07".repeat(12))), "{lines:#?}");
}

#[test]
fn a_missing_jumper_or_a_stuck_input_is_named() {
    for (jumper, high, what, missing, stuck) in [
        (Jumper::ADC, true, "ADC1 A1 to A0", "A0 does not follow A1", "A0 is stuck high"),
        (Jumper::ENCODER_A, false, "TIM3 D12 and D11", "D12 does not follow D13", "D12 is stuck low"),
        (Jumper::ENCODER_B, true, "TIM3 D12 and D11", "D11 does not follow D10", "D11 is stuck high"),
        (Jumper::SERIAL, false, "USART1 D8 to D2", "D2 does not follow D8", "D2 is stuck low"),
        (Jumper::STOP, false, "power, stop D6 to D4", "D4 does not follow D6", "D4 is stuck low"),
        (Jumper::LIMITS, true, "limits D9 and D7", "D7 does not follow D9", "D7 is stuck high"),
        (Jumper::CAN, true, "CAN1 D14 to D15", "D15 does not follow D14", "D15 is stuck high"),
    ] {
        let none = Broken::default();
        is_named(
            board(Broken { missing: Some(jumper), ..none }, Config::default()),
            &[(what, "not connected", missing)],
        );
        is_named(board(Broken { stuck: Some((jumper, high)), ..none }, Config::default()), &[(what, "FAILED", stuck)]);
    }
}

/// What works as a pin and not as what it is for, an LSI out of its range, a watchdog that does not bite, a CAN controller that
/// hears nothing, a bus that is held dominant, which is nothing to a controller in loop-back, and another clock than the
/// ST-LINK's.
#[test]
fn whatever_else_is_broken_is_named() {
    let none = Broken::default();
    for (broken, what, words) in [
        (Broken { adc_gain: -0.05, ..none }, "ADC1 A1 to A0", "high 3890"),
        (Broken { vrefint_gain: 0.1, ..none }, "ADC1 VREFINT", "3.0"),
        (Broken { vrefint_gain: -0.1, ..none }, "ADC1 VREFINT", "3.6"),
        (Broken { serial_flips: 0x10, ..none }, "USART1 D8 to D2", "0 came back unchanged"),
        (Broken { edges_lost: 5, ..none }, "TIM3 D12 and D11", "counts"),
        (Broken { can_inverted: true, ..none }, "CAN1 D14 to D15", "inverted"),
    ] {
        is_named(board(broken, Config::default()), &[(what, "FAILED", words)]);
    }
    for (lsi_hz, wanted) in [
        (60_000.0, &[("LSI", "FAILED", "60.0 kHz")][..]),
        (10_000.0, &[("LSI", "FAILED", "10.0 kHz")]),
        // Nothing measures it then.
        (1.0, &[("watchdog", "FAILED", "3.0"), ("LSI", "FAILED", "")]),
    ] {
        is_named(board(none, Config { lsi_hz, ..Config::default() }), wanted);
    }
    type Change = fn(&mut Machine<JumperBoard>);
    for (change, what, words) in [
        ((|m| m.soc_mut().can.numb()) as Change, "CAN1 loop-back", "0 came back"),
        (|m| m.soc_mut().set_can_line(Line { dominant: true, open: false }), "CAN1 D14 to D15", "initialisation"),
        (|m| m.feed_hse(false), "clock", "no clock from the ST-LINK"),
    ] {
        let mut machine = sound();
        change(&mut machine);
        is_named(machine, &[(what, "FAILED", words)]);
    }
}

#[test]
fn flash_that_does_not_keep_is_named() {
    let mut machine = sound();
    let empty = machine.flash_image();
    let lines = log(&mut machine, |line, machine| {
        if line.starts_with("selftest 2") {
            machine.set_flash_image(&empty).unwrap();
        }
    });
    names(&lines, &[("flash store", "FAILED", "lost in the reset")]);
}

#[test]
fn what_is_no_store_is_left_alone() {
    let mut machine = sound();
    let mut image = machine.flash_image();
    image[STORE].fill(0x5A);
    machine.set_flash_image(&image).unwrap();
    names(&log(&mut machine, |_, _| {}), &[("flash store", "FAILED", "not touched")]);
    assert!(machine.flash_image() == image);
}

#[test]
fn a_damaged_table_is_named() {
    // The solver finds the gap that the damaged table does not.
    let rig_table = host_tests::table();
    let bytes: Vec<u8> = rig_table.series.coefficients.iter().flat_map(|c| c.to_le_bytes()).collect();
    let mut elf = selftest();
    let at = elf.windows(bytes.len()).position(|w| w == bytes).expect("the table stands in the ELF");
    // A power of two in the coefficient that the gap depends on most.
    let sizes = rig_table.series.coefficients.iter().map(|c| c.abs());
    let (max, _) = sizes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).expect("coefficients");
    elf[at + 4 * max + 3] ^= 0x01;
    let mut machine =
        Machine::new(&elf, JumperBoard::new(&Jumper::SELFTEST, Broken::default()), Config::default()).unwrap();
    let lines = log(&mut machine, |_, _| {});
    // The firmware's controller refuses it.
    names(&lines, &["tick cached", "tick uncached"].map(|what| (what, "FAILED", "fault")));
}

#[test]
fn a_panic_is_the_result() {
    let mut machine = sound();
    let mut crashed = false;
    let lines = log(&mut machine, |line, machine| {
        if line.starts_with("selftest 3") && !std::mem::replace(&mut crashed, true) {
            machine.crash().unwrap();
        }
    });
    assert!(lines.last().unwrap().ends_with("FAILED: the image"), "{lines:#?}");
    assert!(rows(&lines)[0][2].contains("hard fault at"), "{lines:#?}");
    // The next run is a new one.
    machine.power_cycle();
    assert!(log(&mut machine, |_, _| {}).last().unwrap().ends_with("checks ok"));
}

#[test]
fn a_test_that_is_cut_short_begins_anew() {
    let mut machine = sound();
    let mut cuts = 0;
    let lines = log(&mut machine, |line, machine| {
        // In the wait for the bite, and at the end.
        if (line.starts_with("selftest 2") && cuts == 0) || (line.starts_with("selftest 3") && cuts == 1) {
            cuts += 1;
            machine.power_cycle();
        }
    });
    assert_eq!(lines.iter().filter(|line| line.starts_with("selftest 1")).count(), 3, "{lines:#?}");
    assert!(lines.last().unwrap().ends_with("checks ok"), "{lines:#?}");
}

#[test]
fn a_reset_with_another_cause_than_the_test_s_own_is_named() {
    // Once or twice it could have been a hand on the button.
    let mut machine = sound();
    let mut resets = 0;
    let lines = log(&mut machine, |line, machine| {
        if line.starts_with("selftest 2") && resets < 3 {
            resets += 1;
            machine.soc_mut().reset_request = Some(ResetCause::Watchdog);
        }
    });
    assert_eq!(lines.iter().filter(|line| line.starts_with("selftest 1")).count(), 3, "{lines:#?}");
    names(&lines, &[("software reset", "FAILED", "IWDG, PIN")]);
}

#[test]
fn settings_that_a_user_has_kept_stay_and_the_test_can_be_run_again() {
    let set = Request::SetSetting { setting: Setting::SpeedMax, value: 0.003 };
    let mut bench = Bench::new(&[], 1);
    bench.ready();
    bench.set(&set).unwrap();
    let mut flash = bench.machine.flash_image();
    for _ in 0..2 {
        let mut machine = sound();
        machine.set_flash_image(&flash).unwrap();
        assert!(log(&mut machine, |_, _| {}).last().unwrap().ends_with("checks ok"));
        flash = machine.flash_image();
    }
    let mut bench = Bench::new(&[], 1);
    bench.machine.set_flash_image(&flash).unwrap();
    bench.machine.power_cycle();
    bench.greet();
    let kept = bench.settings();
    assert!((kept.values.get(Setting::SpeedMax) - 0.003).abs() < 1e-9, "{kept:?}");
}
