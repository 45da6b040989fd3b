//! What a strict board refuses: firmware that would work here and not on the chip.

use std::collections::{BTreeMap, BTreeSet};

/// Something that the real chip would not do, or that this one does not model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct Fault {
    /// The name under which it can be allowed.
    pub lint: Lint,
    /// What the firmware did.
    pub what: String,
}

/// Declares [`Lint`]: variant, name for `--allow`, peripheral, and what is wrong.
macro_rules! lints {
    ($($variant:ident = $name:literal, $unit:literal, $what:literal;)+) => {
        /// A reason to stop a strict machine, by name. Some of these programs run on a real chip: each can be allowed.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Lint {
            $(#[doc = concat!($unit, ": ", $what)] $variant,)+
        }

        impl Lint {
            /// Every lint.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The name as the command line writes it.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)+ }
            }

            /// The peripheral.
            pub const fn unit(self) -> &'static str {
                match self { $(Self::$variant => $unit,)+ }
            }

            /// What is wrong.
            pub const fn what(self) -> &'static str {
                match self { $(Self::$variant => $what,)+ }
            }
        }
    };
}

lints! {
    Unmodelled = "unmodelled", "bus", "a register that is not modelled";
    Width = "width", "bus", "a byte or halfword written to a register that takes whole words";
    Unclocked = "unclocked", "bus", "a register of a peripheral whose clock is off: it reads 0 and ignores writes";
    PinFunction = "pin-function", "GPIO", "a signal that is on none of its pins";
    DmaRequest = "dma-request", "DMA", "a stream that does not serve the register it points to, or serves another than ADC1's";
    DmaMemory = "dma-memory", "DMA", "a stream that points outside RAM";
    DmaEnabled = "dma-enabled", "DMA", "a stream's registers are protected while it is enabled";
    DmaMode = "dma-mode", "DMA", "only direct single transfers from a peripheral to memory are modelled";
    DmaStart = "dma-start", "DMA", "stream enabled with NDTR 0 or with old flags still set";
    HseCrystal = "hse-crystal", "RCC", "HSE switched on without bypass, but the board has no crystal on OSC_IN";
    PllRuns = "pll-runs", "RCC", "PLLCFGR written while the PLL runs";
    ClockSource = "clock-source", "RCC", "system clock switched to a source that is not ready";
    WaitStates = "wait-states", "RCC", "HCLK is too fast for the wait states in FLASH_ACR";
    FlashDataCache = "flash-data-cache", "flash", "programmed or erased with the data cache on, which may then hold old data";
    TimCounting = "tim-counting", "TIM", "one-pulse, centre-aligned and down-counting modes and UDIS are not modelled";
    TimSlave = "tim-slave", "TIM", "no slave mode but encoder mode 3 is modelled";
    TimDma = "tim-dma", "TIM", "DMA requests and encoder interrupts are not modelled";
    TimEvent = "tim-event", "TIM", "no software event but UG is modelled";
    TimTrigger = "tim-trigger", "TIM", "CR2: trigger output, XOR input and DMA options are not modelled";
    TimOutput = "tim-output", "TIM", "an output channel (PWM, toggle, forced) is on, but no channel drives a pin here";
    TimCapture = "tim-capture", "TIM", "input capture is not modelled: the channel never captures";
    UsartRxne = "usart-rxne", "USART", "a write to SR that takes back RXNE loses a byte that comes meanwhile";
    UsartMode = "usart-mode", "USART", "parity, 9-bit data, mute mode and break are not modelled";
    UsartDma = "usart-dma", "USART", "DMA, flow control, half duplex, smartcard and IrDA are not modelled";
    CanTtcm = "can-ttcm", "CAN1", "time-triggered communication (TTCM), which the errata advise against";
    CanMailbox = "can-mailbox", "CAN1", "a mailbox is write-protected while its frame is pending";
    CanFilter = "can-filter", "CAN1", "filters can only be changed in filter initialisation (FINIT)";
    CanTiming = "can-timing", "CAN1", "BTR can only be written in initialisation mode";
    AdcVrefint = "adc-vrefint", "ADC", "VREFINT converted with TSVREFE off";
    AdcChannel = "adc-channel", "ADC", "only channels 0 to 15 and VREFINT are modelled";
    AdcMode = "adc-mode", "ADC", "watchdog, injected, discontinuous and short conversions are not modelled";
    AdcMulti = "adc-multi", "ADC", "multi mode is not modelled";
    AdcTrigger = "adc-trigger", "ADC", "external and injected triggers, and DMA without DDS, are not modelled";
    AdcPower = "adc-power", "ADC", "conversion started before the ADC was powered";
    IwdgUpdate = "iwdg-update", "IWDG", "PR or RLR written while the update before is under way";
    IwdgKey = "iwdg-key", "IWDG", "PR or RLR written without the key";
    BoardUsart = "board-usart", "board", "a stimulus for a USART that is not modelled";
    BoardPort = "board-port", "board", "a stimulus for a port that is not modelled";
}

/// No lint has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no lint `{name}`; lints: {}", Lint::ALL.iter().map(|lint| lint.name()).collect::<Vec<_>>().join(", "))]
pub struct UnknownLint {
    /// What was given.
    pub name: String,
}

impl std::str::FromStr for Lint {
    type Err = UnknownLint;

    fn from_str(name: &str) -> Result<Self, UnknownLint> {
        Self::ALL.iter().find(|lint| lint.name() == name).copied().ok_or_else(|| UnknownLint { name: name.to_owned() })
    }
}

/// Faults raised so far.
#[derive(Debug, Default)]
pub struct Faults {
    strict: bool,
    allowed: BTreeSet<Lint>,
    first: Option<Fault>,
    warnings: BTreeMap<String, u64>,
}

impl Faults {
    /// Stop at the first fault, or only count them.
    pub fn new(strict: bool) -> Self {
        Self { strict, ..Self::default() }
    }

    /// Only count faults of this name from now on.
    pub fn allow(&mut self, lint: Lint) {
        self.allowed.insert(lint);
    }

    /// Report what the firmware did.
    pub fn raise(&mut self, lint: Lint, what: String) {
        if self.strict && !self.allowed.contains(&lint) {
            self.first.get_or_insert(Fault { lint, what });
        } else {
            *self.warnings.entry(format!("{what} ({})", lint.name())).or_insert(0) += 1;
        }
    }

    /// Report a mode or bit that is not modelled, or that the chip forbids.
    pub fn lint(&mut self, lint: Lint) {
        self.raise(lint, format!("{}: {}", lint.unit(), lint.what()));
    }

    /// A fault waits to be reported.
    pub fn pending(&self) -> bool {
        self.first.is_some()
    }

    /// The fault to report, once.
    pub fn take(&mut self) -> Option<Fault> {
        self.first.take()
    }

    /// Faults that were let pass, with how often.
    pub fn warnings(&self) -> &BTreeMap<String, u64> {
        &self.warnings
    }
}
