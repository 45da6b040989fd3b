//! USART (RM0390 chapter 25).

use crate::fixture::*;
use rig_plant::board::Stimulus;

const USART2: u32 = 0x4000_4400;
const SR: u32 = USART2;
const DR: u32 = USART2 + 4;
const BRR: u32 = USART2 + 8;
const CR1: u32 = USART2 + 0xC;
const CR2: u32 = USART2 + 0x10;
const CR3: u32 = USART2 + 0x14;
const IRQ: u32 = 38;
const ICPR1: u32 = 0xE000_E284;
/// Ten bits at 115200 baud from a 16 MHz clock, divided by 139.
const FRAME_S: f64 = 10.0 * 139.0 / 16e6;

fn console() -> Chip {
    let mut chip = chip();
    alternate(&mut chip, GPIOA, 2, 7);
    alternate(&mut chip, GPIOA, 3, 7);
    set(&mut chip, BRR, 139);
    set(&mut chip, CR1, 0x200C);
    chip
}

fn receive(chip: &mut Chip, bytes: &[u8]) {
    chip.stimulate(Stimulus::Uart { usart: 2, bytes: bytes.to_vec() });
}

#[test]
fn transmit_flags_tell_the_data_register_from_the_line() {
    let mut chip = console();
    assert_eq!(get(&mut chip, SR) & 0xC0, 0xC0);
    set(&mut chip, DR, 1);
    // The first byte is in the shift register at once.
    assert_eq!(get(&mut chip, SR) & 0xC0, 0x80);
    set(&mut chip, DR, 2);
    assert_eq!(get(&mut chip, SR) & 0xC0, 0x00);
    pass(&mut chip, 1.5 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0xC0, 0x80);
    pass(&mut chip, FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0xC0, 0xC0);
    assert_eq!(chip.board.bytes.iter().map(|b| b.2).collect::<Vec<_>>(), [1, 2]);
    assert!(!pending(&mut chip, IRQ));
    set(&mut chip, CR1, 0x208C);
    assert!(pending(&mut chip, IRQ), "TXEIE");
}

#[test]
fn received_bytes_interrupt_and_are_read() {
    let mut chip = console();
    set(&mut chip, CR1, 0x202C);
    receive(&mut chip, b"AB");
    pass(&mut chip, 0.9 * FRAME_S);
    assert!(!pending(&mut chip, IRQ));
    pass(&mut chip, 0.2 * FRAME_S);
    assert!(pending(&mut chip, IRQ));
    assert_eq!(get(&mut chip, DR), u32::from(b'A'));
    assert_eq!(get(&mut chip, SR) & 0x20, 0);
    pass(&mut chip, FRAME_S);
    assert_eq!(get(&mut chip, DR), u32::from(b'B'));
}

#[test]
fn an_overrun_keeps_the_older_byte_and_goes_only_by_sr_then_dr() {
    let mut chip = console();
    set(&mut chip, CR1, 0x202C);
    receive(&mut chip, b"XYZ");
    pass(&mut chip, 4.0 * FRAME_S);
    // Without a look at SR the byte is read, and the overrun stays; so does its interrupt, which RXNEIE enables.
    assert_eq!(get(&mut chip, DR), u32::from(b'X'));
    set(&mut chip, ICPR1, 1 << (IRQ - 32));
    assert!(pending(&mut chip, IRQ));
    assert_eq!(get(&mut chip, SR) & 0x28, 0x08);
    get(&mut chip, DR);
    assert_eq!(get(&mut chip, SR) & 0x28, 0);
    set(&mut chip, ICPR1, 1 << (IRQ - 32));
    assert!(!pending(&mut chip, IRQ));
    // The lost bytes are lost; the next one comes as ever.
    receive(&mut chip, b"A");
    pass(&mut chip, 1.5 * FRAME_S);
    assert_eq!((get(&mut chip, SR) & 0x28, get(&mut chip, DR)), (0x20, u32::from(b'A')));
}

#[test]
fn the_error_interrupt_is_for_dma_reception_alone() {
    let mut chip = console();
    set(&mut chip, CR3, 1);
    receive(&mut chip, b"XY");
    pass(&mut chip, 3.0 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 8, 8);
    assert!(!pending(&mut chip, IRQ), "EIE without DMAR");
}

#[test]
fn idle_comes_once_until_another_byte_has_come_and_interrupts() {
    let mut chip = console();
    set(&mut chip, CR1, 0x201C);
    receive(&mut chip, b"AB");
    pass(&mut chip, 2.5 * FRAME_S);
    assert!(!pending(&mut chip, IRQ), "no gap between the two");
    pass(&mut chip, FRAME_S);
    assert!(pending(&mut chip, IRQ));
    assert_eq!(get(&mut chip, SR) & 0x10, 0x10);
    get(&mut chip, DR);
    pass(&mut chip, 10.0 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x10, 0, "the line is idle all the time, and that is no news");
    receive(&mut chip, b"C");
    pass(&mut chip, 2.5 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x10, 0x10);
}

#[test]
fn rxne_and_tc_go_by_writing_zero_and_nothing_else_does() {
    let mut chip = console();
    receive(&mut chip, b"ABC");
    set(&mut chip, DR, 1);
    pass(&mut chip, 5.0 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0xF8, 0xF8);
    // A strict board stops at that: whoever does it loses bytes.
    chip.write(SR, 4, 0);
    assert!(refused(&mut chip).contains("RXNE"));
    assert_eq!(get(&mut chip, SR) & 0xF8, 0x98, "TXE, IDLE and ORE stay");
    // TC also goes by a look at SR and a write to DR.
    set(&mut chip, DR, 1);
    pass(&mut chip, 2.0 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x40, 0x40);
    set(&mut chip, DR, 1);
    assert_eq!(get(&mut chip, SR) & 0x40, 0);
}

#[test]
fn oversampling_by_eight_and_a_second_stop_bit() {
    for (cr1, brr, cr2, bits) in [(0x2008, 139, 0, 10.0), (0xA008, 17 << 4 | 3, 0, 10.0), (0x2008, 139, 2 << 12, 11.0)]
    {
        let mut chip = console();
        set(&mut chip, CR1, 0);
        set(&mut chip, BRR, brr);
        set(&mut chip, CR2, cr2);
        set(&mut chip, CR1, cr1);
        let start_s = chip.clock.seconds();
        set(&mut chip, DR, 0x55);
        pass(&mut chip, 1e-3);
        let (t_s, usart, byte) = chip.board.bytes[0];
        assert_eq!((usart, byte), (2, 0x55));
        close(t_s - start_s, bits * 139.0 / 16e6, 1e-6);
    }
}

#[test]
fn a_receiver_that_is_off_hears_nothing() {
    let mut chip = console();
    set(&mut chip, CR1, 0x2008);
    receive(&mut chip, b"A");
    pass(&mut chip, 3.0 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x30, 0);
}
