//! Timers (RM0390 chapters 17 and 18).

use crate::fixture::*;

const TIM3: u32 = 0x4000_0400;
const TIM5: u32 = 0x4000_0C00;
const TIM12: u32 = 0x4000_1800;
const CR1: u32 = 0x00;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;

/// As embassy's time driver sets it up: 1 MHz, 16-bit reload, flags at 0x8000 and at overflow.
fn time_driver(timer: u32) -> Chip {
    let mut chip = chip();
    set(&mut chip, timer + PSC, 15);
    set(&mut chip, timer + ARR, 0xFFFF);
    set(&mut chip, timer + CR1, 4);
    set(&mut chip, timer + EGR, 1);
    set(&mut chip, timer + CR1, 0);
    set(&mut chip, timer + CCR1, 0x8000);
    set(&mut chip, timer + DIER, 3);
    set(&mut chip, timer + CR1, 1);
    chip
}

#[test]
fn update_by_software_spares_the_flag_with_urs() {
    let mut chip = chip();
    set(&mut chip, TIM3 + CR1, 4);
    set(&mut chip, TIM3 + EGR, 1);
    assert_eq!(get(&mut chip, TIM3 + SR), 0);
    set(&mut chip, TIM3 + CR1, 0);
    set(&mut chip, TIM3 + EGR, 1);
    assert_eq!(get(&mut chip, TIM3 + SR), 1);
}

#[test]
fn the_prescaler_waits_for_an_update_event() {
    let mut chip = chip();
    set(&mut chip, TIM3 + PSC, 1599);
    set(&mut chip, TIM3 + CR1, 1);
    pass(&mut chip, 1e-4);
    assert!(get(&mut chip, TIM3 + CNT) > 1590);
    set(&mut chip, TIM3 + EGR, 1);
    pass(&mut chip, 1e-2);
    assert_eq!(get(&mut chip, TIM3 + CNT), 100);
}

#[test]
fn half_and_full_overflow_interrupt_at_the_right_time() {
    for (timer, irq) in [(TIM5, 50), (TIM12, 43)] {
        let mut chip = time_driver(timer);
        pass(&mut chip, 0.0325);
        assert!(!pending(&mut chip, irq));
        pass(&mut chip, 0.0005);
        assert!(pending(&mut chip, irq));
        assert_eq!(get(&mut chip, timer + SR), 2);
        set(&mut chip, timer + SR, !2);
        pass(&mut chip, 0.0328);
        // CC2 matches at 0 with every overflow, interrupt or not.
        assert_eq!(get(&mut chip, timer + SR) & 0b101, 0b101);
    }
}

#[test]
fn flags_come_without_their_interrupt() {
    let mut chip = time_driver(TIM5);
    set(&mut chip, TIM5 + CCR2, 500);
    pass(&mut chip, 600e-6);
    assert_eq!(get(&mut chip, TIM5 + SR), 4);
    assert!(!pending(&mut chip, 50));
    assert_eq!(get(&mut chip, TIM5 + CNT), 600, "at the prescaled clock");
    set(&mut chip, TIM5 + DIER, 7);
    assert!(pending(&mut chip, 50));
    pass(&mut chip, 0.04);
    assert_eq!(get(&mut chip, TIM5 + SR), 6);
    set(&mut chip, TIM5 + SR, !4);
    assert_eq!(get(&mut chip, TIM5 + SR), 2, "zeros clear");
}

#[test]
fn a_32_bit_timer_is_one_and_a_16_bit_timer_is_not() {
    let mut chip = chip();
    set(&mut chip, TIM5 + CNT, 0x1234_5678);
    set(&mut chip, TIM3 + CNT, 0x1234_5678);
    assert_eq!(get(&mut chip, TIM5 + CNT), 0x1234_5678);
    assert_eq!(get(&mut chip, TIM3 + CNT), 0x5678);
}

/// The encoder interface as embassy's `Qei` sets it up.
fn encoder() -> Chip {
    let mut chip = chip();
    alternate(&mut chip, GPIOA, 6, 2);
    alternate(&mut chip, GPIOA, 7, 2);
    set(&mut chip, TIM3 + 0x18, 0x0101);
    set(&mut chip, TIM3 + CCER, 0x11);
    set(&mut chip, TIM3 + SMCR, 3);
    set(&mut chip, TIM3 + ARR, 0xFFFF);
    set(&mut chip, TIM3 + CR1, 1);
    chip
}

#[test]
fn the_encoder_follows_the_wheel_both_ways_and_wraps() {
    let mut chip = encoder();
    chip.board.wheel = 1000;
    assert_eq!(get(&mut chip, TIM3 + CNT), 1000);
    assert_eq!(get(&mut chip, TIM3 + CR1) & 0x10, 0);
    chip.board.wheel = -1;
    assert_eq!(get(&mut chip, TIM3 + CNT), 0xFFFF);
    assert_eq!(get(&mut chip, TIM3 + CR1) & 0x10, 0x10);
    chip.board.wheel = 0x1_0005;
    assert_eq!(get(&mut chip, TIM3 + CNT), 5);
    assert_eq!(get(&mut chip, TIM3 + CR1) & 0x10, 0);
    set(&mut chip, TIM3 + CNT, 0);
    chip.board.wheel += 3;
    assert_eq!(get(&mut chip, TIM3 + CNT), 3, "from what is written");
    // One inverted channel reverses it.
    set(&mut chip, TIM3 + CCER, 0x13);
    chip.board.wheel += 10;
    assert_eq!(get(&mut chip, TIM3 + CNT), 0xFFF9);
}

#[test]
fn a_stopped_encoder_misses_what_passes() {
    let mut chip = encoder();
    set(&mut chip, TIM3 + CR1, 0);
    chip.board.wheel = 10;
    assert_eq!(get(&mut chip, TIM3 + CNT), 0);
    set(&mut chip, TIM3 + CR1, 1);
    chip.board.wheel = 11;
    assert_eq!(get(&mut chip, TIM3 + CNT), 1);
}

#[test]
fn an_input_channel_has_no_compare_flag_and_neither_has_one_that_does_not_exist() {
    let mut chip = time_driver(TIM5);
    // CC1 is an input on TI1, not captured.
    set(&mut chip, TIM5 + 0x18, 1);
    set(&mut chip, TIM5 + CCR1, 100);
    set(&mut chip, TIM5 + CCR2, 200);
    pass(&mut chip, 0.001);
    assert_eq!(get(&mut chip, TIM5 + SR), 4);
    // TIM12 has two channels, so an overflow at 0 sets only theirs.
    let mut chip = time_driver(TIM12);
    pass(&mut chip, 0.07);
    assert_eq!(get(&mut chip, TIM12 + SR), 0b111);
    chip.write(TIM12 + 0x3C, 4, 1);
    assert_eq!(refused(&mut chip), "write of an unmodelled register of TIM12 at 0x4000183c");
}
