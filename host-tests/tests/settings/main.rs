//! Settings on the real firmware on the emulated board: kept over the loss of power, whenever it comes, and told when
//! damaged. [`effects`]: what each of them does to the rig, without a board.

mod effects;

use host_tests::board::{Bench, firmware, other_rig};
use rig_config::Scene;
use rig_link::messages::{
    Accepted, Fault, Kept, LoadChoice, LvdtCurve, Refusal, Request, Setting, SettingValues, SettingsReport, State,
};

const fn set(setting: Setting, value: f32) -> Request {
    Request::SetSetting { setting, value }
}

const fn go(target_m: f32) -> Request {
    Request::Move { target_m, speed_m_per_s: 0.002, load: LoadChoice::Auto }
}

/// A board that has been greeted and stands.
fn standing(keys: &[(&str, &str)], seed: u64) -> Bench {
    let mut b = Bench::new(keys, seed);
    b.greet();
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    b
}

/// What a board with this flash says of its settings, and its fault, once it has started.
fn boot(image: &[u8]) -> (SettingsReport, Option<Fault>) {
    let mut b = Bench::new(&[], 1);
    b.machine.set_flash_image(image).unwrap();
    b.machine.power_cycle();
    b.greet();
    let report = b.settings();
    b.run(0.1);
    (report, b.last.expect("telemetry").fault)
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
    // Setting what is so already is kept too.
    b.set(&set(Setting::SpeedMax, 0.003)).unwrap();
    b.power_cycle();
    b.greet();
    assert_eq!(b.settings(), SettingsReport { values, kept: Kept::These, ..fresh });
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert!(b.machine.stats().warnings.is_empty());
}

#[test]
fn nothing_is_set_while_it_moves_nor_what_is_not_allowed() {
    let mut b = Bench::new(&[], 2);
    b.home();
    let before = b.settings();
    b.ask(&go(0.01)).unwrap();
    b.run(1.0);
    let image = b.machine.flash_image();
    for request in [set(Setting::SpeedMax, 0.003), Request::SetSettings(before.defaults)] {
        assert_eq!(b.ask(&request), Err(Refusal::Busy { state: State::Moving }));
    }
    assert!(b.until(20.0, |b| b.state() == State::Holding));
    let refused = Refusal::SettingOutOfRange { setting: Setting::CurrentLimit, min: 0.05, max: 0.5, given: 0.6 };
    let one_bad = before.defaults.with(Setting::LvdtGain, 1.1).with(Setting::CurrentLimit, 0.6);
    assert_eq!(b.ask(&Request::SetSettings(one_bad)), Err(refused), "all or none");
    let not_finite = Err(Refusal::SettingNotFinite { setting: Setting::GearScale });
    assert_eq!(b.ask(&set(Setting::GearScale, f32::NAN)), not_finite);
    b.run(1.0);
    assert_eq!(b.settings(), before);
    assert!(b.machine.flash_image() == image, "flash was written");
    // While it holds: what leaves the position as it is does, the rest makes it unknown.
    assert_eq!(b.set(&set(Setting::SpeedMax, 0.001)), Ok(Accepted::Started));
    assert_eq!(b.state(), State::Holding);
    let too_fast = b.ask(&go(0.011));
    assert!(matches!(too_fast, Err(Refusal::OutOfRange { max: 0.001, .. })), "{too_fast:?}");
    assert_eq!(b.set(&set(Setting::LvdtOffset, 0.001)), Ok(Accepted::Unhomed));
    assert_eq!((b.state(), b.last.unwrap().position_m), (State::Unhomed, None));
}

/// The times (s) just after each change of flash while one more setting is written, from `image` on.
fn times_of_change(image: &[u8], request: &Request) -> Vec<f64> {
    let mut b = ready_to_set(image, request);
    let mut coarse_s = b.machine.now_s();
    while b.machine.flash_image() == image {
        coarse_s = b.machine.now_s();
        b.machine.run_until(coarse_s + 1e-3).unwrap();
    }
    let mut b = ready_to_set(image, request);
    b.machine.run_until(coarse_s).unwrap();
    let (mut flash, mut times) = (image.to_vec(), Vec::new());
    // A word takes 16 us to be written. A full sector is read through before it is erased.
    while times.last().is_none_or(|last| b.machine.now_s() < *last + 0.05) {
        let now_s = b.machine.now_s();
        b.machine.run_until(now_s + 10e-6).unwrap();
        let now = b.machine.flash_image();
        if now != flash {
            times.push(b.machine.now_s());
            flash = now;
        }
    }
    times
}

