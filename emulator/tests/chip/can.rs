//! bxCAN (RM0390 chapter 30, ISO 11898-1).

use crate::fixture::*;
use rig_emulator::soc::can::wire::frame_bits;
use rig_plant::board::{CanFrame, CanOutcome, Stimulus};

const CAN: u32 = 0x4000_6400;
pub const MCR: u32 = CAN;
pub const MSR: u32 = CAN + 4;
const TSR: u32 = CAN + 8;
pub const RF0R: u32 = CAN + 0xC;
const RF1R: u32 = CAN + 0x10;
const IER: u32 = CAN + 0x14;
pub const ESR: u32 = CAN + 0x18;
pub const BTR: u32 = CAN + 0x1C;
const RI0R: u32 = CAN + 0x1B0;
const FMR: u32 = CAN + 0x200;
const FM1R: u32 = CAN + 0x204;
const FS1R: u32 = CAN + 0x20C;
const FFA1R: u32 = CAN + 0x214;
const FA1R: u32 = CAN + 0x21C;
const BANKS: u32 = CAN + 0x240;

const TXFP: u32 = 1 << 2;
const NART: u32 = 1 << 4;
const AWUM: u32 = 1 << 5;
pub const ABOM: u32 = 1 << 6;
const TME: u32 = 7 << 26;
pub const BIT_S: f64 = 1e-6;

pub fn frame(id: u32) -> CanFrame {
    CanFrame { id, extended: false, remote: false, dlc: 8, data: [1, 2, 3, 4, 5, 6, 7, 8] }
}

/// 1 Mbit/s from 16 MHz, pins on PB8 and PB9, everything accepted into FIFO 0, normal mode with `mcr`.
pub fn node(mcr: u32) -> Chip {
    let mut chip = chip();
    alternate(&mut chip, GPIOB, 8, 9);
    alternate(&mut chip, GPIOB, 9, 9);
    set(&mut chip, MCR, 1);
    assert_eq!(get(&mut chip, MSR) & 3, 1);
    // 2 x (1 + 5 + 2) quanta.
    set(&mut chip, BTR, 1 << 20 | 4 << 16 | 1);
    filter(&mut chip, |chip| {
        set(chip, FS1R, 1);
        set(chip, BANKS, 0);
        set(chip, BANKS + 4, 0);
        set(chip, FA1R, 1);
    });
    set(&mut chip, MCR, mcr);
    pass(&mut chip, 12.0 * BIT_S);
    assert_eq!(get(&mut chip, MSR) & 3, 0);
    chip
}

fn filter(chip: &mut Chip, set_up: impl FnOnce(&mut Chip)) {
    set(chip, FMR, 0x2A1C_0E01);
    set_up(chip);
    set(chip, FMR, 0x2A1C_0E00);
}

pub fn transmit(chip: &mut Chip, mailbox: u32, id: u32) {
    let base = CAN + 0x180 + 16 * mailbox;
    set(chip, base + 4, 8);
    set(chip, base + 8, 0x0403_0201);
    set(chip, base + 12, 0x0807_0605);
    set(chip, base, id << 21 | 1);
}

pub fn receive(chip: &mut Chip, frame: CanFrame) {
    chip.stimulate(Stimulus::Can(frame));
    pass(chip, 170.0 * BIT_S);
}

#[test]
fn frame_lengths_with_stuffing() {
    // 44 bits without data and stuffing, 108 with eight bytes (ISO 11898-1); at most (34 + 64 - 1) / 4 stuff bits.
    let empty = CanFrame { dlc: 0, data: [0; 8], ..frame(0x555) };
    assert!((44..=52).contains(&frame_bits(&empty)), "{}", frame_bits(&empty));
    let ones = CanFrame { data: [0x55; 8], ..frame(0x555) };
    assert!((108..=112).contains(&frame_bits(&ones)), "{}", frame_bits(&ones));
    let zeros = CanFrame { data: [0; 8], ..frame(0) };
    assert!((122..=132).contains(&frame_bits(&zeros)), "{}", frame_bits(&zeros));
    let extended = CanFrame { extended: true, data: [0x55; 8], ..frame(0x1555_5555) };
    assert!((128..=132).contains(&frame_bits(&extended)), "{}", frame_bits(&extended));
}

