//! The LVDT: blocks of samples by DMA, averaged.

use crate::board::LVDT_BLOCK;
use crate::shared::{self, Task};
use embassy_stm32::adc::RingBufferedAdc;
use embassy_stm32::peripherals::ADC1;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use rig_control::LvdtBlock;

/// Several block times: embassy-stm32 0.6.0 does not notice an ADC overrun, its read then waits for ever.
const STALLED: Duration = Duration::from_millis(40);

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
            // Late by more than a ring: it has begun again by itself. Stopping the DMA here would look like another round
            // of it, and so late again, for ever; and an error that comes at once must not keep the other tasks waiting.
            Ok(Err(_)) => {
                defmt::warn!("LVDT samples lost");
                Timer::after(ERROR_PAUSE).await;
            }
            // Stalled: begin again; the age of the last block tells the control task.
            Err(_) => {
                defmt::warn!("LVDT stalled");
                adc.stop();
            }
        }
        shared::alive(Task::Lvdt);
    }
}
