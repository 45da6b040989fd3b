//! What each setting does to the rig: the control code alone against the emulated rig.

use super::{go, set};
use host_tests::ControlBench;
use rig_control::DriveCommand;
use rig_link::messages::{Accepted, LoadChoice, Refusal, Request, Setting, SettingValues, State};

fn bench(values: impl Fn(SettingValues) -> SettingValues, keys: &[(&str, &str)], seed: u64) -> ControlBench {
    let mut d = ControlBench::new(keys, seed);
    let values = values(rig_control::settings::defaults(&host_tests::constants()));
    d.control.set_up(&values);
    d
}

fn ask(d: &mut ControlBench, request: Request) -> Result<Accepted, Refusal> {
    d.tick(Some(request)).reply.expect("every setting is answered")
}

#[test]
fn strings_are_twisted_either_way() {
    for sign in [1.0, -1.0] {
        let mut d = bench(|v| v.with(Setting::TwistSign, sign), &[("twist_at_boot", "6")], 1);
        d.home().unwrap_or_else(|e| panic!("{sign}: {e}"));
        let homed = d.truth().twist_rad;
        assert!((homed - f64::from(sign) * std::f64::consts::PI).abs() < 0.05, "{sign}: {homed}");
        d.move_to(0.01, 0.002, LoadChoice::Auto).unwrap_or_else(|e| panic!("{sign}: {e}"));
        d.run(1.0);
        let t = d.last.as_ref().unwrap().telemetry;
        assert!((d.true_position_m() - 0.01).abs() < 50e-6, "{sign}: {}", d.true_position_m());
        assert!((d.truth().twist_rad - f64::from(sign * t.twist_rad.unwrap())).abs() < 0.05);
        assert!((f64::from(t.load_n.unwrap()) / d.truth().load_n - 1.0).abs() < 0.05, "{t:?}");
    }
}

#[test]
fn settings_are_taken_up_at_rest_and_the_strings_stay_where_they_are() {
    for (setting, value) in
        [(Setting::TwistSign, -1.0), (Setting::GearScale, 1.3), (Setting::LvdtGain, 1.1), (Setting::LvdtOffset, 0.02)]
    {
        let mut d = bench(|v| v, &[("twist_at_boot", "6")], 2);
        d.home().unwrap();
        d.move_to(0.008, 0.002, LoadChoice::Auto).unwrap();
        let twist = d.truth().twist_rad;
        assert_eq!(ask(&mut d, set(setting, value)), Ok(Accepted::Unhomed), "{setting}");
        assert_eq!((d.control.state(), d.control.homed()), (State::Unhomed, None), "{setting}");
        d.run(2.0);
        assert_eq!(d.control.fault(), None, "{setting}");
        assert!((d.truth().twist_rad - twist).abs() < 0.02, "{setting}: from {twist} to {}", d.truth().twist_rad);
        assert_eq!(ask(&mut d, go(0.004)), Err(Refusal::NotHomed));
        // The same value again changes nothing, so there is nothing to lose.
        assert_eq!(ask(&mut d, set(setting, value)), Ok(Accepted::Started), "{setting}");
    }
}

#[test]
fn refused_while_it_homes_moves_or_starts() {
    let mut d = bench(|v| v, &[("twist_at_boot", "6")], 3);
    let request = set(Setting::SpeedMax, 0.01);
    assert_eq!(ask(&mut d, request), Err(Refusal::DriveNotReady));
    assert!(d.until(5.0, |d| d.control.state() == State::Unhomed));
    d.tick(Some(Request::HOME));
    for setting in Setting::ALL {
        let default = rig_control::settings::defaults(&host_tests::constants()).get(*setting);
        assert_eq!(ask(&mut d, set(*setting, default)), Err(Refusal::Busy { state: State::Homing }));
    }
    assert!(d.until(60.0, |d| d.control.state() == State::Ready));
    d.tick(Some(go(0.005)));
    assert_eq!(ask(&mut d, request), Err(Refusal::Busy { state: State::Moving }));
    assert!(d.until(20.0, |d| d.control.state() == State::Holding));
    assert_eq!(ask(&mut d, request), Ok(Accepted::Started));
}