#[test]
fn leaving_initialisation_takes_eleven_recessive_bits() {
    let mut chip = node(0);
    set(&mut chip, MCR, 1);
    set(&mut chip, MCR, 0);
    pass(&mut chip, 9.0 * BIT_S);
    assert_eq!(get(&mut chip, MSR) & 1, 1);
    pass(&mut chip, 3.0 * BIT_S);
    assert_eq!(get(&mut chip, MSR) & 1, 0);
    set(&mut chip, MCR, 2);
    assert_eq!(get(&mut chip, MSR) & 3, 2);
}

#[test]
fn a_frame_goes_out_and_its_mailbox_reports() {
    let mut chip = node(0);
    set(&mut chip, IER, 1);
    assert_eq!(get(&mut chip, TSR), TME);
    let start_s = chip.clock.seconds();
    transmit(&mut chip, 0, 0x123);
    assert_eq!(get(&mut chip, TSR), 6 << 26 | 1 << 24);
    pass(&mut chip, 200.0 * BIT_S);
    let (t_s, sent) = chip.board.frames[0];
    assert_eq!(sent, frame(0x123));
    close(t_s - start_s, frame_bits(&sent) as f64 * BIT_S, 2e-6);
    assert_eq!(get(&mut chip, TSR), TME | 3);
    assert!(pending(&mut chip, 19));
    set(&mut chip, TSR, 1);
    assert_eq!(get(&mut chip, TSR), TME);
}

#[test]
fn mailboxes_go_by_identifier_or_in_order() {
    for (mcr, wanted) in [(0, [0x300, 0x100, 0x200]), (TXFP, [0x300, 0x200, 0x100])] {
        let mut chip = node(mcr);
        transmit(&mut chip, 0, 0x300);
        transmit(&mut chip, 1, 0x200);
        transmit(&mut chip, 2, 0x100);
        let tsr = get(&mut chip, TSR);
        assert_eq!(tsr & TME, 0);
        pass(&mut chip, 1e-3);
        // The first is on the wire before the others are ready.
        assert_eq!(chip.board.frames.iter().map(|f| f.1.id).collect::<Vec<_>>(), wanted);
    }
}

#[test]
fn a_lower_identifier_from_outside_wins_the_bus() {
    let mut chip = node(0);
    chip.stimulate(Stimulus::Can(frame(0x400)));
    chip.stimulate(Stimulus::Can(frame(0x100)));
    transmit(&mut chip, 0, 0x200);
    pass(&mut chip, 1e-3);
    let start_s = chip.board.frames[0].0;
    assert!(start_s > 3.0 * 108.0 * BIT_S, "two frames came first: {start_s}");
    assert_eq!(get(&mut chip, RF0R) & 3, 2);
}

#[test]
fn a_lone_node_retries_and_stays_error_passive() {
    let mut chip = node(0);
    chip.board.outcome = CanOutcome::Unacknowledged;
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 0.1);
    assert!(chip.board.frames.len() > 500, "{}", chip.board.frames.len());
    assert_eq!(get(&mut chip, ESR), 128 << 16 | 3 << 4 | 0b011);
    assert_eq!(get(&mut chip, TSR) & TME, 6 << 26);
    chip.board.outcome = CanOutcome::Acknowledged;
    pass(&mut chip, 1e-3);
    assert_eq!(get(&mut chip, TSR), TME | 3);
    assert_eq!(get(&mut chip, ESR), 127 << 16 | 1);
}

