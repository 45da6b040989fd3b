//! Moves, holds, jogs and streams of a homed rig whose every number is known.

use crate::bench::{Bench, to};
use crate::fixture::{constants, near, table};
use rig_control::TICK_S;
use rig_link::messages::{Accepted, Doubt, Doubts, EventKind, Fault, Limit, Refusal, Request, Setting, State};
use std::f32::consts::PI;
use tsa_table::record::StoredTable;

#[test]
fn a_move_brings_the_load_to_its_target_in_the_time_that_is_told() {
    for (load_n, friction_n) in [(5.0, 0.01), (1.5, 0.03)] {
        let mut bench = Bench::new(load_n, friction_n, 9.0);
        bench.home();
        for (target_m, speed_m_per_s) in [(0.010, 0.002), (0.003, 0.004), (0.0035, 0.002), (0.012, f32::INFINITY)] {
            let from_m = bench.position_m();
            bench.begin(to(target_m, speed_m_per_s));
            let reported_s = bench.shown().time_left_s.expect("it is planned");
            assert_eq!(bench.shown().target_m, Some(target_m));
            let (mut ticks, mut arrived, mut fastest) = (0u16, 0u16, 0f32);
            while bench.rig.state() == State::Moving && ticks < 3000 {
                let left_s = bench.shown().time_left_s.unwrap();
                bench.tick(None);
                ticks += 1;
                fastest = fastest.max(bench.gap_speed_m_per_s.abs());
                let shown = bench.shown();
                assert!(shown.time_left_s.unwrap() <= left_s + 1e-6);
                let set_point_m = shown.setpoint_m.unwrap();
                assert!((from_m.min(target_m) - 0.1e-3..from_m.max(target_m) + 0.1e-3).contains(&set_point_m));
                if set_point_m != target_m {
                    arrived = ticks;
                }
                // What is shown is what is: the position with the noise of one tick and its 6 ms of age.
                near(shown.position_m.unwrap(), bench.position_m(), 25e-6 + 7e-3 * bench.gap_speed_m_per_s.abs());
                near(shown.twist_rad.unwrap(), bench.twist_rad, 7e-3);
                near(shown.load_n.unwrap(), load_n, 0.07 * load_n);
                let [_, _, by_twist] = bench.gap_at(load_n, bench.twist_rad);
                near(shown.tr_rad_per_m.unwrap() * -by_twist, 1.0, 0.02);
            }
            assert_eq!(bench.rig.state(), State::Holding, "{:?}", bench.rig.fault());
            let took_s = TICK_S * f32::from(arrived);
            near(reported_s, took_s, 0.1 + 0.05 * took_s);
            // It has been near for 0.3 s.
            assert!((29..120).contains(&(ticks - arrived)), "{ticks} {arrived}");
            assert!(fastest < 1.4 * speed_m_per_s, "{fastest}");
            let Some(EventKind::MoveDone { error_m }) = bench.events.last() else { panic!("{:?}", bench.events) };
            assert!(error_m.abs() < 30e-6, "{error_m}");
            bench.run(100);
            near(bench.position_m(), target_m, 25e-6);
            assert_eq!((bench.shown().time_left_s, bench.shown().target_m), (Some(0.0), Some(target_m)));
            assert_eq!(bench.shown().setpoint_m, Some(target_m));
            near(bench.shown().load_n.unwrap(), load_n, 0.07 * load_n);
        }
    }
}

#[test]
fn as_fast_as_possible_is_as_fast_as_the_motor_turns_and_is_told() {
    let mut bench = Bench::homed();
    bench.begin(to(0.014, f32::INFINITY));
    let (mut fastest, mut limits) = (0f32, Vec::new());
    for _ in 0..3000 {
        let before_rad = bench.twist_rad;
        bench.tick(None);
        fastest = fastest.max((bench.twist_rad - before_rad) / TICK_S);
        limits.extend(bench.shown().limit);
        if bench.rig.state() != State::Moving {
            break;
        }
    }
    let most = constants().twist_speed_max();
    assert!((0.9 * most..1.001 * most).contains(&fastest), "{fastest} of {most}");
    assert!(limits.contains(&Limit::MotorSpeed), "{limits:?}");
    bench.run(50);
    assert_eq!(bench.shown().limit, None);
}

