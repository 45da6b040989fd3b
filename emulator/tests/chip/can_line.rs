//! CAN1 and a bus that is not as it should be: dominant, not there, or at another rate (ISO 11898-1).

use crate::can::*;
use crate::fixture::*;
use rig_emulator::soc::can::Line;

/// Out of initialisation on a wire with a fault, and whether the controller has joined the bus a second later.
fn joins(line: Line, pull: u32) -> (Chip, bool) {
    let mut chip = node(0);
    set(&mut chip, GPIOB + 0xC, pull << 16);
    set(&mut chip, MCR, 1);
    chip.set_can_line(line);
    set(&mut chip, MCR, 0);
    pass(&mut chip, 1.0);
    let joined = get(&mut chip, MSR) & 1 == 0;
    (chip, joined)
}

#[test]
fn it_joins_no_bus_that_is_dominant_and_does_when_the_bus_is_released() {
    let (mut chip, joined) = joins(Line { dominant: true, open: false }, 1);
    assert!(!joined);
    // A driver that asks again and again writes the register each time.
    set(&mut chip, MCR, 0);
    chip.set_can_line(Line::default());
    pass(&mut chip, 9.0 * BIT_S);
    assert_eq!(get(&mut chip, MSR) & 1, 1);
    pass(&mut chip, 3.0 * BIT_S);
    assert_eq!(get(&mut chip, MSR) & 1, 0);
    receive(&mut chip, frame(0x123));
    assert_eq!(get(&mut chip, RF0R) & 3, 1);
}

#[test]
fn a_pin_that_nothing_drives_follows_its_pull() {
    let open = Line { dominant: false, open: true };
    assert!(!joins(open, 0).1 && !joins(open, 2).1);
    let (mut chip, joined) = joins(open, 1);
    assert!(joined);
    // Nobody hears it, and it hears nobody.
    transmit(&mut chip, 0, 0x123);
    receive(&mut chip, frame(0x123));
    pass(&mut chip, 0.1);
    assert_eq!((get(&mut chip, ESR) >> 2 & 1, get(&mut chip, RF0R) & 3, chip.board.frames.len()), (1, 0, 0));
}

#[test]
fn a_bus_that_becomes_dominant_ends_in_bus_off_and_recovers_when_released() {
    let mut chip = node(ABOM);
    chip.set_can_line(Line { dominant: true, open: false });
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 0.1);
    assert_eq!(get(&mut chip, ESR) >> 2 & 1, 1, "bus-off");
    pass(&mut chip, 1.0);
    assert_eq!(get(&mut chip, ESR) >> 2 & 1, 1, "no recovery on a dominant bus");
    chip.set_can_line(Line::default());
    pass(&mut chip, 1e-2);
    assert_eq!((get(&mut chip, ESR) >> 2 & 1, chip.board.frames.len()), (0, 1));
}

#[test]
fn a_clock_that_is_off_is_followed_as_far_as_the_bit_timing_allows() {
    // 16 MHz by 2 and 1 + 5 + 2 quanta: 1.25 % with a jump of one, 1.96 % with two.
    for (hsi_hz, jump, follows) in
        [(16_180_000, 0, true), (16_220_000, 0, false), (16_220_000, 1, true), (16_400_000, 1, false)]
    {
        let mut chip = node(0);
        chip.set_hsi(hsi_hz);
        set(&mut chip, MCR, 1);
        set(&mut chip, BTR, jump << 24 | 1 << 20 | 4 << 16 | 1);
        set(&mut chip, MCR, 0);
        pass(&mut chip, 20.0 * BIT_S);
        receive(&mut chip, frame(0x123));
        transmit(&mut chip, 0, 0x123);
        pass(&mut chip, 1e-3);
        let passed = (get(&mut chip, RF0R) & 3 == 1, chip.board.frames.len() == 1);
        assert_eq!(passed, (follows, follows), "{hsi_hz} {jump}");
    }
    // Another rate altogether: 500 kbit/s.
    let mut chip = node(0);
    set(&mut chip, MCR, 1);
    set(&mut chip, BTR, 1 << 20 | 4 << 16 | 3);
    set(&mut chip, MCR, 0);
    pass(&mut chip, 40.0 * BIT_S);
    receive(&mut chip, frame(0x123));
    assert_eq!(get(&mut chip, RF0R) & 3, 0);
}