#[test]
fn with_nart_there_is_one_try() {
    let mut chip = node(NART);
    chip.board.outcome = CanOutcome::Unacknowledged;
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 0.01);
    assert_eq!(chip.board.frames.len(), 1);
    assert_eq!(get(&mut chip, TSR), TME | 1 | 8);
}

/// A node in another test mode: bits of BTR.
fn test_mode(bits: u32) -> Chip {
    let mut chip = node(0);
    set(&mut chip, MCR, 1);
    let timing = get(&mut chip, BTR);
    set(&mut chip, BTR, timing | bits);
    set(&mut chip, MCR, 0);
    pass(&mut chip, 12.0 * BIT_S);
    chip
}

const LOOP_BACK: u32 = 1 << 30;
const SILENT: u32 = 1 << 31;

#[test]
fn silent_in_loop_back_it_hears_itself_alone_and_the_bus_hears_nothing() {
    let mut chip = test_mode(LOOP_BACK | SILENT);
    mode(&mut chip, GPIOB, 8, 0);
    mode(&mut chip, GPIOB, 9, 0);
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 200.0 * BIT_S);
    assert_eq!(get(&mut chip, TSR), TME | 3);
    assert_eq!((get(&mut chip, RF0R) & 3, get(&mut chip, RI0R)), (1, 0x123 << 21));
    receive(&mut chip, frame(0x55));
    assert_eq!(get(&mut chip, RF0R) & 3, 1, "RX is disregarded");
    assert!(chip.board.frames.is_empty());
}

#[test]
fn silent_it_hears_the_bus_and_cannot_send() {
    let mut chip = test_mode(SILENT);
    transmit(&mut chip, 0, 0x123);
    receive(&mut chip, frame(0x55));
    assert_eq!((get(&mut chip, RF0R) & 3, get(&mut chip, RI0R)), (1, 0x55 << 21));
    pass(&mut chip, 0.01);
    assert!(chip.board.frames.is_empty());
    assert_eq!(get(&mut chip, TSR) & TME, 6 << 26, "the frame waits");
}

#[test]
fn in_loop_back_it_hears_itself_and_needs_no_acknowledgement() {
    let mut chip = test_mode(LOOP_BACK);
    chip.board.outcome = CanOutcome::Unacknowledged;
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 300.0 * BIT_S);
    assert_eq!(get(&mut chip, TSR), TME | 3);
    assert_eq!((get(&mut chip, RF0R) & 3, get(&mut chip, RI0R) >> 21), (1, 0x123));
    assert_eq!(get(&mut chip, ESR), 0);
}

#[test]
fn an_abort_takes_back_what_is_not_on_the_wire() {
    let mut chip = node(0);
    transmit(&mut chip, 0, 0x100);
    transmit(&mut chip, 1, 0x200);
    set(&mut chip, TSR, 1 << 15 | 1 << 7);
    assert_eq!(get(&mut chip, TSR) >> 8 & 0xFF, 1, "mailbox 1 is free without TXOK");
    assert_eq!(get(&mut chip, TSR) & 0xFF, 0x80, "mailbox 0 is on the wire");
    pass(&mut chip, 1e-3);
    assert_eq!(get(&mut chip, TSR) & 0xFF, 3, "and was sent");
    assert_eq!(chip.board.frames.len(), 1);
}

#[test]
fn an_abort_ends_retransmission() {
    let mut chip = node(0);
    chip.board.outcome = CanOutcome::Unacknowledged;
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 1e-3);
    set(&mut chip, TSR, 1 << 7);
    pass(&mut chip, 1e-3);
    assert_eq!(get(&mut chip, TSR), TME | 1);
}

