//! RCC and PWR (RM0390 chapters 5 and 6).

use crate::fixture::*;
use rig_emulator::soc::ResetCause;

const CR: u32 = RCC;
const PLLCFGR: u32 = RCC + 4;
const CFGR: u32 = RCC + 8;
const CSR: u32 = RCC + 0x74;
const FLASH_ACR: u32 = 0x4002_3C00;

fn to_168_mhz(chip: &mut Chip) {
    set(chip, CR, 0x0005_0083);
    set(chip, PLLCFGR, 7 << 24 | 1 << 22 | 168 << 6 | 4);
    set(chip, CR, 0x0105_0083);
    set(chip, FLASH_ACR, 5);
    set(chip, CFGR, 4 << 13 | 5 << 10 | 2);
}

#[test]
fn ready_flags_follow_their_switches_both_ways() {
    let mut chip = chip();
    assert_eq!(get(&mut chip, CR) & 2, 2);
    set(&mut chip, CR, 0x0005_0001);
    assert_eq!(get(&mut chip, CR), 0x0007_0003);
    set(&mut chip, CR, 0x0000_0001);
    assert_eq!(get(&mut chip, CR), 3);
    set(&mut chip, CSR, 1);
    assert_eq!(get(&mut chip, CSR) & 3, 3);
}

#[test]
fn the_projects_clock_tree_is_168_42_84() {
    let mut chip = chip();
    to_168_mhz(&mut chip);
    assert_eq!(get(&mut chip, CFGR) >> 2 & 3, 2);
    let tree = chip.clock.tree();
    assert_eq!((tree.hclk_hz, tree.apb1_divider, tree.apb2_divider), (168_000_000, 4, 2));
    assert_eq!((chip.clock.timer_divider(false), chip.clock.timer_divider(true)), (2, 1));
}

#[test]
fn a_new_clock_does_not_move_time() {
    let mut chip = chip();
    pass(&mut chip, 0.01);
    let before_s = chip.clock.seconds();
    to_168_mhz(&mut chip);
    close(chip.clock.seconds(), before_s, 2e-6);
    pass(&mut chip, 0.01);
    close(chip.clock.seconds(), before_s + 0.01, 2e-6);
}

#[test]
fn without_a_clock_on_osc_in_neither_hse_nor_its_pll_becomes_ready() {
    let mut chip = chip();
    assert!(chip.rcc.feed_hse(false), "the core runs on HSI");
    set(&mut chip, PLLCFGR, 7 << 24 | 1 << 22 | 168 << 6 | 4);
    set(&mut chip, CR, 0x0105_0083);
    pass(&mut chip, 1.0);
    assert_eq!(get(&mut chip, CR), 0x0105_0083);
    chip.write(CFGR, 4, 2);
    assert!(chip.faults.take().is_some_and(|fault| fault.to_string().contains("not ready")));
    // From HSI the same PLL runs.
    set(&mut chip, CFGR, 0);
    set(&mut chip, CR, 0x0005_0083);
    set(&mut chip, PLLCFGR, 7 << 24 | 168 << 6 | 8);
    set(&mut chip, CR, 0x0105_0083);
    assert_eq!(get(&mut chip, CR), 0x0305_0083);
    set(&mut chip, FLASH_ACR, 5);
    set(&mut chip, CFGR, 4 << 13 | 5 << 10 | 2);
    assert_eq!(chip.clock.tree().hclk_hz, 168_000_000);
    assert!(chip.rcc.feed_hse(false), "nor on HSE now");
}

#[test]
fn power_on_and_software_resets_set_their_flags() {
    let mut chip = chip();
    assert_eq!(get(&mut chip, CSR) >> 24, 0x0E);
    set(&mut chip, CSR, 1 << 24);
    chip.reset(ResetCause::Software);
    assert_eq!(get(&mut chip, CSR) >> 24, 0x14);
    chip.reset(ResetCause::PowerCycle);
    assert_eq!(get(&mut chip, CSR) >> 24, 0x0E);
}

#[test]
fn a_peripheral_reset_bit_resets() {
    let mut chip = chip();
    set(&mut chip, 0x4000_0C34, 123);
    set(&mut chip, RCC + 0x20, 1 << 3);
    set(&mut chip, RCC + 0x20, 0);
    assert_eq!(get(&mut chip, 0x4000_0C34), 0);
}

#[test]
fn over_drive_becomes_ready() {
    let mut chip = chip();
    set(&mut chip, 0x4000_7000, 0x3_C000);
    assert_eq!(get(&mut chip, 0x4000_7004) & 0x3_4000, 0x3_4000);
}

#[test]
fn systick_counts_and_pends() {
    let mut chip = chip();
    set(&mut chip, 0xE000_E014, 15_999);
    set(&mut chip, 0xE000_E018, 0);
    set(&mut chip, 0xE000_E010, 7);
    pass(&mut chip, 0.5e-3);
    let value = get(&mut chip, 0xE000_E018);
    assert!((7_900..8_100).contains(&value), "{value}");
    assert_eq!(get(&mut chip, 0xE000_ED04) >> 26 & 1, 0);
    pass(&mut chip, 0.6e-3);
    assert_eq!(get(&mut chip, 0xE000_ED04) >> 26 & 1, 1);
    assert_eq!(get(&mut chip, 0xE000_E010) >> 16 & 1, 1);
    assert_eq!(get(&mut chip, 0xE000_E010) >> 16 & 1, 0, "COUNTFLAG is cleared by reading");
}

#[test]
fn a_late_clock_at_osc_in_comes_150_ms_after_power_on() {
    const HSERDY: u32 = 1 << 17;
    let mut chip = chip();
    chip.hse_late = true;
    // HSEON with bypass.
    let ready_after = |chip: &mut Chip, seconds: f64| {
        set(chip, RCC, 0x0005_0083);
        pass(chip, seconds);
        get(chip, RCC) & HSERDY != 0
    };
    assert!(!ready_after(&mut chip, 0.14));
    assert!(ready_after(&mut chip, 0.02));
    chip.reset(ResetCause::Software);
    assert!(ready_after(&mut chip, 0.0), "a reset does not stop the ST-LINK");
    chip.reset(ResetCause::PowerCycle);
    assert!(!ready_after(&mut chip, 0.14));
    assert!(ready_after(&mut chip, 0.02));
    chip.hse_late = false;
    chip.reset(ResetCause::PowerCycle);
    assert!(ready_after(&mut chip, 0.0));
}
