//! What the strict chip refuses, and that the lax one only counts it.

use crate::fixture::*;
use rig_emulator::soc::fault::Lint;

#[test]
fn a_register_without_its_clock_one_that_is_not_modelled_and_a_narrow_write_are_named() {
    // I2C1, and a hole in the GPIO block; DMA2's S0CR, and FLASH_KEYR.
    for (on, address, size, wanted) in [
        (false, GPIOA, 4, "0x40020000: the clock of GPIOA is not enabled in the RCC"),
        (false, 0x4000_6404, 4, "0x40006404: the clock of CAN1 is not enabled in the RCC"),
        (true, 0x4000_5400, 4, "of an unmodelled register of I2C1 at 0x40005400"),
        (true, GPIOA + 0x28, 4, "of an unmodelled register of GPIOA at 0x40020028"),
        (true, 0x4001_2208, 4, "of an unmodelled register of ADC3 at 0x40012208"),
        (true, 0x5003_FFFC, 4, "of an unmodelled register of USB OTG FS at 0x5003fffc"),
        (true, 0x5004_0000, 4, "of an unmodelled register of no peripheral at 0x50040000"),
        (true, 0x4002_6410, 1, "1-byte write at 0x40026410: this register takes whole words"),
        (true, 0x4002_3C04, 1, "1-byte write at 0x40023c04: this register takes whole words"),
    ] {
        let mut chip = if on { chip() } else { Soc::new(Recorder::default(), &Config::default()) };
        chip.write(address, size, 1);
        let said = refused(&mut chip);
        assert!(said.contains("write") && said.contains(wanted), "{said}");
        chip.read(address, size);
        let said = refused(&mut chip);
        assert!(if size == 4 { said.contains("read") && said.contains(wanted) } else { said.is_empty() }, "{said}");
    }
}

#[test]
fn rcc_flash_and_gpio_take_bytes_and_halfwords_and_keep_the_rest() {
    for strict in [true, false] {
        let mut chip = Soc::new(Recorder::default(), &Config { strict, ..Config::default() });
        chip.write(RCC + 0x30, 1, 0x07);
        chip.write(RCC + 0x32, 2, 0x0060);
        assert_eq!(chip.read(RCC + 0x30, 4), 0x0060_0007);
        chip.write(0x4002_3C00, 4, 0x705);
        chip.write(0x4002_3C00, 1, 0x02);
        assert_eq!(chip.read(0x4002_3C00, 4), 0x702, "the caches stay on");
        chip.write(GPIOB + 0x14, 4, 0x0123);
        chip.write(GPIOB + 0x15, 1, 0x80);
        assert_eq!(chip.read(GPIOB + 0x14, 4), 0x8023);
        // BSRR by halves: reset bits in the upper one.
        chip.write(GPIOB + 0x1A, 2, 0x0003);
        chip.write(GPIOB + 0x18, 2, 0x0004);
        assert_eq!(chip.read(GPIOB + 0x14, 4), 0x8024);
        assert!(!chip.faults.pending() && chip.faults.warnings().is_empty());
    }
}

#[test]
fn a_bit_of_the_alias_is_a_bit_of_the_register_or_of_ram() {
    let alias = |address: u32, bit: u32| (address & 0xF000_0000) + 0x200_0000 + (address & 0xF_FFFF) * 32 + bit * 4;
    let mut chip = chip();
    // RCC_CR.HSEBYP and HSEON, as ST's HAL switches them.
    for bit in [18, 16] {
        chip.write(alias(RCC, bit), 4, 1);
    }
    assert_eq!(get(&mut chip, RCC) & 0x0007_0001, 0x0007_0001);
    assert_eq!(chip.read(alias(RCC, 17), 4), 1);
    chip.write(alias(RCC, 16), 4, 0);
    assert_eq!(chip.read(alias(RCC, 17), 4), 0);
    chip.memory.ram.set_word(0x2000_1000, 0xF0F0_F0F0).expect("in RAM");
    chip.write(alias(0x2000_1002, 3), 4, 1);
    chip.write(alias(0x2000_1001, 4), 4, 0xFFFF_FFFE);
    assert_eq!(chip.memory.ram.word(0x2000_1000), Some(0xF0F8_E0F0));
    assert_eq!((chip.read(alias(0x2000_1002, 3), 4), chip.read(alias(0x2000_1002, 2), 4)), (1, 0));
    assert_eq!(chip.faults.take(), None);
    chip.read(alias(0x4000_5400, 0), 4);
    assert_eq!(refused(&mut chip), "read of an unmodelled register of I2C1 at 0x40005400");
}

#[test]
fn a_lint_that_is_allowed_is_counted_and_the_others_still_stop() {
    let mut chip = chip();
    chip.faults.allow("hse-crystal".parse().expect("a lint"));
    set(&mut chip, RCC, 0x0001_0083);
    set(&mut chip, RCC, 0x0001_0083);
    let counted: Vec<_> = chip.faults.warnings().iter().map(|(what, times)| (what.clone(), *times)).collect();
    let [(what, 2)] = counted.as_slice() else { panic!("{counted:?}") };
    assert!(what.contains("HSE") && what.contains("hse-crystal"), "{what}");
    chip.write(GPIOA + 0x28, 4, 1);
    assert_eq!(chip.faults.take().map(|fault| fault.lint), Some(Lint::Unmodelled));
}

#[test]
fn every_lint_has_its_own_name_and_an_unknown_name_lists_them() {
    for lint in Lint::ALL {
        assert_eq!(lint.name().parse(), Ok(*lint));
    }
    let error = "hse".parse::<Lint>().expect_err("no lint").to_string();
    assert!(Lint::ALL.iter().all(|lint| error.contains(lint.name())), "{error}");
}
