//! Every lint, by the shortest way to it.

use crate::fixture::*;
use rig_emulator::soc::fault::Lint;
use rig_plant::board::Stimulus;

const FLASH: u32 = 0x4002_3C00;
const ERASE: u32 = 2 | 3 << 3 | 2 << 8;
const TIM3: u32 = 0x4000_0400;
const USART2: u32 = 0x4000_4400;
const CAN: u32 = 0x4000_6400;
const ADC: u32 = 0x4001_2000;
const ADC_CR2: u32 = ADC + 8;
const SQR3: u32 = ADC + 0x34;
const ADC_START: u32 = 1 << 30 | 1;
/// Registers of DMA2's stream 0, and ADC1's data register, which it serves.
const S0CR: u32 = 0x4002_6410;
const S0NDTR: u32 = S0CR + 4;
const S0PAR: u32 = S0CR + 8;
const ADC_DR: u32 = ADC + 0x4C;
const IWDG: u32 = 0x4000_3000;

/// An address and the word that is written there.
type Write = (u32, u32);

/// What is written, word by word, of which the last word or what follows from it is refused; and a part of the message.
const CASES: &[(Lint, &str, &[Write])] = &[
    (Lint::Unmodelled, "0x40005400", &[(0x4000_5400, 1)]),
    (Lint::PinFunction, "USARTx_TX", &[(USART2 + 8, 139), (USART2 + 0xC, 0x2008), (USART2 + 4, 1)]),
    (Lint::PinFunction, "PB9", &[(CAN, 1), (CAN + 0x1C, 0x0014_0001), (CAN, 0), (CAN + 0x180, 1)]),
    (Lint::PinFunction, "PA0", &[(ADC_CR2, 1), (ADC_CR2, ADC_START)]),
    (
        Lint::DmaRequest,
        "DMA2 stream 0 channel 1 has no modelled request of the register at 0x4001204c",
        &[(S0PAR, ADC_DR), (S0NDTR, 8), (S0CR, 1 << 25 | 1)],
    ),
    (
        Lint::DmaMemory,
        "0x08000000",
        &[
            (S0PAR, ADC_DR),
            (S0CR + 0xC, 0x0800_0000),
            (S0NDTR, 8),
            (S0CR, 1),
            (GPIOA, 0xA800_0003),
            (ADC_CR2, 0x301),
            (ADC_CR2, 0x300 | ADC_START),
        ],
    ),
    (Lint::DmaEnabled, "", &[(S0PAR, ADC_DR), (S0NDTR, 8), (S0CR, 1), (S0NDTR, 4)]),
    (Lint::DmaMode, "", &[(S0PAR, ADC_DR), (S0NDTR, 8), (S0CR, 1 << 6 | 1)]),
    (Lint::DmaStart, "NDTR 0", &[(S0PAR, ADC_DR), (S0CR, 1)]),
    (Lint::HseCrystal, "bypass", &[(RCC, 0x0001_0083)]),
    (Lint::PllRuns, "", &[(RCC, 0x0105_0083), (RCC + 4, 168 << 6 | 4)]),
    (Lint::ClockSource, "not ready", &[(RCC + 8, 1)]),
    (
        Lint::WaitStates,
        "wait states",
        &[(RCC, 0x0005_0083), (RCC + 4, 1 << 22 | 168 << 6 | 4), (RCC, 0x0105_0083), (RCC + 8, 2)],
    ),
    (
        Lint::FlashDataCache,
        "data cache",
        &[
            (FLASH + 4, 0x4567_0123),
            (FLASH + 4, 0xCDEF_89AB),
            (FLASH + 0x10, ERASE),
            (FLASH, 0x300),
            (FLASH + 0x10, ERASE | 1 << 16),
            (FLASH, 0x700),
            (FLASH + 0x10, ERASE | 1 << 16),
        ],
    ),
    (Lint::TimCounting, "", &[(TIM3, 1 << 4)]),
    (Lint::TimSlave, "", &[(TIM3 + 8, 1)]),
    (Lint::TimDma, "", &[(TIM3 + 0xC, 1 << 8)]),
    (Lint::TimEvent, "", &[(TIM3 + 0x14, 2)]),
    (Lint::TimTrigger, "", &[(TIM3 + 4, 0x20)]),
    // PWM, and a channel that is switched on before and after the timer.
    (Lint::TimOutput, "", &[(TIM3 + 0x18, 0x60), (TIM3 + 0x20, 1), (TIM3, 1)]),
    (Lint::TimOutput, "", &[(TIM3, 1), (TIM3 + 0x20, 1)]),
    (Lint::TimCapture, "", &[(TIM3 + 0x18, 1), (TIM3 + 0x20, 1), (TIM3, 1)]),
    (Lint::UsartRxne, "RXNE", &[(USART2 + 0xC, 0x2004), (USART2, 0)]),
    (Lint::UsartMode, "", &[(USART2 + 0xC, 0x1000)]),
    (Lint::UsartDma, "", &[(USART2 + 0x14, 1 << 6)]),
    (Lint::CanTtcm, "TTCM", &[(CAN, 1), (CAN + 0x1C, 0x4014_0001), (CAN, 1 << 7), (CAN + 0x180, 1)]),
    (Lint::CanMailbox, "", &[(CAN + 0x180, 1), (CAN + 0x184, 8)]),
    (Lint::CanFilter, "FINIT", &[(CAN + 0x200, 0x2A1C_0E00), (CAN + 0x204, 1)]),
    (Lint::CanTiming, "", &[(CAN + 0x1C, 1)]),
    (Lint::AdcVrefint, "TSVREFE", &[(SQR3, 17), (ADC_CR2, 1), (ADC_CR2, ADC_START)]),
    (Lint::AdcChannel, "", &[(SQR3, 16), (ADC_CR2, 1), (ADC_CR2, ADC_START)]),
    (Lint::AdcMode, "", &[(ADC + 4, 1 << 6)]),
    (Lint::AdcMulti, "", &[(ADC + 0x304, 1)]),
    (Lint::AdcTrigger, "", &[(ADC_CR2, 1 << 20)]),
    (Lint::AdcPower, "", &[(GPIOA, 0xA800_0003), (ADC_CR2, ADC_START)]),
    (Lint::IwdgUpdate, "under way", &[(IWDG, 0x5555), (IWDG + 8, 1), (IWDG + 8, 2)]),
    (Lint::IwdgKey, "without the key", &[(IWDG + 4, 0)]),
];