/// Flash whose bytes at these places have been erased in part: each round leaves half of the bits that are not.
fn half_erased(image: &[u8], places: &[usize], rounds: u32) -> Vec<u8> {
    let (mut image, mut x) = (image.to_vec(), 0x2545_f491u32.wrapping_mul(2 * rounds + 1));
    for place in places {
        for _ in 0..rounds {
            x ^= x << 13;
            x ^= x >> 17;
            x ^= x << 5;
            image[*place] |= (x >> 24) as u8;
        }
    }
    image
}

/// Just before the board hears this request.
fn ready_to_set(image: &[u8], request: &Request) -> Bench {
    let mut b = Bench::new(&[], 3);
    b.machine.set_flash_image(image).unwrap();
    b.greet();
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    b.post(request);
    b
}

/// Cuts the power before and after each change of flash while `new` is written, and looks at what is there afterwards.
/// At most so many cuts, spread evenly.
fn cut_power(image: &[u8], old: &SettingValues, new: &SettingValues, most: usize) {
    let request = Request::SetSettings(*new);
    let times = times_of_change(image, &request);
    let (first_s, last_s) = (times[0], times[times.len() - 1]);
    let every = times.len().div_ceil(most);
    let (mut olds, mut news) = (0, 0);
    let mut look = |image: &[u8], at_s: f64| {
        let (report, fault) = boot(image);
        assert_eq!((report.kept, fault), (Kept::These, None), "cut at {at_s} s");
        match report.values {
            values if values == *old => olds += 1,
            values if values == *new => news += 1,
            values => panic!("cut at {at_s} s: {values:?}"),
        }
    };
    let mut last = image.to_vec();
    for at_s in [first_s - 40e-6].into_iter().chain(times.iter().copied().step_by(every)).chain([last_s]) {
        let mut b = ready_to_set(image, &request);
        b.machine.run_until(at_s).unwrap();
        let cut = b.machine.flash_image();
        look(&cut, at_s);
        let erased: Vec<usize> = (0x4000..0x1_0000).filter(|k| cut[*k] == 0xFF && last[*k] != 0xFF).collect();
        if erased.len() > 1000 {
            // The real chip takes its time to erase, bit by bit.
            for half in [1, 4, 8, 11].map(|rounds| half_erased(&last, &erased, rounds)) {
                look(&half, at_s);
            }
        }
        last = cut;
    }
    println!(
        "{} changes of flash in {:.1} ms: old values after {olds} cuts, new ones after {news}",
        times.len(),
        (last_s - first_s) * 1e3
    );
    assert!(times.len() > 15 && olds > 0 && news > 0);
}

#[test]
fn a_power_cut_leaves_the_old_values_or_the_new_ones() {
    let mut b = standing(&[], 3);
    let old = b.settings().defaults.with(Setting::LvdtGain, 1.02).with(Setting::PositionZero, 0.004);
    b.set(&Request::SetSettings(old)).unwrap();
    let new = old.with(Setting::LvdtGain, 0.98).with(Setting::TwistSign, -1.0).with(Setting::PositionZero, -0.003);
    cut_power(&b.machine.flash_image(), &old, &new, 30);
}

/// A calibration at 11 points is one record with the other settings.
#[test]
fn a_power_cut_leaves_the_old_points_or_the_new_ones() {
    let mut b = standing(&[], 5);
    let with_points = |values: SettingValues, correction_m: f32| {
        let points: Vec<[f32; 2]> = (0..11u8).map(|k| [0.08 + 2e-3 * f32::from(k), correction_m]).collect();
        SettingValues { lvdt_curve: Some(LvdtCurve::new(&points, 2e-5).unwrap()), ..values }
    };
    let defaults = b.settings().defaults;
    let (old, new) = (with_points(defaults, 1e-4), with_points(defaults, -2e-4));
    let shown_m = b.mean_gap_m();
    b.set(&Request::SetSettings(old)).unwrap();
    assert_eq!(b.settings().values, old);
    assert!((b.mean_gap_m() - shown_m - 1e-4).abs() < 20e-6, "the gap follows");
    let bent = SettingValues { lvdt_curve: b.settings().values.lvdt_curve, ..defaults.with(Setting::LvdtGain, 3.0) };
    assert!(matches!(b.ask(&Request::SetSettings(bent)), Err(Refusal::SettingOutOfRange { .. })), "all or none");
    cut_power(&b.machine.flash_image(), &old, &new, 15);
}