#[test]
fn a_fast_way_down_brakes_for_the_ratio_at_its_end() {
    // TR rises on the way: what the motor can brake at its beginning would be too much at its end.
    for load_n in [1.2, 5.0] {
        let mut bench = Bench::new(load_n, 0.01, 9.0);
        bench.home();
        bench.move_to(0.014, 0.004);
        bench.begin(to(0.001, f32::INFINITY));
        let mut past_m = 0f32;
        while bench.rig.state() == State::Moving {
            bench.tick(None);
            past_m = past_m.max(0.001 - bench.position_m());
        }
        assert!(past_m < 4e-6, "{past_m}");
    }
}

#[test]
fn a_load_that_becomes_heavier_or_lighter_is_brought_back_and_known() {
    for change_n in [0.6f32, -0.6] {
        let mut bench = Bench::homed();
        bench.move_to(0.008, 0.002);
        bench.run(100);
        let (before_n, held_m) = (bench.shown().load_n.unwrap(), bench.position_m());
        bench.load_n += change_n;
        bench.run(4);
        assert!((held_m - bench.position_m()) * change_n > 0.0, "it sinks under more");
        bench.run(296);
        // Position is counted from the gap at homing, which hung at the old load.
        let position_m = bench.shown().position_m.unwrap();
        near(position_m, 0.008, 40e-6);
        near(bench.shown().load_n.unwrap() - before_n, change_n, 0.15);
        // It differs by more than a tenth from what homing confirmed.
        assert_eq!(bench.shown().doubts, Doubts::of(&[Doubt::LoadUnknown]));
        // A move up and a move down confirm it.
        bench.move_to(0.012, 0.004);
        bench.move_to(0.004, 0.004);
        bench.run(50);
        assert_eq!(bench.shown().doubts, Doubts::NONE);
    }
}

#[test]
fn strings_that_turn_as_fast_as_they_can_bring_a_load_that_has_become_heavier_to_its_target() {
    let mut bench = Bench::homed();
    bench.begin(to(0.014, f32::INFINITY));
    while bench.shown().setpoint_m.unwrap() < 0.004 {
        bench.tick(None);
    }
    // The weight lets it down by more than the distance at which a load that does not follow is a fault.
    bench.load_n += 3.0;
    let mut behind_m = 0.0f32;
    while bench.rig.state() == State::Moving {
        bench.tick(None);
        behind_m = behind_m.max(bench.shown().setpoint_m.unwrap() - bench.shown().position_m.unwrap());
    }
    assert!(behind_m > 2.1e-3, "{behind_m} m");
    assert_eq!((bench.rig.state(), bench.rig.fault()), (State::Holding, None));
    near(bench.shown().position_m.unwrap(), 0.014, 50e-6);
}

#[test]
fn a_limit_on_the_motion_does_not_hide_a_doubt_about_the_load() {
    let mut bench = Bench::homed();
    bench.move_to(0.008, 0.002);
    bench.load_n += 0.6;
    bench.run(300);
    bench.begin(to(0.014, f32::INFINITY));
    let mut both = false;
    for _ in 0..300 {
        bench.tick(None);
        let shown = bench.shown();
        both |= shown.limit == Some(Limit::MotorSpeed) && shown.doubts.contains(Doubt::LoadUnknown);
    }
    assert!(both, "at the motor's limit the load is still said to be unknown");
}

#[test]
fn a_stop_brakes_and_the_next_move_goes_on_from_there() {
    let mut bench = Bench::homed();
    bench.begin(to(0.012, 0.004));
    bench.run(150);
    let (at_m, speed) = (bench.position_m(), bench.gap_speed_m_per_s.abs());
    near(speed, 0.004, 0.4e-3);
    assert_eq!(bench.ask(Request::Stop), Ok(Accepted::Done));
    assert_eq!(bench.shown().time_left_s, None, "it is not known how long a stop takes");
    bench.while_in(State::Moving);
    assert_eq!(bench.events.last(), Some(&EventKind::Stopped));
    let braked_m = bench.position_m() - at_m;
    assert!((0.1e-3..1e-3).contains(&braked_m), "{braked_m}");
    bench.run(50);
    near(bench.shown().setpoint_m.unwrap(), bench.position_m(), 30e-6);
    bench.move_to(0.002, 0.004);
    near(bench.position_m(), 0.002, 30e-6);
    // A move that follows another one at once needs no rest between.
    bench.begin(to(0.010, 0.004));
    bench.run(100);
    bench.begin(to(0.004, 0.004));
    bench.while_in(State::Moving);
    near(bench.position_m(), 0.004, 30e-6);
}

