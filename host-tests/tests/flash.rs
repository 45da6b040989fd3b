//! Damage to what the board keeps in flash: the table in its image, and its settings.

use host_tests::board::{Bench, HELLO, firmware};
use host_tests::{scene, table};
use rig_emulator::flash_file::FlashFile;
use rig_link::messages::{Fault, Refusal, Request, Setting, State};

/// Greets a board that was just switched on.
fn greet(b: &mut Bench) {
    b.run(0.05);
    b.ask(&HELLO).unwrap();
}

/// Two emulated boards on one file: the second to write would undo what the first has kept.
#[test]
fn a_file_that_another_board_has_written_is_not_written_over() {
    let path = std::env::temp_dir().join(format!("flash-of-two-{}.bin", std::process::id()));
    let [mut a, mut b] = [1, 2].map(|seed| Bench::new(&[], seed));
    let [mut of_a, mut of_b] = [&mut a, &mut b].map(|bench| FlashFile::open(&path, &mut bench.machine).unwrap());
    for (bench, value) in [(&mut a, 0.003), (&mut b, 0.004)] {
        greet(bench);
        assert!(bench.until(5.0, |b| b.state() == State::Unhomed));
        bench.set(&Request::SetSetting { setting: Setting::SpeedMax, value }).unwrap();
    }
    of_a.follow(&a.machine).unwrap();
    let error = of_b.follow(&b.machine).unwrap_err().to_string();
    assert!(error.contains("another emulated board"), "{error}");
    assert!(std::fs::read(&path).unwrap() == a.machine.flash_image());
    of_a.follow(&a.machine).unwrap();
    std::fs::remove_file(path).unwrap();
}

#[test]
fn one_flipped_bit_of_the_table_in_the_image_keeps_the_drive_silent() {
    let bytes: Vec<u8> = table().series.coefficients.iter().flat_map(|c| c.to_le_bytes()).collect();
    let places: Vec<usize> =
        firmware().windows(bytes.len()).enumerate().filter(|(_, w)| *w == bytes).map(|(at, _)| at).collect();
    let [at] = places[..] else { panic!("the table stands in the ELF at {places:?}") };
    let mut damaged = firmware().to_vec();
    damaged[at + bytes.len() / 2] ^= 0x10;
    let mut b = Bench::with(&damaged, scene(), &[], 1);
    greet(&mut b);
    b.run(3.0);
    assert_eq!((b.state(), b.last.unwrap().fault), (State::Fault, Some(Fault::TableCorrupt)));
    assert_eq!(b.ask(&Request::Clear), Err(Refusal::CauseRemains { fault: Fault::TableCorrupt }));
    assert_eq!(b.machine.board().truth().motor_energy_j, 0.0, "the drive was told something");
    // The bit back in its place.
    damaged[at + bytes.len() / 2] ^= 0x10;
    let mut b = Bench::with(&damaged, scene(), &[], 1);
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
}

#[test]
fn settings_that_cannot_be_read_wait_for_the_operator_and_erased_ones_do_not() {
    let boot = |settings: u8| {
        let mut b = Bench::new(&[], 1);
        let mut flash = b.machine.flash_image();
        // Sectors 1 to 3 (src/flash_store.rs).
        flash[0x4000..0x1_0000].fill(settings);
        b.machine.set_flash_image(&flash).unwrap();
        b.machine.power_cycle();
        greet(&mut b);
        b.run(3.0);
        b
    };
    let mut b = boot(0x5A);
    assert_eq!((b.state(), b.last.unwrap().fault), (State::Fault, Some(Fault::SettingsCorrupt)));
    assert_eq!(b.machine.board().truth().motor_energy_j, 0.0, "the drive was told something");
    assert!(b.ask(&Request::Clear).is_ok());
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert_eq!(boot(0xFF).state(), State::Unhomed);
}
