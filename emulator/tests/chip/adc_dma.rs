//! ADC1 and DMA2 (RM0390 chapters 13 and 9).

use crate::fixture::*;

const ADC: u32 = 0x4001_2000;
const SR: u32 = ADC;
const CR1: u32 = ADC + 4;
const CR2: u32 = ADC + 8;
const SMPR2: u32 = ADC + 0x10;
const SQR1: u32 = ADC + 0x2C;
const SQR3: u32 = ADC + 0x34;
const DR: u32 = ADC + 0x4C;
const CCR: u32 = ADC + 0x304;

const DMA2: u32 = 0x4002_6400;
const LISR: u32 = DMA2;
const LIFCR: u32 = DMA2 + 8;
const S0CR: u32 = DMA2 + 0x10;
const S0NDTR: u32 = DMA2 + 0x14;
const BUFFER: u32 = 0x2000_1000;
const DMA_IRQ: u32 = 56;

const SWSTART: u32 = 1 << 30;
/// 480 + 12 ADC cycles of 16 MHz / 2.
const SLOW_S: f64 = 492.0 / 8e6;

/// Channels 0 and 1 on analog pins at 480 cycles.
fn adc() -> Chip {
    let mut chip = chip();
    mode(&mut chip, GPIOA, 0, 3);
    mode(&mut chip, GPIOA, 1, 3);
    set(&mut chip, SMPR2, 0b111_111);
    set(&mut chip, CR2, 1);
    chip
}

/// Circular stream 0 of `items` halfwords, half and full interrupts on.
fn stream(chip: &mut Chip, items: u32) {
    set(chip, S0CR + 8, DR);
    set(chip, S0CR + 0xC, BUFFER);
    set(chip, S0NDTR, items);
    set(chip, S0CR + 0x14, 0);
    let cr = 3 << 16 | 1 << 13 | 1 << 11 | 1 << 10 | 1 << 8 | 1 << 4 | 1 << 3;
    set(chip, S0CR, cr);
    set(chip, S0CR, cr | 1);
}

fn continuous(chip: &mut Chip, items: u32) -> f64 {
    stream(chip, items);
    set(chip, CR1, 1 << 8 | 1 << 5 | 1 << 26);
    let cr2 = 1 << 10 | 1 << 9 | 1 << 8 | 1 << 1 | 1;
    set(chip, CR2, cr2);
    set(chip, CR2, cr2 | SWSTART);
    chip.clock.seconds()
}

fn stored(chip: &Chip, index: u32) -> u16 {
    chip.memory.ram.half(BUFFER + 2 * index).expect("in RAM")
}

#[test]
fn a_single_conversion_takes_its_time_and_is_read() {
    let mut chip = adc();
    set(&mut chip, CR2, 1 | SWSTART);
    let start_s = chip.clock.seconds();
    assert_eq!(get(&mut chip, SR) & 0x12, 0x10, "STRT, not yet EOC");
    pass(&mut chip, 0.95 * SLOW_S);
    assert_eq!(get(&mut chip, SR) & 2, 0);
    pass(&mut chip, 0.1 * SLOW_S);
    assert_eq!(get(&mut chip, SR) & 2, 2);
    assert_eq!(get(&mut chip, DR), 1);
    assert_eq!(get(&mut chip, SR) & 2, 0, "reading DR clears EOC");
    let (t_s, channel) = chip.board.samples[0];
    assert_eq!(channel, 0);
    // Held at the end of sampling, 12 ADC cycles before the result.
    close(t_s - start_s, 480.0 / 8e6, 1e-6);
    pass(&mut chip, 1e-3);
    assert_eq!(chip.board.samples.len(), 1);
}

#[test]
fn the_sampling_time_is_the_channels() {
    let mut chip = adc();
    set(&mut chip, SMPR2, 0);
    set(&mut chip, CR1, 1 << 5);
    set(&mut chip, CR2, 1 | SWSTART);
    pass(&mut chip, 2e-6);
    assert_eq!(get(&mut chip, SR) & 2, 2, "15 cycles of 125 ns");
    assert!(pending(&mut chip, 18));
}

