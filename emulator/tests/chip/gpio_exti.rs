//! GPIO, SYSCFG and EXTI (RM0390 chapters 7, 8, 10).

use crate::fixture::*;
use rig_plant::board::Stimulus;

const EXTI: u32 = 0x4001_3C00;
const IMR: u32 = EXTI;
const RTSR: u32 = EXTI + 8;
const FTSR: u32 = EXTI + 0xC;
const SWIER: u32 = EXTI + 0x10;
const PR: u32 = EXTI + 0x14;
const EXTICR: u32 = 0x4001_3808;

fn drive(chip: &mut Chip, port: char, pin: u8, high: bool) {
    chip.stimulate(Stimulus::Pin { port, pin, high });
}

#[test]
fn set_and_reset_reach_the_board_only_through_outputs() {
    let mut chip = chip();
    set(&mut chip, GPIOB + 0x18, 1 << 10);
    assert!(chip.board.outputs.is_empty());
    mode(&mut chip, GPIOB, 10, 1);
    set(&mut chip, GPIOB + 0x18, 1 << (10 + 16));
    let levels: Vec<_> = chip.board.outputs.iter().map(|(_, port, levels)| (*port, *levels)).collect();
    assert_eq!(levels, [('B', 1 << 10), ('B', 0)]);
    set(&mut chip, GPIOC + 0x18, 0x0001_0001);
    assert_eq!(get(&mut chip, GPIOC + 0x14), 1, "setting wins over resetting");
}

#[test]
fn a_reset_of_the_chip_lets_go_of_the_pins() {
    let mut chip = chip();
    mode(&mut chip, GPIOB, 10, 1);
    set(&mut chip, GPIOB + 0x18, 1 << 10);
    chip.reset(rig_emulator::soc::ResetCause::Software);
    assert_eq!(chip.board.outputs.last().map(|(_, port, levels)| (*port, *levels)), Some(('B', 0)));
}

#[test]
fn inputs_show_the_board_or_the_pull() {
    let mut chip = chip();
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 0);
    set(&mut chip, GPIOB + 0xC, 1 << 10);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 1);
    drive(&mut chip, 'B', 5, false);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 0);
    drive(&mut chip, 'B', 5, true);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 1);
    mode(&mut chip, GPIOB, 5, 3);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 0, "an analog pin reads 0");
}

#[test]
fn an_open_drain_output_pulls_low_and_otherwise_leaves_the_pin_alone() {
    let mut chip = chip();
    set(&mut chip, GPIOB + 4, 1 << 5);
    set(&mut chip, GPIOB + 0x18, 1 << 5);
    mode(&mut chip, GPIOB, 5, 1);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 0, "nothing pulls it up");
    set(&mut chip, GPIOB + 0xC, 1 << 10);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 1, "its own pull-up");
    drive(&mut chip, 'B', 5, false);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 0, "another open-drain output on the wire");
    drive(&mut chip, 'B', 5, true);
    set(&mut chip, GPIOB + 0x18, 1 << (5 + 16));
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 0);
    chip.stimulate(Stimulus::Release { port: 'B', pin: 5 });
    set(&mut chip, GPIOB + 0x18, 1 << 5);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 1);
}

#[test]
fn the_chosen_edge_of_the_chosen_port_interrupts() {
    // PB5 rising, PA8 falling, PC13 both.
    let mut chip = chip();
    set(&mut chip, EXTICR + 4, 1 << 4);
    set(&mut chip, EXTICR + 12, 2 << 4);
    set(&mut chip, RTSR, 1 << 5 | 1 << 13);
    set(&mut chip, FTSR, 1 << 8 | 1 << 13);
    set(&mut chip, IMR, 1 << 5 | 1 << 8 | 1 << 13);
    drive(&mut chip, 'A', 5, true);
    drive(&mut chip, 'A', 8, true);
    assert_eq!(get(&mut chip, PR), 0, "wrong port, wrong edge");
    drive(&mut chip, 'B', 5, true);
    drive(&mut chip, 'A', 8, false);
    drive(&mut chip, 'C', 13, true);
    assert_eq!(get(&mut chip, PR), 1 << 5 | 1 << 8 | 1 << 13);
    assert!(pending(&mut chip, 23) && pending(&mut chip, 40));
    set(&mut chip, PR, 1 << 5);
    assert_eq!(get(&mut chip, PR), 1 << 8 | 1 << 13);
}

#[test]
fn a_masked_line_is_remembered_but_does_not_interrupt() {
    let mut chip = chip();
    set(&mut chip, EXTICR + 4, 2 << 12);
    set(&mut chip, RTSR, 1 << 7);
    drive(&mut chip, 'C', 7, true);
    assert_eq!(get(&mut chip, PR), 1 << 7);
    assert!(!pending(&mut chip, 23));
    set(&mut chip, IMR, 1 << 7);
    assert!(pending(&mut chip, 23));
}

#[test]
fn software_raises_a_line_once_until_its_flag_is_cleared() {
    let mut chip = chip();
    set(&mut chip, IMR, 1 << 3);
    set(&mut chip, SWIER, 1 << 3);
    assert_eq!((get(&mut chip, PR), get(&mut chip, SWIER)), (1 << 3, 1 << 3));
    assert!(pending(&mut chip, 9));
    // Clearing the flag clears SWIER as well, so that the next write is a new edge.
    set(&mut chip, PR, 1 << 3);
    assert_eq!((get(&mut chip, PR), get(&mut chip, SWIER)), (0, 0));
    set(&mut chip, SWIER, 1 << 3);
    assert_eq!(get(&mut chip, PR), 1 << 3);
}

#[test]
fn the_board_acts_at_its_own_time() {
    let mut chip = chip();
    let at = chip.clock.seconds() + 1e-3;
    chip.board.plan.push_back((at, Stimulus::Pin { port: 'B', pin: 5, high: true }));
    pass(&mut chip, 0.9e-3);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 0);
    pass(&mut chip, 0.2e-3);
    assert_eq!(get(&mut chip, GPIOB + 0x10) >> 5 & 1, 1);
}
