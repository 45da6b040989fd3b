//! Flash programming and erasing (RM0390 chapter 3).

use crate::fixture::*;
use rig_emulator::soc::ResetCause;

const KEYR: u32 = 0x4002_3C04;
const SR: u32 = 0x4002_3C0C;
const CR: u32 = 0x4002_3C10;
const SECTOR_3: u32 = 0x0800_C000;
const WORDWISE: u32 = 2 << 8;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const EOP: u32 = 1;
const OPERR: u32 = 1 << 1;
const PGAERR: u32 = 1 << 5;
const PGPERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;

fn unlocked() -> Chip {
    unlocked_of(&Config::default())
}

fn unlocked_of(config: &Config) -> Chip {
    let mut chip = chip_of(config);
    set(&mut chip, KEYR, 0x4567_0123);
    set(&mut chip, KEYR, 0xCDEF_89AB);
    chip
}

fn word(chip: &Chip, address: u32) -> u32 {
    chip.memory.flash.word(address).expect("in flash")
}

#[test]
fn a_wrong_key_locks_until_reset() {
    let mut chip = chip();
    set(&mut chip, KEYR, 1);
    set(&mut chip, KEYR, 0x4567_0123);
    set(&mut chip, KEYR, 0xCDEF_89AB);
    assert_eq!(get(&mut chip, CR) >> 31, 1);
    chip.reset(ResetCause::Software);
    set(&mut chip, KEYR, 0x4567_0123);
    set(&mut chip, KEYR, 0xCDEF_89AB);
    assert_eq!(get(&mut chip, CR) >> 31, 0);
}

#[test]
fn the_keys_come_in_order_and_a_lock_needs_them_anew() {
    let mut chip = chip();
    set(&mut chip, CR, 1);
    assert_eq!(get(&mut chip, CR), 1 << 31);
    set(&mut chip, KEYR, 0xCDEF_89AB);
    set(&mut chip, KEYR, 0x4567_0123);
    assert_eq!(get(&mut chip, CR) >> 31, 1);
    let mut chip = unlocked();
    assert_eq!(get(&mut chip, CR), 0);
    set(&mut chip, CR, 1 | WORDWISE | 1 << 31);
    // Locked, the register takes nothing, nor does the memory.
    set(&mut chip, CR, 2 | 3 << 3);
    set(&mut chip, CR, 2 | 3 << 3 | 1 << 16);
    assert_eq!(get(&mut chip, CR), 1 | WORDWISE | 1 << 31);
    chip.program_flash(SECTOR_3, 4, 0);
    assert_eq!((get(&mut chip, SR), word(&chip, SECTOR_3)), (PGSERR, 0xFFFF_FFFF));
    set(&mut chip, KEYR, 0x4567_0123);
    set(&mut chip, KEYR, 0xCDEF_89AB);
    set(&mut chip, SR, PGSERR);
    chip.program_flash(SECTOR_3, 4, 0);
    assert_eq!((get(&mut chip, SR), word(&chip, SECTOR_3)), (0, 0));
}

#[test]
fn programming_clears_bits_and_takes_time() {
    let mut chip = unlocked();
    set(&mut chip, CR, 1 | WORDWISE);
    let start_s = chip.clock.seconds();
    chip.program_flash(SECTOR_3, 4, 0xFFFF_0F0F);
    chip.program_flash(SECTOR_3, 4, 0x00FF_FFFF);
    assert_eq!(word(&chip, SECTOR_3), 0x00FF_0F0F);
    close(chip.clock.seconds() - start_s, 32e-6, 1e-6);
    assert_eq!(get(&mut chip, SR), 0);
}

