//! Damage to what the board keeps in flash: the table in its image, and its settings.

use super::{STORE, fault, set, standing, with_flash};
use host_tests::board::{Bench, firmware};
use host_tests::{scene, table};
use rig_emulator::flash_file::FlashFile;
use rig_emulator::machine::Config;
use rig_link::messages::{
    Accepted, Fault, Kept, LvdtCurve, Refusal, Request, Setting, SettingValues, SettingsReport, State,
};

/// Two emulated boards on one file: the second to write would undo what the first has kept.
#[test]
fn a_file_that_another_board_has_written_is_not_written_over() {
    let path = std::env::temp_dir().join(format!("flash-of-two-{}.bin", std::process::id()));
    let [mut a, mut b] = [1, 2].map(|seed| Bench::new(&[], seed));
    let [mut of_a, mut of_b] = [&mut a, &mut b].map(|bench| FlashFile::open(&path, &mut bench.machine).unwrap());
    for (bench, value) in [(&mut a, 0.003), (&mut b, 0.004)] {
        bench.ready();
        bench.set(&set(Setting::SpeedMax, value)).unwrap();
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
    let mut damaged = firmware();
    let places: Vec<usize> =
        damaged.windows(bytes.len()).enumerate().filter(|(_, w)| *w == bytes).map(|(at, _)| at).collect();
    let [at] = places[..] else { panic!("the table stands in the ELF at {places:?}") };
    damaged[at + bytes.len() / 2] ^= 0x10;
    let mut b = Bench::with(&damaged, scene(), &[], 1);
    b.greet();
    b.run(3.0);
    assert_eq!((b.state(), fault(&b)), (State::Fault, Some(Fault::TableCorrupt)));
    assert_eq!(b.ask(&Request::Clear), Err(Refusal::CauseRemains { fault: Fault::TableCorrupt }));
    assert_eq!(b.machine.board().truth().motor_energy_j, 0.0, "the drive was commanded");
    // The bit back in its place.
    damaged[at + bytes.len() / 2] ^= 0x10;
    let mut b = Bench::with(&damaged, scene(), &[], 1);
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
}

/// What a board with this flash says of its settings, and its fault, once it has started.
fn boot(image: &[u8]) -> (SettingsReport, Option<Fault>) {
    let mut b = Bench::new(&[], 1);
    with_flash(&mut b, image);
    let report = b.settings();
    b.run(0.1);
    (report, fault(&b))
}

/// Another program in the place of the settings, or noise: there may have been a calibration under it. Erased flash is none.
#[test]
fn settings_that_cannot_be_read_wait_for_the_operator_and_erased_ones_do_not() {
    let empty = Bench::new(&[], 1).machine.flash_image();
    for filled in [0x8000..0xC000, 0xFFFF..0x1_0000] {
        let (mut image, mut random) = (empty.clone(), 0x2545_f491);
        let noise = super::noise(&mut random, filled.len());
        image[filled.clone()].copy_from_slice(&noise);
        let (report, fault) = boot(&image);
        assert_eq!((report.kept, report.values), (Kept::Damaged, report.defaults), "{filled:?}");
        assert_eq!(fault, Some(Fault::SettingsCorrupt), "{filled:?}");
    }
    let filled = |with: u8| {
        let (mut b, mut image) = (Bench::new(&[], 1), empty.clone());
        image[STORE].fill(with);
        with_flash(&mut b, &image);
        b.run(3.0);
        b
    };
    assert_eq!(filled(0xFF).state(), State::Unhomed);
    let mut b = filled(0x5A);
    let in_fault = Refusal::InFault { fault: Fault::SettingsCorrupt };
    assert_eq!(
        (b.settings().kept, b.ask(&Request::HOME), b.ask(&super::JOG)),
        (Kept::Damaged, Err(in_fault), Err(in_fault))
    );
    assert_eq!(b.machine.board().truth().motor_energy_j, 0.0, "the drive was commanded");
    // Set again: kept at once, and the fault is latched like any other.
    assert_eq!(b.set(&set(Setting::LvdtGain, 0.97)), Ok(Accepted::Started));
    assert_eq!(b.ask(&Request::HOME), Err(in_fault));
    assert!(b.ask(&Request::Clear).is_ok());
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    // A flipped bit of the newest record is found, and the record before it is not taken for it.
    let mut b = standing(&[], 1);
    b.set(&set(Setting::SpeedMax, 0.002)).unwrap();
    b.set(&set(Setting::SpeedMax, 0.003)).unwrap();
    let mut image = b.machine.flash_image();
    let value = image.windows(4).position(|bytes| bytes == 0.003f32.to_le_bytes()).expect("it is in flash");
    for bit in (0..32).step_by(5) {
        let mut broken = image.clone();
        broken[value + bit / 8] ^= 1 << (bit % 8);
        let (report, fault) = boot(&broken);
        assert_eq!((report.kept, report.values), (Kept::Damaged, report.defaults), "bit {bit}");
        assert_eq!(fault, Some(Fault::SettingsCorrupt), "bit {bit}");
    }
    // Noise in another sector than the record's is none of it.
    image[0xC000..0x1_0000].fill(0x5A);
    let (report, fault) = boot(&image);
    assert_eq!((report.kept, report.values.get(Setting::SpeedMax), fault), (Kept::These, 0.003, None));
}

#[test]
fn what_is_set_is_there_after_a_power_cycle() {
    let mut b = standing(&[], 1);
    let fresh = b.settings();
    assert_eq!((fresh.kept, fresh.values), (Kept::Nothing, fresh.defaults));
    assert_eq!(fresh.defaults.get(Setting::CurrentLimit), 0.5, "the scene's");
    assert_eq!(b.set(&set(Setting::SpeedMax, 0.003)), Ok(Accepted::Started));
    assert_eq!(b.set(&set(Setting::LvdtGain, 1.01)), Ok(Accepted::Started), "nothing to lose: it was not homed");
    let values = fresh.defaults.with(Setting::SpeedMax, 0.003).with(Setting::LvdtGain, 1.01);
    assert_eq!(b.settings(), SettingsReport { values, kept: Kept::These, ..fresh });
    // Setting what is so already is kept too, and what is refused changes nothing.
    b.set(&set(Setting::SpeedMax, 0.003)).unwrap();
    let image = b.machine.flash_image();
    let refused = Refusal::SettingOutOfRange { setting: Setting::CurrentLimit, min: 0.05, max: 0.5, given: 0.6 };
    let one_bad = values.with(Setting::LvdtGain, 1.1).with(Setting::CurrentLimit, 0.6);
    assert_eq!(b.ask(&Request::SetSettings(one_bad)), Err(refused), "all or none");
    let not_finite = Err(Refusal::SettingNotFinite { setting: Setting::GearScale });
    assert_eq!(b.ask(&set(Setting::GearScale, f32::NAN)), not_finite);
    b.run(0.5);
    assert!(b.machine.flash_image() == image, "flash was written");
    b.power_cycle();
    b.greet();
    assert_eq!(b.settings(), SettingsReport { values, kept: Kept::These, ..fresh });
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert!(b.machine.stats().warnings.is_empty());
}

/// Flash before one more setting is written, from `image` on, and just after each change of it.
pub(super) fn changes(image: &[u8], request: &Request) -> Vec<Vec<u8>> {
    let ready = || {
        let mut b = Bench::new(&[], 3);
        with_flash(&mut b, image);
        assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
        b.post(request);
        b
    };
    let mut b = ready();
    let mut coarse_s = b.machine.now_s();
    while b.machine.flash_image() == image {
        coarse_s = b.machine.now_s();
        b.machine.run_until(coarse_s + 1e-3).unwrap();
    }
    let mut b = ready();
    b.machine.run_until(coarse_s).unwrap();
    let (mut images, mut last_s) = (vec![image.to_vec()], f64::INFINITY);
    // A word takes 16 us to be written. A full sector is read through before it is erased.
    while b.machine.now_s() < last_s + 0.05 {
        let now_s = b.machine.now_s();
        b.machine.run_until(now_s + 10e-6).unwrap();
        let now = b.machine.flash_image();
        if images.last() != Some(&now) {
            last_s = b.machine.now_s();
            images.push(now);
        }
    }
    images
}

/// Flash whose bytes at these places have been erased in part: each round leaves half of the bits that are not.
fn half_erased(image: &[u8], places: &[usize], rounds: u32) -> Vec<u8> {
    let (mut image, mut x) = (image.to_vec(), 0x2545_f491u32.wrapping_mul(2 * rounds + 1));
    for place in places {
        image[*place] = super::noise(&mut x, rounds as usize).iter().fold(image[*place], |byte, bits| byte | bits);
    }
    image
}

/// Cuts the power before and after changes of flash while `new` is written, at most N of them, spread evenly, and looks at
/// what is there afterwards.
fn cut_power(image: &[u8], old: &SettingValues, new: &SettingValues, max: usize) {
    let images = changes(image, &Request::SetSettings(*new));
    let (mut olds, mut news) = (0, 0);
    let mut look = |image: &[u8], cut: usize| {
        let (report, fault) = boot(image);
        assert_eq!((report.kept, fault), (Kept::These, None), "after change {cut}");
        match report.values {
            values if values == *old => olds += 1,
            values if values == *new => news += 1,
            values => panic!("after change {cut}: {values:?}"),
        }
    };
    let every = images.len().div_ceil(max);
    for (k, cut) in images.iter().enumerate() {
        if k % every == 0 || k + 1 == images.len() {
            look(cut, k);
        }
        let Some(last) = k.checked_sub(1).map(|before| &images[before]) else { continue };
        let erased: Vec<usize> = STORE.filter(|k| cut[*k] == 0xFF && last[*k] != 0xFF).collect();
        if erased.len() > 1000 {
            // The real chip takes its time to erase, bit by bit.
            for half in [1, 4, 8, 11].map(|rounds| half_erased(last, &erased, rounds)) {
                look(&half, k);
            }
        }
    }
    println!("{} changes of flash: old values after {olds} cuts, new ones after {news}", images.len());
    assert!(images.len() > 15 && olds > 0 && news > 0);
}

/// A calibration at 11 points is one record with the other settings.
#[test]
fn a_power_cut_leaves_the_old_values_or_the_new_ones() {
    let mut b = standing(&[], 3);
    let with = |values: SettingValues, correction_m: f32| {
        let points: Vec<[f32; 2]> = (0..11u8).map(|k| [0.08 + 2e-3 * f32::from(k), correction_m]).collect();
        SettingValues { lvdt_curve: Some(LvdtCurve::new(&points, 2e-5).unwrap()), ..values }
    };
    let defaults = b.settings().defaults;
    let old = with(defaults.with(Setting::PositionZero, 0.004), 1e-4);
    let new = with(defaults.with(Setting::TwistSign, -1.0).with(Setting::PositionZero, -0.003), -2e-4);
    let shown_m = b.mean_gap_m();
    b.set(&Request::SetSettings(old)).unwrap();
    assert_eq!(b.settings().values, old);
    assert!((b.mean_gap_m() - shown_m - 1e-4).abs() < 20e-6, "the gap follows");
    cut_power(&b.machine.flash_image(), &old, &new, 30);
}

/// Enough writes for two sectors to be erased, as slowly as a sector may be: the load stays, the values are kept, the watchdog
/// does not bite, and the board's clock loses no wrap of its counter although an erase masks interrupts.
#[test]
fn sectors_that_are_full_are_erased_while_it_holds() {
    let mut b = Bench::on(&firmware(), scene(), Config { slow_flash: true, ..Config::default() }, &[], 6);
    b.ready();
    // Each record holds the points of a calibration, so that fewer fill a sector.
    let points: Vec<[f32; 2]> = (0..11u8).map(|k| [0.08 + 2e-3 * f32::from(k), 0.0]).collect();
    let defaults = b.settings().defaults;
    let calibrated = SettingValues { lvdt_curve: LvdtCurve::new(&points, 2e-5).ok(), ..defaults };
    b.set(&Request::SetSettings(calibrated)).unwrap();
    b.home();
    super::moves(&mut b, 0.004);
    let gap_m = b.machine.board().truth().gap_m;
    let behind_us = |b: &Bench| b.machine.now_s() * 1e6 - b.last.expect("telemetry").t_us as f64;
    let before_us = behind_us(&b);
    let (mut erased, mut full, mut values) = (0, 0, b.settings().values);
    let mut before_erasing = None;
    for k in 0..2000u16 {
        let (began_s, before) = (b.machine.now_s(), (b.machine.flash_image(), values));
        let speed_m_per_s = 1e-3 + 1e-6 * f32::from(k);
        b.set(&set(Setting::SpeedMax, speed_m_per_s)).unwrap();
        assert!(b.machine.now_s() - began_s < 0.9, "{} s", b.machine.now_s() - began_s);
        values = values.with(Setting::SpeedMax, speed_m_per_s);
        let image = b.machine.flash_image();
        let used = STORE.filter(|k| image[*k] != 0xFF).count();
        if used < full {
            erased += 1;
            before_erasing = Some(before);
        }
        full = used;
        // The first telemetry after an erase is late.
        b.run(0.05);
        let drift_us = behind_us(&b) - before_us;
        assert!(drift_us.abs() < 11_000.0, "after {erased} erases the board's clock is {drift_us:.0} us behind");
        if erased == 2 {
            break;
        }
    }
    assert_eq!(erased, 2, "too few writes for two erases");
    // Nor does it jump later, when the counter wraps.
    for _ in 0..50 {
        b.run(0.1);
        let drift_us = behind_us(&b) - before_us;
        assert!(drift_us.abs() < 11_000.0, "the board's clock is {drift_us:.0} us behind");
    }
    assert!(b.machine.stats().resets.is_empty());
    assert_eq!((b.state(), fault(&b)), (State::Holding, None));
    let dropped_m = (b.machine.board().truth().gap_m - gap_m).abs();
    assert!(dropped_m < 50e-6, "the load moved by {dropped_m} m");
    b.power_cycle();
    b.greet();
    assert_eq!(b.settings().values, values);

    // Power may fail while a sector makes room, too.
    let (image, old) = before_erasing.expect("asserted above");
    cut_power(&image, &old, &old.with(Setting::LvdtGain, 1.03), 40);

    // A sector that was erased in part when power failed looks empty: what is written there is read back, and is not what
    // it should be.
    let empty: Vec<usize> = (1..4)
        .map(|sector| 0x4000 * sector..0x4000 * (sector + 1))
        .find(|sector| sector.clone().all(|k| image[k] == 0xFF))
        .expect("one sector is always empty")
        .skip(4)
        .collect();
    let mut dirty = image.clone();
    empty.iter().for_each(|k| dirty[*k] = 0);
    for rounds in [1, 5, 8, 10] {
        let mut b = Bench::new(&[], 3);
        with_flash(&mut b, &half_erased(&dirty, &empty, rounds));
        assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
        for gain in [1.03, 1.04] {
            b.set(&set(Setting::LvdtGain, gain)).unwrap();
            let (report, fault) = boot(&b.machine.flash_image());
            let new = old.with(Setting::LvdtGain, gain);
            assert_eq!((report.values, report.kept, fault), (new, Kept::These, None), "{rounds} rounds");
        }
    }
}