#[test]
fn bit_errors_lead_to_bus_off_and_a_quiet_bus_out_of_it() {
    let mut chip = node(ABOM);
    set(&mut chip, IER, 1 << 15 | 1 << 10);
    chip.board.outcome = CanOutcome::BitError;
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 0.05);
    assert_eq!(chip.board.frames.len(), 32, "256 / 8 errors");
    assert_eq!(get(&mut chip, ESR) & 7, 7);
    assert_eq!(get(&mut chip, MSR) & 4, 4);
    assert!(pending(&mut chip, 22));
    set(&mut chip, MSR, 4);
    assert_eq!(get(&mut chip, MSR) & 4, 0);
    chip.board.outcome = CanOutcome::Acknowledged;
    chip.stimulate(Stimulus::CanQuiet);
    pass(&mut chip, 1400.0 * BIT_S);
    assert_eq!(get(&mut chip, ESR) & 4, 4, "128 x 11 bits are not over");
    pass(&mut chip, 200.0 * BIT_S);
    assert_eq!(get(&mut chip, ESR), 0);
    assert_eq!(chip.board.frames.len(), 33);
}

#[test]
fn without_abom_software_has_to_restart_it() {
    let mut chip = node(0);
    chip.board.outcome = CanOutcome::BitError;
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 0.05);
    chip.board.outcome = CanOutcome::Acknowledged;
    chip.stimulate(Stimulus::CanQuiet);
    pass(&mut chip, 0.05);
    assert_eq!(get(&mut chip, ESR) & 4, 4);
    set(&mut chip, MCR, 1);
    // In initialisation it does not listen, so the 128 x 11 recessive bits begin after it.
    pass(&mut chip, 0.01);
    assert_eq!(get(&mut chip, ESR) & 4, 4);
    set(&mut chip, MCR, 0);
    pass(&mut chip, 1400.0 * BIT_S);
    assert_eq!(get(&mut chip, ESR) & 4, 4);
    pass(&mut chip, 30.0 * BIT_S);
    assert_eq!(get(&mut chip, ESR), 0);
}

/// Of a frame only the eleven recessive bits from its ACK delimiter to the end of the pause count.
#[test]
fn traffic_delays_the_recovery_from_bus_off() {
    let mut chip = node(ABOM);
    chip.board.outcome = CanOutcome::BitError;
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 0.05);
    set(&mut chip, TSR, 1 << 7);
    chip.stimulate(Stimulus::CanQuiet);
    for _ in 0..10 {
        chip.stimulate(Stimulus::Can(frame(0x1B)));
    }
    let taken = 10 * (frame_bits(&frame(0x1B)) + 3);
    pass(&mut chip, (1408 + taken - 110 - 5) as f64 * BIT_S);
    assert_eq!(get(&mut chip, ESR) & 4, 4);
    assert_eq!(get(&mut chip, RF0R) & 3, 0, "nothing is received meanwhile");
    pass(&mut chip, 10.0 * BIT_S);
    assert_eq!(get(&mut chip, ESR), 0);
}

/// Eight up for an error, one down for a frame; warning at 96, passive at 128, off at 256.
#[test]
fn the_transmit_error_counter_and_what_it_leads_to() {
    let mut chip = node(NART);
    let try_once = |chip: &mut Chip, outcome| {
        chip.board.outcome = outcome;
        transmit(chip, 0, 0x123);
        pass(chip, 300.0 * BIT_S);
        get(chip, ESR)
    };
    for error in 1..=31u32 {
        let esr = try_once(&mut chip, CanOutcome::BitError);
        let flags = u32::from(8 * error >= 96) | u32::from(8 * error > 127) << 1;
        assert_eq!((esr >> 16 & 0xFF, esr & 7, esr >> 4 & 7), (8 * error, flags, 4), "error {error}");
    }
    // Down again, through both limits.
    for sent in 1..=160u32 {
        let esr = try_once(&mut chip, CanOutcome::Acknowledged);
        let count = 248 - sent;
        let flags = u32::from(count >= 96) | u32::from(count > 127) << 1;
        assert_eq!((esr >> 16 & 0xFF, esr & 7, esr >> 4 & 7), (count, flags, 0), "frame {sent}");
    }
    for _ in 0..20 {
        try_once(&mut chip, CanOutcome::BitError);
    }
    assert_eq!(get(&mut chip, ESR) & 4, 0, "88 + 160 are 248");
    assert_eq!(try_once(&mut chip, CanOutcome::BitError) & 7, 7);
}