#[test]
fn a_jog_turns_at_its_speed_within_the_strings_range() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.start();
    let from_rad = bench.twist_rad;
    let jog = |twist_speed_rad_per_s| Request::Jog { twist_speed_rad_per_s };
    bench.begin(jog(3.0));
    assert_eq!(bench.rig.state(), State::Moving);
    // 25 rad/s²: at speed after 0.12 s.
    bench.run(100);
    near(bench.twist_rad, from_rad + 3.0 * (1.0 - 0.06), 0.06);
    bench.begin(jog(-2.0));
    bench.run(50);
    let from_rad = bench.twist_rad;
    bench.run(50);
    near(bench.twist_rad - from_rad, -1.0, 0.01);
    assert_eq!(bench.ask(Request::Stop), Ok(Accepted::Done));
    // 2 rad/s at 25 rad/s² are eight ticks, of which that of the request is one.
    assert_eq!(bench.while_in(State::Moving), 7);
    assert_eq!((bench.rig.state(), bench.events.last()), (State::Unhomed, Some(&EventKind::Stopped)));
    for speed in [4.01, f32::NAN] {
        assert!(bench.ask(jog(speed)).is_err());
    }
    // A homed rig knows where its strings' range ends, either way.
    bench.home();
    bench.begin(jog(4.0));
    for _ in 0..2000 {
        let before = bench.speed_rad_per_s;
        bench.run(1);
        // It brakes into the end as gently as it sets out.
        assert!((bench.speed_rad_per_s - before).abs() < 0.3, "{before} {}", bench.speed_rad_per_s);
    }
    near(bench.twist_rad, table().metadata.twist_max_rad, 0.06);
    assert_eq!((bench.shown().limit, bench.rig.state()), (Some(Limit::Travel), State::Moving));
    bench.begin(jog(-4.0));
    bench.run(100);
    near(bench.twist_rad, table().metadata.twist_max_rad - 4.0 * (1.0 - 0.08), 0.1);
    assert_eq!(bench.shown().limit, None);
}

#[test]
fn settings_act_at_once_and_those_that_change_the_units_unhome() {
    let mut bench = Bench::homed();
    bench.move_to(0.006, 0.004);
    let set = |setting, value| Request::SetSetting { setting, value };
    // Zero is called another height: the load stays.
    bench.begin(set(Setting::PositionZero, -0.002));
    near(bench.shown().position_m.unwrap(), 0.008, 30e-6);
    bench.run(100);
    near(bench.shown().position_m.unwrap(), 0.008, 30e-6);
    near(bench.position_m(), 0.006, 30e-6);
    assert_eq!(bench.rig.state(), State::Holding);
    assert_eq!(bench.shown().setpoint_m.map(|m| (1e6 * m).round()), Some(8000.0));
    bench.begin(set(Setting::SpeedMax, 0.001));
    assert!(bench.ask(to(0.010, 0.002)).is_err());
    bench.begin(to(0.010, 0.001));
    let refused = bench.tick(Some(set(Setting::SpeedMax, 0.002)));
    assert_eq!(refused.reply, Some(Err(Refusal::Busy { state: State::Moving })));
    assert!(!refused.save_settings && !bench.tick(Some(Request::Stop)).save_settings);
    bench.while_in(State::Moving);
    assert!(bench.tick(Some(set(Setting::SpeedMax, 0.001))).save_settings, "what is taken is to be saved");
    bench.begin(to(0.010, 0.001));
    bench.while_in(State::Moving);
    near(bench.position_m(), 0.008, 30e-6);
    assert!(bench.ask(set(Setting::SpeedMax, -1.0)).is_err());
    let twist_rad = bench.twist_rad;
    assert_eq!(bench.ask(set(Setting::LvdtGain, 1.01)), Ok(Accepted::Unhomed));
    assert_eq!(bench.rig.state(), State::Unhomed);
    bench.run(100);
    assert_eq!((bench.rig.fault(), bench.shown().position_m), (None, None));
    near(bench.twist_rad, twist_rad, 0.01);
}