#[test]
fn position_zero_moves_the_scale_and_not_the_load() {
    let mut d = bench(|v| v, &[("twist_at_boot", "6")], 4);
    d.home().unwrap();
    d.move_to(0.006, 0.002, LoadChoice::Auto).unwrap();
    d.run(1.0);
    let gap_m = d.truth().gap_m;
    assert_eq!(ask(&mut d, set(Setting::PositionZero, 0.006)), Ok(Accepted::Started));
    assert_eq!(d.control.state(), State::Holding);
    d.run(2.0);
    let position_m = d.last.as_ref().unwrap().telemetry.position_m.unwrap();
    assert!(position_m.abs() < 30e-6 && (d.truth().gap_m - gap_m).abs() < 20e-6, "{position_m}");
    // Down to where it hung, and not further; and up as far as before.
    assert!(matches!(ask(&mut d, go(-0.0065)), Err(Refusal::OutOfRange { .. })));
    d.move_to(-0.006, 0.002, LoadChoice::Auto).unwrap();
    d.run(1.0);
    assert!(d.true_position_m().abs() < 50e-6, "{}", d.true_position_m());
    d.move_to(0.004, 0.002, LoadChoice::Auto).unwrap();
    d.run(1.0);
    assert!((d.true_position_m() - 0.010).abs() < 50e-6, "{}", d.true_position_m());
    // And after the next homing.
    d.home().unwrap();
    d.run(0.2);
    let position_m = d.last.as_ref().unwrap().telemetry.position_m.unwrap();
    assert!((position_m + 0.006).abs() < 100e-6, "{position_m}");
    d.move_to(0.0, 0.002, LoadChoice::Auto).unwrap();
    d.run(1.0);
    assert!((d.true_position_m() - 0.006).abs() < 50e-6, "{}", d.true_position_m());
}

#[test]
fn speed_and_current_limits_are_kept_to() {
    let values = |v: SettingValues| v.with(Setting::SpeedMax, 0.002).with(Setting::CurrentLimit, 0.3);
    let mut d = bench(values, &[("twist_at_boot", "6")], 5);
    d.home().unwrap();
    let fast = Request::Move { target_m: 0.01, speed_m_per_s: 0.0021, load: LoadChoice::Auto };
    assert!(matches!(ask(&mut d, fast), Err(Refusal::OutOfRange { max: 0.002, .. })));
    d.tick(Some(go(0.01)));
    for _ in 0..300 {
        let DriveCommand::Follow { current_limit_ma, .. } = d.tick(None).drive else { panic!("it moves") };
        assert_eq!(current_limit_ma, 300);
    }
}

/// A gear that is not the scene's: homing puts the strings where they would be with that one, or does not fit them.
#[test]
fn another_gear_is_corrected() {
    // The board believes 1.1 times the scene's gear: a half turn is a tenth less of the true one.
    let mut d = bench(|v| v.with(Setting::GearScale, 1.0 / 1.1), &[("twist_at_boot", "6")], 6);
    assert!(d.until(5.0, |d| d.control.state() == State::Unhomed));
    d.prove();
    let turned = |d: &mut ControlBench| {
        let before = d.truth().twist_rad;
        d.tick(Some(Request::Jog { twist_speed_rad_per_s: 2.0 }));
        d.run(2.0);
        d.tick(Some(Request::Stop));
        d.run(1.0);
        d.truth().twist_rad - before
    };
    let scaled = turned(&mut d);
    assert_eq!(ask(&mut d, set(Setting::GearScale, 1.0)), Ok(Accepted::Started));
    let nominal = turned(&mut d);
    assert!((scaled / nominal - 1.0 / 1.1).abs() < 2e-3, "{scaled} of {nominal}");
}

/// Strings that are thicker than the scene says: homing that expects what was learned weighs the load better.
#[test]
fn a_scale_that_was_learned_makes_the_next_homing_better() {
    let (mut without, mut with) = (0.0f64, 0.0f64);
    for (seed, load) in [(1, "0.15kg"), (2, "0.5kg"), (3, "1.0kg")] {
        let keys = [("k2_scale", "1.1"), ("load", load), ("twist_at_boot", "6")];
        let error =
            |d: &ControlBench| (f64::from(d.control.homed().unwrap().found.load_n) / d.truth().load_n - 1.0).abs();
        let mut d = bench(|v| v, &keys, seed);
        d.home().unwrap();
        without += error(&d) / 3.0;
        for k in 0..12 {
            d.move_to(if k % 2 == 0 { 0.012 } else { 0.002 }, 0.002, LoadChoice::Auto).unwrap();
        }
        let learned = d.control.homed().unwrap().found.twist_scale;
        assert_eq!(ask(&mut d, set(Setting::TwistScale, learned)), Ok(Accepted::Started));
        assert_eq!(d.control.state(), State::Holding, "it is the next homing that it is for");
        d.home().unwrap();
        println!("{load}: learned {learned:.4}, load {:+.2} % off at the next homing", 100.0 * error(&d));
        with += error(&d) / 3.0;
    }
    println!("load at homing off by {:.2} % in the mean, {:.2} % with what was learned", without * 100.0, with * 100.0);
    assert!(with < without);
}