#[test]
fn each_state_interrupts_by_its_own_enable() {
    // EWGIE, EPVIE, BOFIE: after how many errors each comes.
    for (enable, errors) in [(1 << 8, 12), (1 << 9, 16), (1 << 10, 32)] {
        let mut chip = node(NART);
        set(&mut chip, IER, enable | 1 << 15);
        chip.board.outcome = CanOutcome::BitError;
        for error in 1..=32 {
            transmit(&mut chip, 0, 0x123);
            pass(&mut chip, 300.0 * BIT_S);
            assert_eq!(get(&mut chip, MSR) & 4 != 0, error >= errors, "enable {enable:#x}, error {error}");
            assert_eq!(pending(&mut chip, 22), error >= errors);
        }
    }
}

#[test]
fn error_codes_interrupt_as_enabled() {
    let mut chip = node(NART);
    chip.board.outcome = CanOutcome::Unacknowledged;
    set(&mut chip, IER, 1 << 11);
    transmit(&mut chip, 0, 0x123);
    pass(&mut chip, 1e-3);
    assert_eq!(get(&mut chip, MSR) & 4, 4);
    assert!(!pending(&mut chip, 22), "ERRIE is off");
    set(&mut chip, IER, 1 << 11 | 1 << 15);
    assert!(pending(&mut chip, 22));
}

#[test]
fn a_received_frame_is_read_and_released() {
    let mut chip = node(0);
    set(&mut chip, IER, 1 << 1);
    receive(&mut chip, frame(0x1B));
    assert!(pending(&mut chip, 20));
    assert_eq!(get(&mut chip, RF0R), 1);
    assert_eq!(get(&mut chip, RI0R), 0x1B << 21);
    assert_eq!(get(&mut chip, RI0R + 4) & 0xF, 8);
    assert_eq!(get(&mut chip, RI0R + 8), 0x0403_0201);
    assert_eq!(get(&mut chip, RI0R + 12), 0x0807_0605);
    set(&mut chip, RF0R, 0x20);
    assert_eq!(get(&mut chip, RF0R), 0);
}

#[test]
fn a_full_fifo_overruns_and_keeps_the_newest_or_the_oldest() {
    for (mcr, kept) in [(0, [1, 2, 5]), (1 << 3, [1, 2, 3])] {
        let mut chip = node(mcr);
        for id in 1..=5 {
            receive(&mut chip, frame(id));
        }
        assert_eq!(get(&mut chip, RF0R), 3 | 1 << 3 | 1 << 4);
        for id in kept {
            assert_eq!(get(&mut chip, RI0R) >> 21, id);
            set(&mut chip, RF0R, 0x20);
        }
    }
}

#[test]
fn a_release_takes_full_back() {
    let mut chip = node(0);
    for id in 1..=3 {
        receive(&mut chip, frame(id));
    }
    assert_eq!(get(&mut chip, RF0R), 3 | 1 << 3);
    set(&mut chip, RF0R, 0x20);
    assert_eq!(get(&mut chip, RF0R), 2);
    // By software as well, without a release.
    receive(&mut chip, frame(4));
    set(&mut chip, RF0R, 1 << 3);
    assert_eq!(get(&mut chip, RF0R), 3);
}