#[test]
fn a_flipped_bit_is_told_and_never_believed() {
    let mut b = standing(&[], 4);
    let older = b.settings().defaults.with(Setting::LvdtGain, 1.02);
    b.set(&Request::SetSettings(older)).unwrap();
    let before = b.machine.flash_image();
    let values = older.with(Setting::LvdtGain, 0.97);
    b.set(&Request::SetSettings(values)).unwrap();
    let image = b.machine.flash_image();
    let (whole, fault) = boot(&image);
    assert_eq!((whole.values, whole.kept, fault), (values, Kept::These, None));
    let written: Vec<usize> = (0x4000..0x1_0000).filter(|k| image[*k] != before[*k]).collect();
    let (mut harmless, mut told) = (0, 0);
    for (k, place) in written.iter().enumerate() {
        let mut broken = image.clone();
        broken[*place] ^= 1 << (k % 8);
        let (report, fault) = boot(&broken);
        match report.kept {
            // It hit the witness.
            Kept::These => {
                assert_eq!((report.values, fault), (values, None), "byte {place:#x}");
                harmless += 1;
            }
            Kept::Damaged => {
                assert_eq!(report.values, report.defaults, "byte {place:#x}");
                assert_eq!(fault, Some(Fault::SettingsCorrupt), "byte {place:#x}");
                told += 1;
            }
            kept => panic!("byte {place:#x}: {kept}"),
        }
    }
    println!("{} bytes, one bit of each flipped: {told} times told, {harmless} times harmless", written.len());
    assert!(told > harmless && harmless > 0);
}

/// Another program in the place of the settings, or noise: there may have been a calibration under it.
#[test]
fn what_nobody_kept_there_is_told_and_not_taken_for_nothing() {
    let empty = Bench::new(&[], 1).machine.flash_image();
    for filled in [0x4000..0x1_0000, 0x8000..0xC000, 0xFFFF..0x1_0000] {
        let mut image = empty.clone();
        let mut random = 0x2545_f491_u32;
        for byte in &mut image[filled.clone()] {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *byte = (random >> 24) as u8;
        }
        let (report, fault) = boot(&image);
        assert_eq!((report.kept, report.values), (Kept::Damaged, report.defaults), "{filled:?}");
        assert_eq!(fault, Some(Fault::SettingsCorrupt), "{filled:?}");
    }
    // Not once they have been set.
    let mut b = standing(&[], 1);
    b.set(&set(Setting::SpeedMax, 0.003)).unwrap();
    let mut image = b.machine.flash_image();
    image[0xC000..0x1_0000].fill(0x5A);
    let (report, fault) = boot(&image);
    assert_eq!((report.kept, report.values.get(Setting::SpeedMax), fault), (Kept::These, 0.003, None));
}

