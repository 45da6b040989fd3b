//! The linear margins of `rigctl chart --only margin` against the emulated rig with all that is not linear in it.

use host_tests::ControlBench;
use host_tests::compare::baseline::{Law, Loop};
use host_tests::compare::plants::RandomPlant;
use host_tests::compare::{Comparison, play};
use host_tests::scenario::Scenario;
use lab::chart::margin::{Controller, DAMPING, DRIVE_PER_S, Hung};
use rig_control::{Inputs, LvdtBlock, TICK_S};
use rig_emulator::rig::built_in::STRUCTURAL_DAMPING_S;
use rig_emulator::rig::drive::{POSITION_LOOP_PER_S, VELOCITY_LOOP_RAD_PER_S};
use rig_emulator::rig::plant_settings::PlantSettings;
use rig_link::messages::{LoadChoice, State};
use rigctl::script::Script;
use sim_link::units::STANDARD_GRAVITY;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use tsa_model::{Mechanism, twist_from_turns};

/// Fixed ratio (rad/m) and corner (rad/s) of the loop that is driven to its limit.
const RATIO: f64 = 2757.0;
const CORNER: f64 = 24.0;
/// Where it ends (m).
const TARGET_M: f64 = 12e-3;

/// The tool must not link the emulator, so it has its constants a second time.
#[test]
fn the_linear_rig_is_the_emulated_one() {
    assert_eq!(DRIVE_PER_S, [POSITION_LOOP_PER_S, VELOCITY_LOOP_RAD_PER_S]);
    assert_eq!(DAMPING, [PlantSettings::default().damping_n_s_per_m, STRUCTURAL_DAMPING_S]);
}

/// As the table's, but for what the wire and the sensor add.
fn nominal() -> RandomPlant {
    let settings = [
        "k2_scale=1",
        "k3_scale=1",
        "stiffness_scale=1",
        "modulus_scale=1",
        "friction=0N",
        "damping=1",
        "gear_backlash=0",
        "lvdt_noise=30um",
        "supply_voltage=24V",
    ];
    settings.iter().fold(RandomPlant::new(1), |plant, s| plant.with(s.parse().unwrap()))
}

/// The rig at a height (m) above the half-turn pre-twist.
fn hung_at(mechanism: &Mechanism, load_n: f64, height_m: f64) -> Hung {
    let gap = |twist: f64| mechanism.solve(load_n, twist).unwrap().gap_m;
    let (mut low, mut high) = (twist_from_turns(0.0), twist_from_turns(7.5));
    let wanted = gap(low) - height_m;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if gap(middle) > wanted { low = middle } else { high = middle }
    }
    Hung::at(mechanism, load_n, low).unwrap()
}

/// How far the load still swings, 20 s after the set-point has arrived (m).
fn swing_m(comparison: &Comparison<'_>, scenario: &Scenario, gain_per_s: f64) -> f64 {
    let law = Law::Loop(Loop {
        tr_rad_per_m: Some(RATIO as f32),
        gain_per_s: gain_per_s as f32,
        corner_rad_per_s: CORNER as f32,
        crossing_rad: 0.0,
    });
    let case = &comparison.cases[0];
    let records = play::baseline(case.ready.clone().unwrap(), law, scenario, &case.along).records;
    let last = records.last().unwrap();
    let end = &last.positions_m[last.positions_m.len() - 200..];
    let [low, high] = end.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(*p), h.max(*p)]);
    high - low
}

#[test]
fn a_fixed_ratio_swings_from_the_gain_on_at_which_it_should() {
    let mechanism = host_tests::scene().mechanism().unwrap();
    for (load, load_n) in [("0.15kg", 0.15 * 9.80665), ("1.5kg", 1.5 * 9.80665)] {
        let controller = Controller { gain_per_s: 1.0, corner_rad_per_s: CORNER, ..Controller::fixed(RATIO) };
        let limit = hung_at(&mechanism, load_n, TARGET_M).gain_margin(&controller);
        let script = format!("0 plant load={load}\n2.5 home\n50 move {TARGET_M} speed=2mm/s\n80 end\n");
        let scenario = [Scenario::new(load, &Script::parse(&script).unwrap()).unwrap()];
        let comparison = Comparison::new(&scenario, &[nominal()]).unwrap();
        assert_eq!(comparison.failures, []);
        let [below, above] = [0.9, 1.1].map(|part| swing_m(&comparison, &scenario[0], part * limit));
        println!("{load}: limit {limit:.2} 1/s; swing {:.0} um below it, {:.0} um above", below * 1e6, above * 1e6);
        assert!(below < 60e-6, "{load}: {below} m at 0.9 of {limit} 1/s");
        assert!(above > 150e-6, "{load}: {above} m at 1.1 of {limit} 1/s");
    }
}

