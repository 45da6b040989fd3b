//! The LVDT: blocks of samples by DMA, averaged.

use crate::board::LVDT_BLOCK;
use crate::shared::{self, Task};
use embassy_stm32::adc::RingBufferedAdc;
use embassy_stm32::pac;
use embassy_stm32::peripherals::ADC1;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use rig_control::LvdtBlock;

/// Several block times: embassy-stm32 0.6.0 does not notice an ADC overrun, its read then waits for ever.
const STALLED: Duration = Duration::from_millis(40);

/// DMA2's stream of the ADC's samples ([`crate::board`]).
const STREAM: usize = 0;

/// Less than half a block.
const ERROR_PAUSE: Duration = Duration::from_millis(1);

#[embassy_executor::task]
pub async fn run(mut adc: RingBufferedAdc<'static, ADC1>) -> ! {
    let mut codes = [0u16; LVDT_BLOCK];
    loop {
        match with_timeout(STALLED, adc.read(&mut codes)).await {
            Ok(Ok(_)) => {
                shared::LVDT.set(LvdtBlock::from_codes(Instant::now().as_micros(), &codes));
            }
            // Late by more than a ring: it has begun again by itself. An error that comes at once must not keep the other
            // tasks waiting.
            Ok(Err(_)) => {
                defmt::warn!("LVDT samples lost");
                Timer::after(ERROR_PAUSE).await;
            }
            // Stalled: begin again; the age of the last block tells the control task.
            Err(_) => {
                defmt::warn!("LVDT stalled");
                restart(&mut adc);
            }
        }
        shared::alive(Task::Lvdt);
    }
}

/// Sets up converter and DMA as they were at first; the next read starts them. embassy-stm32 0.6.0 only switches the stream
/// off and on: the ring goes on where it stood instead of at its start, switching off counts as a round of new samples, and
/// the overrun is never cleared, without which the converter takes no trigger (RM0390 sections 9.3.14 and 13.8.1).
fn restart(adc: &mut RingBufferedAdc<'static, ADC1>) {
    adc.stop();
    let stream = pac::DMA2.st(STREAM);
    // An item on its way is finished first.
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