#[test]
fn after_damage_nothing_moves_until_it_is_cleared_or_set_anew() {
    let mut b = standing(&[], 5);
    let values = b.settings().defaults.with(Setting::LvdtGain, 0.97);
    b.set(&Request::SetSettings(values)).unwrap();
    let mut image = b.machine.flash_image();
    let value = image.windows(4).position(|bytes| bytes == 0.97f32.to_le_bytes()).expect("it is in flash");
    image[value + 2] ^= 0x10;
    b.machine.set_flash_image(&image).unwrap();
    b.power_cycle();
    b.greet();
    b.run(3.0);
    let in_fault = Refusal::InFault { fault: Fault::SettingsCorrupt };
    assert_eq!(b.ask(&Request::HOME), Err(in_fault));
    assert_eq!(b.ask(&Request::Jog { twist_speed_rad_per_s: 1.0 }), Err(in_fault));
    assert_eq!(b.settings().kept, Kept::Damaged);
    // Restored: kept at once, and the fault is latched like any other.
    assert_eq!(b.set(&Request::SetSettings(values)), Ok(Accepted::Started));
    assert_eq!(b.ask(&Request::HOME), Err(in_fault));
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert_eq!(b.settings().values, values);
    b.power_cycle();
    b.greet();
    assert!(b.until(5.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    assert_eq!((b.settings().values, b.settings().kept), (values, Kept::These));
}

/// Flash of a board whose settings are all set, and those settings.
fn all_set(current_limit_a: f32) -> (Vec<u8>, SettingValues) {
    let mut b = standing(&[], 7);
    let lvdt_curve = LvdtCurve::new(&[[0.09, 1e-4], [0.1, 2e-4], [0.11, 0.0]], 2e-5).ok();
    let values = SettingValues { numbers: [1e-3, 1.01, 2e-3, -1.0, 1.02, 0.003, current_limit_a, 1.03], lvdt_curve };
    b.set(&Request::SetSettings(values)).unwrap();
    (b.machine.flash_image(), values)
}

/// A board with other firmware on this flash, greeted, and started or in fault.
fn updated(elf: &[u8], scene: &Scene, image: &[u8]) -> Bench {
    let mut b = Bench::with(elf, scene, &[], 1);
    b.machine.set_flash_image(image).unwrap();
    b.machine.power_cycle();
    b.greet();
    b.run(3.0);
    b
}

#[test]
fn an_update_for_another_lvdt_keeps_what_does_not_correct_it_and_waits_for_the_operator() {
    let (image, old) = all_set(0.45);
    let (elf, scene) = other_rig();
    let mut b = updated(elf, scene, &image);
    let report = b.settings();
    assert_eq!(report.defaults.get(Setting::CurrentLimit), 0.4, "the new scene's");
    let dropped: Vec<&str> = report.dropped.names().collect();
    assert_eq!(dropped, ["lvdt-offset", "lvdt-gain", "current-limit", "lvdt-points"]);
    let mut expected = SettingValues { lvdt_curve: None, ..old };
    for setting in [Setting::LvdtOffset, Setting::LvdtGain, Setting::CurrentLimit] {
        expected = expected.with(setting, report.defaults.get(setting));
    }
    assert_eq!((report.kept, report.values), (Kept::Partly, expected));
    let in_fault = Refusal::InFault { fault: Fault::SettingsCorrupt };
    assert_eq!(b.ask(&Request::HOME), Err(in_fault));
    assert_eq!(b.ask(&Request::Jog { twist_speed_rad_per_s: 1.0 }), Err(in_fault));
    assert_eq!(b.machine.board().truth().motor_energy_j, 0.0, "the drive was told something");
    // `clear` accepts the defaults for this run only: flash is as it was, and the next start waits again.
    b.ask(&Request::Clear).unwrap();
    assert!(b.until(6.0, |b| b.state() == State::Unhomed), "{:?}", b.last);
    let again = updated(elf, scene, &b.machine.flash_image());
    assert_eq!(again.last.unwrap().fault, Some(Fault::SettingsCorrupt));
    // Back on the firmware before, everything is there.
    let mut back = updated(firmware(), host_tests::scene(), &b.machine.flash_image());
    assert_eq!((back.settings().values, back.settings().kept, back.state()), (old, Kept::These, State::Unhomed));
    // Calibrated anew, it is a record for this rig.
    b.set(&set(Setting::LvdtGain, 0.99)).unwrap();
    assert!(b.settings().dropped.is_empty());
    let mut calibrated = updated(elf, scene, &b.machine.flash_image());
    assert_eq!((calibrated.state(), calibrated.settings().kept), (State::Unhomed, Kept::These));
    assert_eq!(calibrated.settings().values, expected.with(Setting::LvdtGain, 0.99));
}

/// What is at its default, or still allowed, is not lost by the same update.
#[test]
fn an_update_that_concerns_no_setting_in_flash_is_no_fault() {
    let (_, values) = all_set(0.3);
    let mut b = standing(&[], 8);
    let defaults = b.settings().defaults;
    let values = [Setting::LvdtOffset, Setting::LvdtGain]
        .iter()
        .fold(SettingValues { lvdt_curve: None, ..values }, |values, s| values.with(*s, defaults.get(*s)));
    b.set(&Request::SetSettings(values)).unwrap();
    let (elf, scene) = other_rig();
    let mut b = updated(elf, scene, &b.machine.flash_image());
    assert_eq!((b.settings().values, b.settings().kept, b.state()), (values, Kept::These, State::Unhomed));
}

/// Power may fail between record and witness, and the update come before the next start.
#[test]
fn an_update_after_a_power_cut_still_names_what_it_drops() {
    let mut b = standing(&[], 9);
    let old = b.settings().defaults.with(Setting::LvdtGain, 1.01).with(Setting::SpeedMax, 0.003);
    b.set(&Request::SetSettings(old)).unwrap();
    let (image, request) = (b.machine.flash_image(), Request::SetSettings(old.with(Setting::LvdtGain, 1.02)));
    let (elf, scene) = other_rig();
    let mut behind = 0;
    for at_s in times_of_change(&image, &request) {
        let mut b = ready_to_set(&image, &request);
        b.machine.run_until(at_s).unwrap();
        let cut = b.machine.flash_image();
        let mut b = updated(elf, scene, &cut);
        behind += usize::from(b.machine.flash_image()[0x4000..0x1_0000] != cut[0x4000..0x1_0000]);
        for _ in 0..2 {
            let report = b.settings();
            assert!(report.dropped.names().eq(["lvdt-gain"]), "cut at {at_s} s: {report:?}");
            assert_eq!((report.kept, report.values.get(Setting::SpeedMax)), (Kept::Partly, 0.003));
            assert_eq!(b.last.unwrap().fault, Some(Fault::SettingsCorrupt));
            b = updated(elf, scene, &b.machine.flash_image());
        }
    }
    println!("{behind} starts wrote the witness again");
    assert!(behind > 0);
}

/// Enough writes for a sector to be erased: the values stay, and the watchdog does not bite.
#[test]
fn sectors_that_are_full_are_erased_while_it_holds() {
    let mut b = Bench::new(&[], 6);
    b.home();
    b.ask(&go(0.004)).unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding));
    let gap_m = b.machine.board().truth().gap_m;
    let (mut longest_s, mut erased, mut values) = (0.0f64, 0, b.settings().values);
    let mut full = 0;
    let mut before_erasing = None;
    for k in 0..1000u16 {
        let zero_m = 1e-3 + 1e-6 * f32::from(k);
        let (before_s, before) = (b.machine.now_s(), (b.machine.flash_image(), values));
        b.set(&set(Setting::SpeedMax, zero_m)).unwrap();
        longest_s = longest_s.max(b.machine.now_s() - before_s);
        values = values.with(Setting::SpeedMax, zero_m);
        let image = b.machine.flash_image();
        let used = (0x4000..0x1_0000).filter(|k| image[*k] != 0xFF).count();
        if used < full {
            erased += 1;
            before_erasing = Some(before);
        }
        full = used;
    }
    println!("1000 settings, {erased} erasures, the longest took {longest_s:.2} s");
    assert!(erased >= 1 && longest_s < 0.7);
    assert!(b.machine.stats().resets.is_empty());
    assert_eq!((b.state(), b.last.unwrap().fault), (State::Holding, None));
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
        let mut b = ready_to_set(&half_erased(&dirty, &empty, rounds), &Request::GetSettings);
        for gain in [1.03, 1.04] {
            b.set(&set(Setting::LvdtGain, gain)).unwrap();
            let (report, fault) = boot(&b.machine.flash_image());
            let new = old.with(Setting::LvdtGain, gain);
            assert_eq!((report.values, report.kept, fault), (new, Kept::These, None), "{rounds} rounds");
        }
    }
}

