//! The emulated chip, tested against the reference manual (RM0390): every peripheral through its registers, the core with
//! programs assembled by hand.

mod adc_dma;
mod bare;
mod can;
mod can_line;
mod clocks;
mod core;
mod fixture;
mod flash;
mod gdb;
mod gdb_client;
mod gpio_exti;
mod interrupts;
mod iwdg;
mod lints;
mod listings;
mod program;
mod strict;
mod tim;
mod usart;
