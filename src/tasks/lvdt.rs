//! Reads the LVDT: the ADC's samples by DMA, averaged over blocks.

use crate::board::LVDT_BLOCK;
use crate::shared::{self, Task};
use embassy_stm32::adc::RingBufferedAdc;
use embassy_stm32::pac;
use embassy_stm32::peripherals::ADC1;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use rig_control::LvdtBlock;

/// Time after which the ADC counts as stalled; several block times. embassy-stm32 0.6.0 does not detect an ADC overrun:
/// its read would wait indefinitely.
const STALLED: Duration = Duration::from_millis(40);

/// DMA2's stream for the ADC's samples ([`crate::board`]).
const STREAM: usize = 0;

/// Pause after an error, less than half a block. An error that returns at once must not keep the other tasks waiting.
const ERROR_PAUSE: Duration = Duration::from_millis(1);

#[embassy_executor::task]
pub async fn run(mut adc: RingBufferedAdc<'static, ADC1>) -> ! {
    let mut codes = [0u16; LVDT_BLOCK];
    loop {
        match with_timeout(STALLED, adc.read(&mut codes)).await {
            Ok(Ok(_)) => {
                shared::LVDT.set(LvdtBlock::from_codes(Instant::now().as_micros(), &codes));
            }
            // This task was late by more than a ring; embassy has restarted the reading.
            Ok(Err(_)) => {
                defmt::warn!("LVDT samples lost");
                Timer::after(ERROR_PAUSE).await;
            }
            // The control task notices by the age of the last block.
            Err(_) => {
                defmt::warn!("LVDT stalled");
                restart(&mut adc);
            }
        }
        shared::alive(Task::Lvdt);
    }
}

/// Restores the initial state of converter and DMA; the next read starts them. embassy-stm32 0.6.0 only switches the
/// stream off and on: the ring would continue where it stopped instead of at its start, switching off would count as a
/// ring of new samples, and the overrun flag would stay set, with which the converter ignores triggers (RM0390 sections
/// 9.3.14 and 13.8.1).
fn restart(adc: &mut RingBufferedAdc<'static, ADC1>) {
    adc.stop();
    let stream = pac::DMA2.st(STREAM);
    // The stream finishes the present transfer first.
    while stream.cr().read().en() {}
    pac::DMA2.ifcr(STREAM / 4).write(|w| {
        w.set_tcif(STREAM % 4, true);
        w.set_htif(STREAM % 4, true);
        w.set_teif(STREAM % 4, true);
        w.set_dmeif(STREAM % 4, true);
        w.set_feif(STREAM % 4, true);
    });
    stream.ndtr().write(|w| w.set_ndt(2 * LVDT_BLOCK as u16));
    adc.clear();
    pac::ADC1.sr().modify(|w| w.set_ovr(false));
}