#[test]
fn the_ring_fills_with_interrupts_at_half_and_full() {
    let mut chip = adc();
    let start_s = continuous(&mut chip, 8);
    pass(&mut chip, 3.9 * SLOW_S);
    assert!(!pending(&mut chip, DMA_IRQ));
    pass(&mut chip, 0.2 * SLOW_S);
    assert!(pending(&mut chip, DMA_IRQ));
    assert_eq!(get(&mut chip, LISR), 0x10);
    assert_eq!(get(&mut chip, S0NDTR), 4);
    set(&mut chip, LIFCR, 0x10);
    pass(&mut chip, 4.0 * SLOW_S);
    assert_eq!(get(&mut chip, LISR), 0x20);
    assert_eq!(get(&mut chip, S0NDTR), 8, "circular: reloaded");
    assert_eq!((0..8).map(|i| stored(&chip, i)).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6, 7, 8]);
    for (i, (t_s, channel)) in chip.board.samples.iter().enumerate() {
        assert_eq!(*channel, 0);
        close(t_s - start_s, (i as f64 + 1.0) * SLOW_S - 12.0 / 8e6, 1e-6);
    }
}

#[test]
fn samples_are_asked_for_in_order_with_everything_else() {
    let mut chip = adc();
    continuous(&mut chip, 512);
    mode(&mut chip, GPIOB, 0, 1);
    for level in [1, 1 << 16, 1, 1 << 16] {
        pass(&mut chip, 10.3 * SLOW_S);
        // `Recorder` panics if the samples before this came later.
        set(&mut chip, GPIOB + 0x18, level);
    }
    assert_eq!(chip.board.samples.len(), 41);
}

#[test]
fn a_sequence_takes_its_channels_in_turn() {
    let mut chip = adc();
    set(&mut chip, SQR1, 1 << 20);
    set(&mut chip, SQR3, 1 << 5);
    continuous(&mut chip, 8);
    pass(&mut chip, 4.5 * SLOW_S);
    assert_eq!(chip.board.samples.iter().map(|s| s.1).collect::<Vec<_>>(), [0, 1, 0, 1]);
}

#[test]
fn without_a_stream_the_adc_overruns_and_stops_asking() {
    let mut chip = adc();
    continuous(&mut chip, 8);
    let cr = get(&mut chip, S0CR);
    set(&mut chip, S0CR, cr & !1);
    assert_eq!(get(&mut chip, LISR) & 0x20, 0x20, "switching a stream off raises TCIF");
    pass(&mut chip, 2.0 * SLOW_S);
    assert_eq!(get(&mut chip, SR) & 0x20, 0x20);
    set(&mut chip, LIFCR, 0x3D);
    set(&mut chip, S0CR, cr | 1);
    pass(&mut chip, 4.0 * SLOW_S);
    assert_eq!(get(&mut chip, S0NDTR), 8, "no requests while OVR is set");
    // The conversion in progress was aborted, and triggers are ignored (RM0390 section 13.8.1).
    let samples = chip.board.samples.len();
    let cr2 = get(&mut chip, CR2);
    set(&mut chip, CR2, cr2 | SWSTART);
    pass(&mut chip, 4.0 * SLOW_S);
    assert_eq!((chip.board.samples.len(), get(&mut chip, S0NDTR)), (samples, 8));
    // The stream set up, OVR cleared, a trigger: it goes on.
    set(&mut chip, SR, !0x20);
    pass(&mut chip, 4.0 * SLOW_S);
    assert_eq!(get(&mut chip, S0NDTR), 8, "not by itself");
    set(&mut chip, CR2, cr2 | SWSTART);
    pass(&mut chip, 3.5 * SLOW_S);
    assert_eq!(get(&mut chip, S0NDTR), 5);
}

#[test]
fn a_stalled_adc_overruns_as_if_its_stream_were_gone() {
    let mut chip = adc();
    continuous(&mut chip, 8);
    pass(&mut chip, 2.5 * SLOW_S);
    chip.stall_adc(true);
    pass(&mut chip, 4.0 * SLOW_S);
    assert_eq!((get(&mut chip, SR) & 0x20, get(&mut chip, S0NDTR)), (0x20, 6));
    chip.stall_adc(false);
    pass(&mut chip, 4.0 * SLOW_S);
    assert_eq!(get(&mut chip, S0NDTR), 6, "the overrun outlives its cause");
}

#[test]
fn vrefint_needs_its_switch() {
    let mut chip = adc();
    set(&mut chip, SQR3, 17);
    set(&mut chip, CCR, 1 << 23);
    set(&mut chip, CR2, 1 | SWSTART);
    pass(&mut chip, 10e-6);
    assert_eq!(get(&mut chip, SR) & 2, 2);
    assert_eq!(chip.board.samples[0].1, 17);
}
