//! Checks CAN1 without a bus: in loop-back and silent mode the controller receives its own frames (RM0390 section
//! 30.5.3). Nothing reaches the pins, so neither a transceiver nor another node is needed, and none is disturbed.

use crate::board::Irqs;
use crate::table::{Table, Verdict};
use embassy_stm32::can::filter::Mask32;
use embassy_stm32::can::{Can, Fifo, Frame};
use embassy_stm32::peripherals::{CAN1, PB8, PB9};
use embassy_stm32::{Peri, pac};
use embassy_time::{Duration, with_timeout};

/// Identifier of each frame and whether it is extended: the limits of both ranges and the drive's. Frame k has k bytes.
const FRAMES: [(u32, bool); 9] = [
    (0, false),
    (0x7FF, false),
    (0x01B, false),
    (0x2AA, false),
    (0, true),
    (0x1FFF_FFFF, true),
    (0x1555_5555, true),
    (0x0AAA_AAAA, true),
    (0x01C, false),
];

/// Time-out; a frame takes 0.16 ms at 1 Mbit/s.
const TIMEOUT: Duration = Duration::from_millis(20);

pub async fn row(table: &mut Table, can: Peri<'_, CAN1>, rx: Peri<'_, PB8>, tx: Peri<'_, PB9>) {
    let mut can = Can::new(can, rx, tx, Irqs);
    can.modify_filters().enable_bank(0, Fifo::Fifo0, Mask32::accept_all());
    let config = can.modify_config();
    // Embassy switches on time stamps, which nothing here reads; the chip's errata advise against that mode.
    pac::CAN1.mcr().modify(|w| w.set_ttcm(false));
    config.set_bitrate(1_000_000).set_loopback(true).set_silent(true);
    let what = "CAN1 loop-back";
    let expected = format_args!("{} frames come back", FRAMES.len());
    if with_timeout(TIMEOUT, can.enable()).await.is_err() {
        return table.row(what, expected, format_args!("stays in initialisation mode"), Verdict::Failed);
    }
    let mut received = 0;
    for (length, (id, extended)) in FRAMES.into_iter().enumerate() {
        let data: [u8; 8] = core::array::from_fn(|i| (31 * i + 85 * length) as u8);
        let data = data.get(..length).unwrap_or(&data);
        let frame = if extended { Frame::new_extended(id, data) } else { Frame::new_standard(id as u16, data) };
        // The identifiers above are valid.
        let Ok(frame) = frame else { continue };
        let exchange = async {
            can.write(&frame).await;
            can.read().await
        };
        if let Ok(Ok(answer)) = with_timeout(TIMEOUT, exchange).await
            && answer.frame.id() == frame.id()
            && answer.frame.data() == frame.data()
        {
            received += 1;
        }
    }
    table.row(what, expected, format_args!("{received} came back unchanged"), Verdict::of(received == FRAMES.len()));
}
