//! Independent watchdog (RM0390 chapter 20).

use crate::fixture::*;
use rig_emulator::soc::ResetCause;

const KR: u32 = 0x4000_3000;
const PR: u32 = KR + 4;
const RLR: u32 = KR + 8;

/// 500 ms as embassy sets it up: prescaler 4, reload 3999.
fn watchdog() -> Chip {
    let mut chip = chip();
    set(&mut chip, KR, 0x5555);
    set(&mut chip, PR, 0);
    set(&mut chip, RLR, 3999);
    chip
}

#[test]
fn it_bites_when_it_is_not_fed() {
    let mut chip = watchdog();
    set(&mut chip, KR, 0xCCCC);
    set(&mut chip, KR, 0xAAAA);
    let start_s = chip.clock.seconds();
    pass(&mut chip, 0.4);
    set(&mut chip, KR, 0xAAAA);
    pass(&mut chip, 0.4);
    assert_eq!(chip.reset_request, None);
    pass(&mut chip, 0.2);
    assert_eq!(chip.reset_request, Some(ResetCause::Watchdog));
    close(chip.clock.seconds() - start_s, 0.9, 1e-3);
}

#[test]
fn a_reset_stops_it_and_sets_its_flag() {
    let mut chip = watchdog();
    set(&mut chip, KR, 0xCCCC);
    pass(&mut chip, 1.0);
    chip.reset(ResetCause::Watchdog);
    assert_eq!(get(&mut chip, RCC + 0x74) >> 24, 0x2E);
    set(&mut chip, RCC + 0x74, 1 << 24);
    assert_eq!(get(&mut chip, RCC + 0x74) >> 24, 0);
    pass(&mut chip, 5.0);
    assert_eq!(chip.reset_request, None);
}

#[test]
fn every_prescaler_divides_the_lsi() {
    for (code, divider) in [(0, 4.0), (1, 8.0), (2, 16.0), (3, 32.0), (4, 64.0), (5, 128.0), (6, 256.0), (7, 256.0)] {
        let mut chip = chip();
        set(&mut chip, KR, 0xCCCC);
        set(&mut chip, KR, 0x5555);
        set(&mut chip, PR, code);
        set(&mut chip, RLR, 99);
        set(&mut chip, KR, 0xAAAA);
        let start_s = chip.clock.seconds();
        pass(&mut chip, 2.0);
        assert_eq!(chip.reset_request, Some(ResetCause::Watchdog));
        close(chip.clock.seconds() - start_s, 100.0 * divider / 32_000.0, 1e-4);
    }
}

#[test]
fn any_other_key_closes_the_registers_again() {
    for key in [0xAAAA, 0xCCCC, 0x0000, 0x5554] {
        let mut chip = watchdog();
        assert_eq!((get(&mut chip, PR), get(&mut chip, RLR)), (0, 3999));
        set(&mut chip, KR, key);
        for (register, value) in [(PR, 6), (RLR, 1)] {
            chip.write(register, 4, value);
            assert!(chip.faults.take().is_some(), "key {key:#x}");
        }
        assert_eq!((get(&mut chip, PR), get(&mut chip, RLR)), (0, 3999), "key {key:#x}");
        pass(&mut chip, 5.0);
        assert_eq!(chip.reset_request.is_some(), key == 0xCCCC, "nothing else starts it");
    }
}

#[test]
fn once_started_it_is_neither_started_anew_nor_fed_by_a_wrong_key() {
    let mut chip = watchdog();
    set(&mut chip, KR, 0xCCCC);
    let start_s = chip.clock.seconds();
    pass(&mut chip, 0.3);
    for key in [0xCCCC, 0x5555, 0xAAAB, 0] {
        set(&mut chip, KR, key);
    }
    // A new reload value counts from the next feeding on.
    set(&mut chip, KR, 0x5555);
    set(&mut chip, RLR, 10);
    pass(&mut chip, 1.0);
    close(chip.clock.seconds() - start_s, 4096.0 * 4.0 / 32_000.0, 1e-4);
}

#[test]
fn an_update_takes_five_periods_of_an_lsi_that_runs() {
    const SR: u32 = KR + 0xC;
    let csr = RCC + 0x74;
    let mut chip = watchdog();
    // Off: indefinitely, which a program that waits for it would do too.
    pass(&mut chip, 1.0);
    assert_eq!(get(&mut chip, SR), 3);
    set(&mut chip, csr, 1);
    pass(&mut chip, 4.0 / 32_000.0);
    assert_eq!(get(&mut chip, SR), 3);
    pass(&mut chip, 2.0 / 32_000.0);
    assert_eq!(get(&mut chip, SR), 0);
    set(&mut chip, RLR, 100);
    assert_eq!(get(&mut chip, SR), 2);
    // The watchdog has the LSI on by itself.
    let mut chip = watchdog();
    set(&mut chip, KR, 0xCCCC);
    pass(&mut chip, 6.0 / 32_000.0);
    assert_eq!(get(&mut chip, SR), 0);
}

#[test]
fn the_registers_after_a_reset() {
    let mut chip = chip();
    assert_eq!([KR, PR, RLR, KR + 0xC].map(|register| get(&mut chip, register)), [0, 0, 0xFFF, 0]);
}