#[test]
fn what_is_shown_of_motor_sensors_and_errors_is_what_is() {
    let mut bench = Bench::homed();
    let found = bench.rig.homed().unwrap().found;
    bench.run(20);
    near(bench.shown().load_error_n.unwrap(), found.load_error_n, 0.3 * found.load_error_n);
    near(bench.shown().position_error_m.unwrap(), 1.645 * found.gap_noise_m, 1e-7);
    bench.begin(to(0.010, 0.004));
    bench.run(150);
    // Twist speed by the gear, in whole rpm; a few milliamperes.
    let motor_rad_per_s = bench.speed_rad_per_s * bench.constants.gear_ratio;
    near(bench.shown().drive_speed_rad_per_s, motor_rad_per_s, 0.06);
    assert!((0.3e-3..5e-3).contains(&bench.shown().drive_current_a), "{}", bench.shown().drive_current_a);
    bench.while_in(State::Moving);
    bench.run(50);
    // The sine of the LVDT's non-linearity has its slope, whose greater part counts, over the way since homing.
    let rig = constants();
    let by_lvdt_m = 0.77 * 2.0 * PI * rig.lvdt_linearity_m / rig.lvdt_stroke_m * 0.010;
    let expected_m = by_lvdt_m.hypot(1.645 * found.gap_noise_m);
    near(bench.shown().position_error_m.unwrap(), expected_m, 0.02 * expected_m);
    let sensors = bench.sensors.as_ref().unwrap();
    let shaft_rad = bench.twist_rad + bench.zero_rad();
    near(sensors.shaft_rad, shaft_rad, 1e-3);
    near(sensors.drive_rad.unwrap(), shaft_rad + 3000.0 / bench.constants.counts_per_rad, 1e-3);
    near(sensors.gap_m.unwrap(), bench.gap_m, 20e-6);
    near(sensors.rest_tolerance_m.unwrap(), 1.645 * found.gap_noise_m, 1e-7);
}

#[test]
fn the_position_error_counts_from_where_the_load_hung_at_homing_whatever_position_zero_is() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.start();
    bench.begin(Request::SetSetting { setting: Setting::PositionZero, value: 0.02 });
    let found = bench.home();
    bench.run(20);
    near(bench.shown().position_error_m.unwrap(), 1.645 * found.gap_noise_m, 1e-7);
}

#[test]
fn strings_are_untwisted_only_a_little_below_the_half_turn() {
    let mut bench = Bench::homed();
    bench.move_to(0.001, 0.004);
    bench.load_n -= 1.5;
    bench.run(400);
    near(bench.twist_rad, PI - 0.15, 0.01);
    assert_eq!((bench.shown().limit, bench.rig.state()), (Some(Limit::Travel), State::Holding));
}

#[test]
fn a_load_that_sticks_ends_within_half_of_a_jump() {
    let mut bench = Bench::new(1.5, 0.02, 9.0);
    bench.while_in(State::Boot);
    bench.begin(Request::HOME);
    // Before the load is weighed.
    bench.run(900);
    bench.stiction_n = 0.12;
    bench.while_in(State::Homing);
    let found = bench.rig.homed().expect("homed").found;
    // It jumps by 2 (Fs − Fc)/k.
    assert!(found.jump_m > 0.0, "{found:?}");
    for target_m in [0.006f32, 0.002, 0.009, 0.004] {
        bench.begin(to(target_m, 0.001));
        bench.while_in(State::Moving);
        bench.run(300);
        assert_eq!(bench.shown().setpoint_m, Some(target_m), "it is held where it was sent");
        let error_m = bench.position_m() - target_m;
        assert!(error_m.abs() < 0.5 * found.jump_m + 30e-6, "{error_m} of a jump of {}", found.jump_m);
    }
}

#[test]
fn another_table_is_taken_while_nothing_moves_and_unhomes() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.tick(None);
    assert!(!bench.rig.stands(), "it starts");
    let mut bench = Bench::homed();
    bench.begin(to(0.004, 0.004));
    assert!(!bench.rig.use_table(&StoredTable::copy_of(table())) && !bench.rig.stands());
    bench.while_in(State::Moving);
    assert!(bench.rig.stands() && bench.rig.use_table(&StoredTable::copy_of(table())));
    assert_eq!(bench.rig.state(), State::Unhomed);
}

