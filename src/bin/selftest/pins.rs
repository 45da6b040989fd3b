//! Checks of inputs, each driven by an output of the same board through a jumper wire.
//!
//! Each wire is first checked with a plain input that is pulled to the opposite level: an input that follows the pull
//! and not the output has no wire, and one that follows neither is stuck.

use crate::board::Irqs;
use crate::serial::Transmitter;
use crate::table::{Table, Verdict};
use embassy_stm32::adc::{Adc, SampleTime, VrefInt};
use embassy_stm32::can::{Can, Frame};
use embassy_stm32::gpio::{Input, Level, Output, Pin, Pull, Speed};
use embassy_stm32::pac;
use embassy_stm32::pac::can::vals::Lec;
use embassy_stm32::timer::qei::{self, Qei};
use embassy_stm32::usart::{self, BufferedUart};
use embassy_stm32::{Peri, Peripherals};
use embassy_time::{Duration, Timer, block_for, with_timeout};
use embedded_io_async::Read;

/// Settling time of an input: many time constants of the chip's pull (about 40 kohm) and a wire (about 100 pF).
const SETTLING: Duration = Duration::from_micros(50);

enum Wire {
    Good,
    Open,
    Stuck(&'static str),
}

fn wire<T: Pin>(from: &mut Output<'_>, to: &mut Peri<'_, T>) -> Wire {
    let mut follows = |level: Level, pull: Pull| {
        from.set_level(level);
        let input = Input::new(to.reborrow(), pull);
        block_for(SETTLING);
        input.get_level() == level
    };
    match (follows(Level::Low, Pull::Up), follows(Level::High, Pull::Down)) {
        (true, true) => Wire::Good,
        (false, false) => Wire::Open,
        (true, false) => Wire::Stuck("low"),
        (false, true) => Wire::Stuck("high"),
    }
}

/// Adds a row if a wire is missing or stuck, and returns whether it did.
fn report_bad_wire(
    table: &mut Table,
    what: &'static str,
    expected: core::fmt::Arguments<'_>,
    wires: &[(Wire, &'static str, &'static str)],
) -> bool {
    for (wire, from, to) in wires {
        match wire {
            Wire::Good => continue,
            Wire::Open => {
                let seen = format_args!("{to} does not follow {from}: no jumper?");
                table.row(what, expected, seen, Verdict::NotConnected);
            }
            Wire::Stuck(level) => table.row(what, expected, format_args!("{to} is stuck {level}"), Verdict::Failed),
        }
        return true;
    }
    false
}

/// Number of conversions that are averaged.
const CONVERSIONS: u32 = 16;

/// Address of the factory's code of VREFINT at 3.3 V and 30 °C (DS10693, internal reference voltage).
const VREFINT_CAL: *const u16 = 0x1FFF_7A2A as *const u16;
/// Supply voltage of that code (V).
const VREFINT_CAL_V: f32 = 3.3;
/// Range of VDDA (V): 5 % around the board's 3.3 V, more than the errors of regulator and reference.
const VDDA_V: [f32; 2] = [3.135, 3.465];
/// Largest code of a low output and smallest of a high one, each 1 % of the range from its end.
const LOW_MAX: u16 = 40;
const HIGH_MIN: u16 = 4055;

/// Rows of VREFINT and of A0, driven by A1.
pub async fn adc(table: &mut Table, p: &mut Peripherals) {
    let mut from = Output::new(p.PA1.reborrow(), Level::Low, Speed::Low);
    let wire = wire(&mut from, &mut p.PA0);
    let mut adc = Adc::new(p.ADC1.reborrow());
    let mut reference = adc.enable_vrefint();
    Timer::after_micros(VrefInt::start_time_us().into()).await;
    let sum: u32 = (0..CONVERSIONS).map(|_| u32::from(adc.blocking_read(&mut reference, SampleTime::CYCLES480))).sum();
    let code = sum / CONVERSIONS;
    // SAFETY: it is an aligned halfword of system memory, which is always readable.
    let factory = unsafe { VREFINT_CAL.read_volatile() };
    let vdda_v = VREFINT_CAL_V * f32::from(factory) * CONVERSIONS as f32 / sum.max(1) as f32;
    table.row(
        "ADC1 VREFINT",
        format_args!("VDDA {:.3} to {:.3} V", VDDA_V[0], VDDA_V[1]),
        format_args!("{vdda_v:.3} V (code {code}, factory code {factory})"),
        Verdict::of((VDDA_V[0]..=VDDA_V[1]).contains(&vdda_v)),
    );

    let what = "ADC1 A1 to A0";
    let expected = format_args!("low up to {LOW_MAX}, high from {HIGH_MIN}");
    if report_bad_wire(table, what, expected, &[(wire, "A1", "A0")]) {
        return;
    }
    let codes = [Level::Low, Level::High].map(|level| {
        from.set_level(level);
        block_for(SETTLING);
        adc.blocking_read(&mut p.PA0, SampleTime::CYCLES480)
    });
    let good = codes[0] <= LOW_MAX && codes[1] >= HIGH_MIN;
    table.row(what, expected, format_args!("low {}, high {}", codes[0], codes[1]), Verdict::of(good));
}

/// Number of edges forwards, and then backwards.
const FORWARDS: u16 = 42;
const BACKWARDS: u16 = 29;

/// Row of TIM3, which counts a Gray code from D13 and D10.
pub fn encoder(table: &mut Table, p: &mut Peripherals) {
    let mut a = Output::new(p.PA5.reborrow(), Level::Low, Speed::Low);
    let mut b = Output::new(p.PB6.reborrow(), Level::Low, Speed::Low);
    let what = "TIM3 D12 and D11";
    let expected = format_args!("+{FORWARDS}, then -{BACKWARDS} counts");
    let wires = [(wire(&mut a, &mut p.PA6), "D13", "D12"), (wire(&mut b, &mut p.PA7), "D10", "D11")];
    if report_bad_wire(table, what, expected, &wires) {
        return;
    }
    let mut place = 0u16;
    let mut step = |by: u16| {
        place = place.wrapping_add(by);
        // A leads, so TIM3 counts up.
        a.set_level(matches!(place % 4, 1 | 2).into());
        b.set_level(matches!(place % 4, 2 | 3).into());
        block_for(SETTLING);
    };
    // The check of the wires left them high; both must be low before the counter starts.
    step(0);
    let counter = Qei::new(p.TIM3.reborrow(), p.PA6.reborrow(), p.PA7.reborrow(), qei::Config::default());
    let start = counter.count();
    (0..FORWARDS).for_each(|_| step(1));
    let middle = counter.count();
    (0..BACKWARDS).for_each(|_| step(u16::MAX));
    let end = counter.count();
    let way = |from: u16, to: u16| to.wrapping_sub(from).cast_signed();
    let (forwards, backwards) = (way(start, middle), way(middle, end));
    let good = forwards == FORWARDS.cast_signed() && backwards == -BACKWARDS.cast_signed();
    table.row(what, expected, format_args!("{forwards:+}, then {backwards:+} counts"), Verdict::of(good));
}

/// Different bytes, with both values of every bit.
const BYTES: [u8; 8] = [0x00, 0xFF, 0x55, 0xAA, 0x01, 0x80, 0x7E, 0x42];
/// Time-out; eight bytes take 0.7 ms.
const TIMEOUT: Duration = Duration::from_millis(20);

/// Row of USART1, which receives its own bytes.
pub async fn serial(table: &mut Table, p: &mut Peripherals) {
    let what = "USART1 D8 to D2";
    let expected = format_args!("{} bytes at {} Bd come back", BYTES.len(), rmds405::serial::BAUD);
    let mut from = Output::new(p.PA9.reborrow(), Level::High, Speed::Low);
    let wires = [(wire(&mut from, &mut p.PA10), "D8", "D2")];
    drop(from);
    if report_bad_wire(table, what, expected, &wires) {
        return;
    }
    let (mut tx, mut rx) = ([0; 16], [0; 16]);
    let mut config = usart::Config::default();
    config.baudrate = rmds405::serial::BAUD;
    let (out, back) = (p.PA9.reborrow(), p.PA10.reborrow());
    let Ok(uart) = BufferedUart::new(p.USART1.reborrow(), back, out, &mut tx, &mut rx, Irqs, config) else {
        return table.row(what, expected, format_args!("the baud rate cannot be set"), Verdict::Failed);
    };
    // The transmitter of the firmware.
    let (tx, mut uart) = uart.split();
    let mut tx = Transmitter::drive(tx);
    // Discards what the line received while it was set up.
    let mut received = [0; BYTES.len()];
    let _ = with_timeout(Duration::from_millis(2), uart.read(&mut received)).await;
    let mut received = [0; BYTES.len()];
    let exchange = async {
        tx.write_all(&BYTES).await;
        uart.read_exact(&mut received).await.ok()
    };
    let done = with_timeout(TIMEOUT, exchange).await;
    let same = received.iter().zip(&BYTES).filter(|(received, sent)| received == sent).count();
    let good = matches!(done, Ok(Some(()))) && same == BYTES.len();
    let why = if matches!(done, Ok(Some(()))) { "" } else { ", not in time" };
    table.row(what, expected, format_args!("{same} came back unchanged{why}"), Verdict::of(good));
}

/// Rows of the motor-power output and of the three contacts' inputs. The limits' inputs drive each other in turn.
pub fn safety(table: &mut Table, p: &mut Peripherals) {
    let stop = wire(&mut Output::new(p.PB10.reborrow(), Level::Low, Speed::Low), &mut p.PB5);
    let upper = wire(&mut Output::new(p.PC7.reborrow(), Level::Low, Speed::Low), &mut p.PA8);
    let lower = wire(&mut Output::new(p.PA8.reborrow(), Level::Low, Speed::Low), &mut p.PC7);
    row_of_wires(table, "power, stop D6 to D4", &[(stop, "D6", "D4")]);
    row_of_wires(table, "limits D9 and D7", &[(upper, "D9", "D7"), (lower, "D7", "D9")]);
}

/// Adds the row of pins that are only read and set.
fn row_of_wires(table: &mut Table, what: &'static str, wires: &[(Wire, &'static str, &'static str)]) {
    let expected = format_args!("low and high arrive");
    if !report_bad_wire(table, what, expected, wires) {
        table.row(what, expected, format_args!("both arrive"), Verdict::Ok);
    }
}

/// Time in which the controller repeats a frame often; one frame takes 0.1 ms.
const REPEATED: Duration = Duration::from_millis(5);

/// Row of CAN1's own pins, TX wired to RX. A controller that reads back every bit it sends gets as far as the
/// acknowledge bit, which no other node gives: an acknowledgement error shows that both pins work. It does not need a
/// transceiver.
pub async fn can(table: &mut Table, p: &mut Peripherals) {
    let what = "CAN1 D14 to D15";
    let expected = format_args!("ACK error: its own bits come back");
    let mut from = Output::new(p.PB9.reborrow(), Level::High, Speed::Low);
    let wires = [(wire(&mut from, &mut p.PB8), "D14", "D15")];
    drop(from);
    if report_bad_wire(table, what, expected, &wires) {
        return;
    }
    let mut can = Can::new(p.CAN1.reborrow(), p.PB8.reborrow(), p.PB9.reborrow(), Irqs);
    let config = can.modify_config();
    // Embassy switches on time stamps, which nothing here reads; the chip's errata advise against that mode.
    pac::CAN1.mcr().modify(|w| w.set_ttcm(false));
    config.set_bitrate(1_000_000).set_loopback(false).set_silent(false);
    if with_timeout(TIMEOUT, can.enable()).await.is_err() {
        return table.row(what, expected, format_args!("stays in initialisation mode"), Verdict::Failed);
    }
    // Both bit values in identifier and data. Identifier and length are valid.
    let Ok(frame) = Frame::new_standard(0x2AA, &[0x55, 0xAA]) else { return };
    let mailbox = can.write(&frame).await.mailbox();
    Timer::after(REPEATED).await;
    let error = pac::CAN1.esr().read().lec();
    can.abort(mailbox);
    let seen = match error {
        Lec::ACK => "ACK error",
        Lec::BIT_RECESSIVE | Lec::BIT_DOMINANT => "a bit came back inverted",
        Lec::NO_ERROR => "no error: another node acknowledges",
        _ => "another error",
    };
    table.row(what, expected, format_args!("{seen}"), Verdict::of(error == Lec::ACK));
}