#[test]
fn a_sector_erases_alone_and_takes_its_time() {
    for (sector, start, size, width, slow, seconds) in [
        (3u32, SECTOR_3, 0x4000, WORDWISE, false, 0.25),
        (3, SECTOR_3, 0x4000, WORDWISE, true, 0.5),
        (3, SECTOR_3, 0x4000, 0, false, 0.4),
        (3, SECTOR_3, 0x4000, 0, true, 0.8),
        (4, 0x0801_0000, 0x1_0000, WORDWISE, false, 0.55),
        (7, 0x0806_0000, 0x2_0000, WORDWISE, false, 1.0),
    ] {
        let mut chip = unlocked_of(&Config { slow_flash: slow, ..Config::default() });
        set(&mut chip, CR, 1 | WORDWISE);
        chip.program_flash(start - 4, 4, 0x1111_1111);
        chip.program_flash(start, 4, 0x2222_2222);
        chip.program_flash(start + size - 4, 4, 0x3333_3333);
        set(&mut chip, CR, 2 | sector << 3 | width);
        let start_s = chip.clock.seconds();
        set(&mut chip, CR, 2 | sector << 3 | width | 1 << 16);
        close(chip.clock.seconds() - start_s, seconds, 1e-6);
        assert_eq!(word(&chip, start - 4), 0x1111_1111);
        assert_eq!(word(&chip, start), 0xFFFF_FFFF);
        assert_eq!(word(&chip, start + size - 4), 0xFFFF_FFFF);
    }
}

#[test]
fn an_erase_that_cannot_be_is_an_error_and_erases_nothing() {
    // While programming is on; a sector that is not there; without SER; by 64 bits, for which there is no voltage.
    for (cr, error) in [(1 | 2 | 3 << 3, PGSERR), (2 | 8 << 3, PGSERR), (3 << 3, PGSERR), (2 | 3 << 3 | 3 << 8, PGPERR)]
    {
        let mut chip = unlocked();
        set(&mut chip, CR, 1 | WORDWISE);
        chip.program_flash(SECTOR_3, 4, 0x1234_5678);
        set(&mut chip, CR, cr);
        let start_s = chip.clock.seconds();
        set(&mut chip, CR, cr | 1 << 16);
        assert_eq!((get(&mut chip, SR), word(&chip, SECTOR_3)), (error, 0x1234_5678), "CR {cr:#x}");
        close(chip.clock.seconds() - start_s, 0.0, 1e-6);
    }
}

#[test]
fn the_end_of_an_operation_shows_only_with_its_interrupt_enabled() {
    let mut chip = unlocked();
    set(&mut chip, CR, 1 | WORDWISE | EOPIE);
    chip.program_flash(SECTOR_3, 4, 0);
    assert_eq!(get(&mut chip, SR), EOP);
    // Flags go by writing 1.
    set(&mut chip, SR, 0);
    assert_eq!(get(&mut chip, SR), EOP);
    set(&mut chip, SR, EOP);
    assert_eq!(get(&mut chip, SR), 0);
    set(&mut chip, CR, 2 | 3 << 3 | EOPIE);
    set(&mut chip, CR, 2 | 3 << 3 | EOPIE | 1 << 16);
    assert_eq!(get(&mut chip, SR), EOP);
}

#[test]
fn errors_name_themselves_and_show_as_operation_errors_only_with_their_interrupt_enabled() {
    let attempt = |cr: u32, address: u32, size: usize| {
        let mut chip = unlocked();
        set(&mut chip, CR, cr);
        chip.program_flash(address, size, 0);
        assert_eq!(word(&chip, SECTOR_3), 0xFFFF_FFFF);
        get(&mut chip, SR)
    };
    assert_eq!(attempt(1 | WORDWISE, SECTOR_3 + 2, 4), PGAERR);
    assert_eq!(attempt(1 | WORDWISE, SECTOR_3, 2), PGPERR);
    assert_eq!(attempt(1 | WORDWISE | ERRIE, SECTOR_3 + 2, 4), PGAERR | OPERR);
    assert_eq!(attempt(1 | WORDWISE | ERRIE, SECTOR_3, 1), PGPERR | OPERR);
    // A wrong sequence is no operation at all.
    assert_eq!(attempt(ERRIE, SECTOR_3, 4), PGSERR);
}

#[test]
fn the_brown_out_reset_is_off_as_delivered_and_outlives_a_reset() {
    let mut chip = chip();
    // No sector is write-protected either (nWRP).
    assert_eq!(get(&mut chip, 0x4002_3C14), 0x0FFF_AAED);
    for (level, code) in [(1, 2), (2, 1), (3, 0)] {
        chip.flash.set_brown_out_level(level);
        chip.reset(ResetCause::PowerCycle);
        assert_eq!(get(&mut chip, 0x4002_3C14) >> 2 & 3, code);
    }
}