#[test]
fn each_is_raised_by_what_it_names() {
    for (lint, says, writes) in CASES {
        let mut chip = chip();
        let Some((last, before)) = writes.split_last() else { panic!("{lint:?}: nothing is written") };
        before.iter().for_each(|(register, value)| set(&mut chip, *register, *value));
        chip.write(last.0, 4, last.1);
        pass(&mut chip, 1e-3);
        // What the ADC has done meanwhile.
        chip.read(ADC, 4);
        let fault = chip.faults.take().unwrap_or_else(|| panic!("{lint:?} is not raised"));
        assert_eq!(fault.lint, *lint, "{fault}");
        assert!(fault.to_string().contains(says), "{fault}");
    }
    let boards = [
        (Lint::BoardUsart, Stimulus::Uart { usart: 4, bytes: vec![1] }),
        (Lint::BoardPort, Stimulus::Pin { port: 'I', pin: 0, high: true }),
        (Lint::PinFunction, Stimulus::Uart { usart: 2, bytes: vec![1] }),
    ];
    for (lint, stimulus) in boards {
        let mut chip = chip();
        set(&mut chip, USART2 + 0xC, 0x2004);
        chip.stimulate(stimulus);
        pass(&mut chip, 1e-3);
        assert_eq!(chip.faults.take().map(|fault| fault.lint), Some(lint));
    }
    // Those of single accesses are tested in `strict`.
    let known = |lint: &&Lint| CASES.iter().any(|case| case.0 == **lint);
    let others = Lint::ALL.iter().filter(|lint| !known(lint)).copied().collect::<Vec<_>>();
    assert_eq!(others, [Lint::Width, Lint::Unclocked, Lint::BoardUsart, Lint::BoardPort]);
}
