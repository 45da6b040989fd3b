//! What the strict chip refuses, and that the lax one only counts it.

use crate::fixture::*;
use rig_emulator::soc::Soc;
use rig_emulator::soc::fault::Fault;

#[test]
fn a_peripheral_without_its_clock() {
    let mut chip = Soc::new(Recorder::default(), true, 32_000.0);
    chip.write(GPIOA, 4, 1);
    assert_eq!(chip.faults.take(), Some(Fault::Unclocked { unit: "GPIOA".into(), address: GPIOA, write: true }));
    chip.read(0x4000_6404, 4);
    assert_eq!(chip.faults.take(), Some(Fault::Unclocked { unit: "CAN1".into(), address: 0x4000_6404, write: false }));
}

#[test]
fn an_unmodelled_peripheral_and_register() {
    let mut chip = chip();
    // I2C1, and a hole in the GPIO block.
    for address in [0x4000_5400, GPIOA + 0x28] {
        chip.write(address, 4, 1);
        assert_eq!(chip.faults.take(), Some(Fault::Unmodelled { address, write: true }));
        chip.read(address, 4);
        assert_eq!(chip.faults.take(), Some(Fault::Unmodelled { address, write: false }));
    }
}

#[test]
fn a_narrow_write_to_a_word_register() {
    let mut chip = chip();
    chip.write(RCC + 0x30, 1, 1);
    assert_eq!(chip.faults.take(), Some(Fault::Width { address: RCC + 0x30, size: 1 }));
}

#[test]
fn the_lax_chip_counts() {
    let mut chip = Soc::new(Recorder::default(), false, 32_000.0);
    chip.read(0x4000_5400, 4);
    chip.read(0x4000_5400, 4);
    assert!(!chip.faults.pending());
    assert_eq!(chip.faults.warnings().values().copied().collect::<Vec<_>>(), [2]);
}