#[test]
fn an_lvdt_that_is_off_in_offset_and_gain_is_calibrated_by_two_points() {
    let keys = [("lvdt_offset", "1mm"), ("lvdt_gain_error", "0.01"), ("twist_at_boot", "1")];
    let moved = |b: &mut Bench| {
        b.ask(&go(0.012)).unwrap();
        assert!(b.until(20.0, |b| b.state() == State::Holding), "{:?}", b.last);
        b.run(1.0);
        (
            b.true_position_m() - 0.012,
            f64::from(b.last.unwrap().load_n.unwrap()) / b.machine.board().truth().load_n - 1.0,
        )
    };
    let mut b = Bench::new(&keys, 7);
    b.home();
    let (before_m, load_before) = moved(&mut b);
    // Callipers: the truth to 20 µm. One point here, one where the load hangs lowest.
    let point = |b: &mut Bench| ((b.machine.board().truth().gap_m / 20e-6).round() * 20e-6, b.mean_gap_m());
    let (gap_1, sensor_1) = point(&mut b);
    b.ask(&go(0.0)).unwrap();
    assert!(b.until(20.0, |b| b.state() == State::Holding), "{:?}", b.last);
    b.run(1.0);
    let (gap_2, sensor_2) = point(&mut b);
    let gain = (gap_1 - gap_2) / (sensor_1 - sensor_2);
    let offset_m = gap_1 - gain * sensor_1;
    let values = b.settings().values;
    let values = values.with(Setting::LvdtGain, gain as f32).with(Setting::LvdtOffset, offset_m as f32);
    assert_eq!(b.set(&Request::SetSettings(values)), Ok(Accepted::Unhomed));
    let shown_m = b.mean_gap_m() - b.machine.board().truth().gap_m;
    b.power_cycle();
    b.home();
    let (after_m, load_after) = moved(&mut b);
    println!(
        "gain {gain:.5}, offset {:+.3} mm; a gap is off by {:+.1} um before and {:+.1} um after; a move to 12 mm ends {:+.1} um \
         off before and {:+.1} um after; load {:+.1} % before, {:+.1} % after",
        offset_m * 1e3,
        (sensor_2 - gap_2) * 1e6,
        shown_m * 1e6,
        before_m * 1e6,
        after_m * 1e6,
        load_before * 100.0,
        load_after * 100.0
    );
    assert!((sensor_2 - gap_2).abs() > 1e-3 && shown_m.abs() < 50e-6);
    assert!(before_m.abs() > 100e-6 && after_m.abs() < 50e-6);
}