#[test]
fn the_scheduled_loop_has_a_margin_of_two_where_a_fixed_one_is_unstable() {
    let scene = host_tests::scene();
    let (mechanism, [least_n, most_n]) = (scene.mechanism().unwrap(), scene.envelope.unwrap().load_n);
    let part = |k: u32| f64::from(k) / 7.0;
    let load_n = |k: u32| least_n * (most_n / least_n).powf(part(k));
    let states = (0..8).flat_map(|i| (0..8).map(move |j| (load_n(i), 7.5 * part(j))));
    let margins = states.map(|(load_n, turns)| {
        let hung = Hung::at(&mechanism, load_n, twist_from_turns(turns)).unwrap();
        [Controller::scheduled(), Controller::fixed(RATIO)].map(|c| hung.gain_margin(&c))
    });
    let least = margins.fold([f64::INFINITY; 2], |[a, b], [c, d]| [a.min(c), b.min(d)]);
    assert!(least[0] > 2.0 && least[1] < 1.0, "{least:?}");
}

/// How far the load still swings (m), 6 s after only a share of it was kept, when the gap comes by so many ticks later than its time
/// stamp says; on a rig without friction.
fn swing_with_delay_m(load_kg: f64, kept: f64, ticks: usize) -> f64 {
    let load = format!("{load_kg}kg");
    let mut bench = ControlBench::new(&[("load", &load), ("friction", "0N"), ("lvdt_noise", "30um")], 7);
    bench.home().unwrap();
    bench.move_to(0.008, 0.004, LoadChoice::Auto).unwrap();
    bench.run(1.0);
    let waiting = Mutex::new(VecDeque::new());
    bench.tamper = Some(Arc::new(move |inputs: &mut Inputs| {
        let mut waiting = waiting.lock().unwrap();
        waiting.push_back(inputs.lvdt);
        let late = if waiting.len() > ticks { waiting.pop_front().flatten() } else { None };
        let newest_us = inputs.lvdt.map(|block| block.t_us);
        inputs.lvdt = late.zip(newest_us).map(|(block, t_us)| LvdtBlock { t_us, ..block });
    }));
    bench.rig.set_plant("load", &format!("{}kg", kept * load_kg)).unwrap();
    bench.run(6.0);
    assert_eq!(bench.control.state(), State::Holding, "{}", bench.control.faults());
    let mut range_m = [f64::INFINITY, f64::NEG_INFINITY];
    bench.until(2.0, |bench| {
        let position_m = bench.true_position_m();
        range_m = [range_m[0].min(position_m), range_m[1].max(position_m)];
        false
    });
    range_m[1] - range_m[0]
}

#[test]
fn the_firmwares_loop_swings_from_the_delay_on_at_which_it_should() {
    let mechanism = host_tests::scene().mechanism().unwrap();
    for load_kg in [0.3, 0.5, 0.8, 1.2] {
        let hung = hung_at(&mechanism, 0.99 * load_kg * STANDARD_GRAVITY, 8e-3);
        let margin_ticks = hung.delay_margin(&Controller::damped(), 0.2) / f64::from(TICK_S);
        let [below, above] = [(0.8 * margin_ticks) as usize, (1.25 * margin_ticks).ceil() as usize];
        let swings = [below, above].map(|ticks| swing_with_delay_m(load_kg, 0.99, ticks) * 1e6);
        println!("{load_kg} kg: {margin_ticks:.1} ticks; {swings:.0?} um with {below} and {above}");
        assert!(swings[0] < 60.0, "{load_kg} kg: swings with {below} of {margin_ticks} ticks");
        assert!(swings[1] > 300.0, "{load_kg} kg: does not swing with {above} of {margin_ticks} ticks");
    }
}

/// Limits of speed make the margin of a large step smaller than that of a small one.
#[test]
fn a_load_that_loses_a_fifth_of_its_weight_is_caught_with_20_ms_of_unknown_delay() {
    for load_kg in [0.3, 0.6, 1.0, 1.4] {
        let swing_um = 1e6 * swing_with_delay_m(load_kg, 0.8, 2);
        assert!(swing_um < 60.0, "{load_kg} kg: {swing_um} um");
    }
}
