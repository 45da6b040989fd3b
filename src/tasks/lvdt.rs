//! The LVDT: blocks of samples by DMA, averaged.

use crate::board::LVDT_BLOCK;
use crate::shared::{self, Task};
use embassy_stm32::adc::RingBufferedAdc;
use embassy_stm32::peripherals::ADC1;
use embassy_time::{Duration, Instant, with_timeout};
use rig_control::LvdtBlock;

/// Several block times: embassy-stm32 0.6.0 does not notice an ADC overrun, its read then waits for ever.
const STALLED: Duration = Duration::from_millis(40);

#[embassy_executor::task]
pub async fn run(mut adc: RingBufferedAdc<'static, ADC1>) -> ! {
    let mut codes = [0u16; LVDT_BLOCK];
    loop {
        match with_timeout(STALLED, adc.read(&mut codes)).await {
            Ok(Ok(_)) => {
                shared::LVDT.set(LvdtBlock::from_codes(Instant::now().as_micros(), &codes));
            }
            // Late by more than a ring, or stalled: begin again; the age of the last block tells the control task.
            Ok(Err(_)) | Err(_) => {
                defmt::warn!("LVDT samples lost");
                adc.stop();
            }
        }
        shared::alive(Task::Lvdt);
    }
}