#[test]
fn a_frame_on_the_bus_wakes_a_sleeping_controller_if_it_may() {
    for (awum, woken) in [(0, false), (AWUM, true)] {
        let mut chip = node(0);
        set(&mut chip, MCR, 2 | awum);
        set(&mut chip, IER, 1 << 1 | 1 << 16);
        assert_eq!(get(&mut chip, MSR) & 0x1F, 2);
        receive(&mut chip, frame(1));
        // WKUI either way, with its interrupt; SLEEP and SLAK only fall with AWUM.
        assert_eq!(get(&mut chip, MSR) & 0x1F, if woken { 8 } else { 8 | 2 });
        assert_eq!(get(&mut chip, MCR) & 2 == 0, woken);
        assert!(pending(&mut chip, 22));
        assert_eq!(get(&mut chip, RF0R), 0, "the frame that wakes is lost");
        set(&mut chip, MSR, 8);
        assert_eq!(get(&mut chip, MSR) & 8, 0);
        receive(&mut chip, frame(2));
        assert_eq!(get(&mut chip, RF0R), u32::from(woken));
    }
    // A controller whose pins are not set up sees no bus.
    let mut chip = node(0);
    set(&mut chip, MCR, 2 | AWUM);
    mode(&mut chip, GPIOB, 8, 0);
    receive(&mut chip, frame(1));
    assert_eq!(get(&mut chip, MSR) & 0x1F, 2);
}

/// Which of `ids` reach FIFO 0 or 1.
fn passed(chip: &mut Chip, ids: &[CanFrame]) -> Vec<(u32, u32)> {
    let mut passed = Vec::new();
    for frame in ids {
        receive(chip, *frame);
        for (fifo, register) in [(0, RF0R), (1, RF1R)] {
            if get(chip, register) & 3 != 0 {
                let identifier = get(chip, RI0R + 16 * fifo);
                passed.push((fifo, if frame.extended { identifier >> 3 } else { identifier >> 21 }));
                set(chip, register, 0x20);
            }
        }
    }
    passed
}

#[test]
fn filters_of_both_widths_by_list_and_by_mask() {
    let long = |id| CanFrame { extended: true, ..frame(id) };
    let remote = CanFrame { remote: true, ..frame(0x1B) };
    for (set_up, ids, wanted) in [
        // A list of 16 bits.
        (
            &[(FS1R, 0), (FM1R, 1), (BANKS, 0x1C << 21 | 0x1B << 5), (BANKS + 4, 0x1F << 21 | 0x1D << 5)][..],
            &[0x1A, 0x1B, 0x1C, 0x1D, 0x1E, 0x1F].map(frame).into_iter().chain([remote]).collect::<Vec<_>>(),
            &[(0, 0x1B), (0, 0x1C), (0, 0x1D), (0, 0x1F)][..],
        ),
        // Masks of 16 bits: 0x100 to 0x10F; 0x200 exactly.
        (
            &[(FS1R, 0), (BANKS, (0x7F0 << 5) << 16 | 0x100 << 5), (BANKS + 4, (0x7FF << 5) << 16 | 0x200 << 5)],
            &[0x100, 0x10F, 0x110, 0x200, 0x201].map(frame).to_vec(),
            &[(0, 0x100), (0, 0x10F), (0, 0x200)],
        ),
        // A list of 32 bits, and a mask for extended identifiers from 0x0AB00000 to 0x0ABFFFFF into the second FIFO.
        (
            &[
                (FS1R, 0b11),
                (FM1R, 0b01),
                (FFA1R, 0b10),
                (BANKS, 0x55 << 21),
                (BANKS + 4, 0x1234_5678 << 3 | 4),
                (BANKS + 8, 0x0AB0_0000 << 3 | 4),
                (BANKS + 12, 0x1FF0_0000 << 3 | 4),
                (FA1R, 0b11),
            ],
            &[frame(0x55), frame(0x56), long(0x1234_5678), long(0x0ABC_DEF0), long(0x0AC0_0000), frame(0x2AC)].to_vec(),
            &[(0, 0x55), (0, 0x1234_5678), (1, 0x0ABC_DEF0)],
        ),
        (&[(FA1R, 0)], &[frame(1), frame(2)].to_vec(), &[]),
    ] {
        let mut chip = node(0);
        filter(&mut chip, |chip| set_up.iter().for_each(|(register, value)| set(chip, *register, *value)));
        assert_eq!(passed(&mut chip, ids), wanted);
    }
}