#[test]
fn a_move_whose_load_is_jammed_near_its_target_ends_after_six_seconds_and_tells_how_far_it_is() {
    let mut bench = Bench::homed();
    bench.begin(to(0.006, 0.002));
    for _ in 0..1000 {
        if bench.shown().setpoint_m.unwrap() > 5.9e-3 {
            break;
        }
        bench.tick(None);
    }
    bench.friction_n = 100.0;
    let ticks = bench.while_in(State::Moving);
    assert!((590..720).contains(&ticks), "{ticks}");
    let Some(EventKind::MoveDone { error_m }) = bench.events.last() else { panic!("{:?}", bench.events) };
    near(*error_m, bench.shown().position_m.unwrap() - 0.006, 1e-6);
    assert!(*error_m < -30e-6, "{error_m}");
}

#[test]
fn strings_neither_pull_much_harder_nor_fall_slack_on_a_load_that_jams_under_way() {
    for (target_m, speed) in [(0.012, 0.2e-3), (0.012, 1e-3), (0.012, 4e-3), (0.0, 1e-3), (0.0, 4e-3)] {
        let mut bench = Bench::homed();
        bench.move_to(0.006, 0.004);
        bench.begin(to(target_m, speed));
        bench.run(60);
        bench.friction_n = 100.0;
        let fault = bench.ticks_until_fault(3000).map(|(_, fault)| fault);
        let beyond_n = (bench.pull_n - bench.load_n).abs();
        // What counts as a jam, and what the strings turn before the load is 0.3 mm behind.
        assert!(
            fault == Some(Fault::FollowingError) && beyond_n < 4.5,
            "{target_m} m, {speed} m/s: {fault:?}, {beyond_n} N"
        );
    }
}

/// The weight changes by 2 N a second. A load that is taken for jammed would be left beside its place.
#[test]
fn a_load_whose_weight_is_changed_by_hand_comes_back_to_its_place_and_moves_on() {
    for to_n in [14.0f32, 9.0, 2.0] {
        let mut bench = Bench::homed();
        bench.friction_n = 0.1;
        bench.move_to(0.006, 0.004);
        let before_m = bench.gap_m;
        while bench.load_n != to_n {
            bench.load_n += (to_n - bench.load_n).clamp(-0.02, 0.02);
            bench.tick(None);
        }
        bench.run(150);
        near(bench.gap_m, before_m, 60e-6);
        bench.begin(to(0.004, 0.004));
        bench.while_in(State::Moving);
        assert_eq!(bench.rig.state(), State::Holding);
        near(bench.gap_m, before_m + 0.002, 60e-6);
    }
}

#[test]
fn a_move_ends_where_the_strings_do_when_its_load_becomes_too_heavy_for_the_target() {
    let mut bench = Bench::homed();
    let Err(Refusal::OutOfRange { max, .. }) = bench.ask(to(0.1, 0.006)) else { panic!("it is out of range") };
    bench.begin(to(max - 0.1e-3, 0.006));
    bench.run(100);
    bench.load_n += 0.6;
    bench.while_in(State::Moving);
    assert_eq!((bench.rig.state(), bench.shown().limit), (State::Holding, Some(Limit::Travel)));
    near(bench.twist_rad, table().metadata.twist_max_rad, 0.02);
    let Some(EventKind::MoveDone { error_m }) = bench.events.last() else { panic!("{:?}", bench.events) };
    assert!((-1e-3..-0.1e-3).contains(error_m), "{error_m}");
}

#[test]
fn a_scale_that_a_move_has_taught_leaves_the_load_as_certain_as_it_was() {
    for twist_scale in [0.99, 1.01] {
        let mut bench = Bench::new(5.0, 0.01, 9.0);
        let homed_scale = Some(bench.home().twist_scale);
        bench.twist_scale = twist_scale;
        bench.settle();
        bench.run(100);
        bench.begin(to(0.014, 0.004));
        let mut before_n = 0.0;
        while bench.shown().twist_scale == homed_scale {
            before_n = bench.shown().load_error_n.expect("an error");
            bench.tick(None);
        }
        for _ in 0..60 {
            bench.tick(None);
            let error_n = bench.shown().load_error_n.expect("an error");
            assert!(error_n < before_n + 0.05, "{twist_scale}: {before_n} N, and then {error_n} N");
        }
    }
}
