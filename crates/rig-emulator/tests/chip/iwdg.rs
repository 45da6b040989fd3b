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
fn it_starts_from_the_counters_reset_value() {
    let mut chip = watchdog();
    set(&mut chip, KR, 0xCCCC);
    let start_s = chip.clock.seconds();
    pass(&mut chip, 1.0);
    close(chip.clock.seconds() - start_s, 4096.0 * 4.0 / 32_000.0, 1e-4);
}

#[test]
fn nothing_happens_before_the_start_and_without_the_key() {
    let mut chip = watchdog();
    set(&mut chip, KR, 0xAAAA);
    set(&mut chip, RLR, 1);
    assert_eq!(get(&mut chip, RLR), 3999);
    pass(&mut chip, 5.0);
    assert_eq!(chip.reset_request, None);
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
