//! USART (RM0390 chapter 25).

use crate::fixture::*;
use rig_emulator::board::Stimulus;

const USART2: u32 = 0x4000_4400;
const SR: u32 = USART2;
const DR: u32 = USART2 + 4;
const BRR: u32 = USART2 + 8;
const CR1: u32 = USART2 + 0xC;
const IRQ: u32 = 38;
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
fn a_byte_takes_ten_bits() {
    let mut chip = console();
    let start_s = chip.clock.seconds();
    set(&mut chip, DR, 0x55);
    pass(&mut chip, 1e-3);
    let (t_s, usart, byte) = chip.board.bytes[0];
    assert_eq!((usart, byte), (2, 0x55));
    close(t_s - start_s, FRAME_S, 1e-6);
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
}

#[test]
fn transmit_interrupts_follow_their_enables() {
    let mut chip = console();
    assert!(!pending(&mut chip, IRQ));
    set(&mut chip, CR1, 0x208C);
    assert!(pending(&mut chip, IRQ));
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
fn idle_comes_a_character_after_the_last_byte_and_is_cleared_by_sr_then_dr() {
    let mut chip = console();
    receive(&mut chip, b"A");
    pass(&mut chip, 1.5 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x10, 0);
    pass(&mut chip, FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x10, 0x10);
    get(&mut chip, DR);
    assert_eq!(get(&mut chip, SR) & 0x10, 0);
}

#[test]
fn a_byte_that_nobody_reads_makes_an_overrun() {
    let mut chip = console();
    receive(&mut chip, b"XYZ");
    pass(&mut chip, 4.0 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x28, 0x28);
    assert_eq!(get(&mut chip, DR), u32::from(b'X'));
    assert_eq!(get(&mut chip, SR) & 0x28, 0);
}

#[test]
fn a_receiver_that_is_off_hears_nothing() {
    let mut chip = console();
    set(&mut chip, CR1, 0x2008);
    receive(&mut chip, b"A");
    pass(&mut chip, 3.0 * FRAME_S);
    assert_eq!(get(&mut chip, SR) & 0x30, 0);
}

#[test]
fn the_pins_must_carry_the_usart() {
    let mut chip = console();
    alternate(&mut chip, GPIOA, 2, 8);
    chip.write(DR, 1, 1);
    assert!(chip.faults.take().is_some_and(|fault| fault.to_string().contains("USARTx_TX")));
    alternate(&mut chip, GPIOA, 3, 0);
    receive(&mut chip, b"A");
    let end = chip.clock.now() + 10_000;
    while chip.clock.now() < end {
        chip.sleep(end);
    }
    assert!(chip.faults.take().is_some_and(|fault| fault.to_string().contains("USARTx_RX")));
}
