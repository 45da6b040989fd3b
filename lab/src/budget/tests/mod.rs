use super::*;
use rig_config::Uncertainty;
use rig_plant::RigPreset;

pub(super) fn scene() -> Scene {
    Scene::from_toml_str(include_str!("../../../../scenes/default.toml")).unwrap()
}

/// Parts of a rig of its own model but for some plant keys.
fn of<'a>(scene: &'a Scene, keys: &[(PlantKey, f64)]) -> Budget<'a> {
    let size = |key| keys.iter().find(|(of, _)| *of == key).map_or(0.0, |(_, size)| *size);
    Budget::new(scene, &RigErrors { sizes: &size, gauge_m: None }).unwrap()
}

fn kind_of(scene: &Scene, kind: RigPreset) -> Budget<'_> {
    Budget::new(scene, &RigErrors { sizes: &|key| kind.rms(key), gauge_m: None }).unwrap()
}

fn near(found: f64, wanted: f64, fraction: f64, what: &str) {
    assert!((found / wanted - 1.0).abs() < fraction, "{what}: {found}, not {wanted}");
}

/// Standard errors of a part at a state: position (m) and load.
fn at(budget: &Budget<'_>, part: Part, load: usize, twist: usize) -> [f64; 2] {
    budget.under[load].parts[part as usize][twist].map(f64::sqrt)
}

/// The gain of a warm LVDT makes a way wrong by its fraction.
#[test]
fn a_wrong_gain_makes_the_way_wrong() {
    let scene = scene();
    let (warm, cold) = (of(&scene, &[(PlantKey::Temperature, 10.0)]), of(&scene, &[]));
    let column = &warm.under[3].column.0;
    let [with, without] = [&warm, &cold].map(|budget| at(budget, Part::Sensor, 3, 30)[0]);
    let distance_m = column[0].gap_m - column[30].gap_m;
    near((with * with - without * without).sqrt(), 2e-3 * distance_m, 0.02, "way");
}

/// 90 of 100 LVDTs without a calibration are within what the control code states for them.
#[test]
fn the_sensor_is_about_as_wrong_as_the_control_code_states() {
    let scene = scene();
    let size = scene.rig.lvdt_linearity * 0.68;
    let budget = of(&scene, &[(PlantKey::LvdtNonlinearity, size)]);
    let column = &budget.under[3].column.0;
    let distance_m = column[0].gap_m - column[30].gap_m;
    let stated_m = f64::from(scene.constants().lvdt_change_error().of(distance_m as f32));
    near(NINETY * at(&budget, Part::Sensor, 3, 30)[0], stated_m, 0.1, "stated");
}

/// A jump is twice what stiction exceeds friction by, over the stiffness; the loop leaves half of it.
#[test]
fn a_load_rests_within_a_share_of_its_jump() {
    let scene = scene();
    let keys = [(PlantKey::Friction, 0.2), (PlantKey::FrictionLoadShare, 0.02), (PlantKey::StictionRatio, 0.3)];
    let budget = of(&scene, &keys);
    let state = budget.under[5].column.0[10];
    let softer = scene.mechanism().unwrap().solve(state.load_n + 1e-3, state.twist_rad).unwrap().gap_m;
    let jump_m = 2.0 * 0.3 * (0.2 + 0.02 * state.load_n) * (softer - state.gap_m) / 1e-3;
    near(at(&budget, Part::Friction, 5, 10)[0], 0.5 * jump_m / 3f64.sqrt(), 0.01, "rest");
    // Without any key there is the friction of the ideal rig, which has no stiction.
    assert_eq!(at(&of(&scene, &[]), Part::Friction, 5, 10)[0], 0.0);
}

/// The constants' share of the load's error goes with the zero that was measured, not with what the LVDT adds to it.
#[test]
fn a_zero_counts_by_the_scene_alone() {
    let by_zero = |gap_zero_m: f64| {
        let mut scene = scene();
        scene.uncertainty = Uncertainty { radius: 1e-6, load_shape: 1e-6, gap_zero_m, ..scene.uncertainty };
        at(&of(&scene, &[]), Part::Law, 3, 30)[1]
    };
    let [once, twice] = [10e-6, 20e-6].map(by_zero);
    near(twice, 2.0 * once, 0.03, "load");
}

/// Strings that stretch by so much look like a load that stretches the gap by as much.
#[test]
fn a_stretch_looks_like_a_load() {
    let scene = scene();
    let budget = of(&scene, &[(PlantKey::StringCreep, 0.2)]);
    let state = budget.under[5].column.0[10];
    // Between 20 s and 620 s: the second of three elements all but exp(-1/3), the third by a third.
    let crept = (((-20.0f64 / 60.0).exp() - (-620.0f64 / 60.0).exp())
        + ((-20.0f64 / 1800.0).exp() - (-620.0f64 / 1800.0).exp())
        + (-20.0f64 / 3.0).exp())
        / 3.0;
    let whole_m = 0.2 * state.load_n / (2.0 * scene.string.stiffness_n_per_m);
    let stretch_m = whole_m * crept;
    let heavier = scene.mechanism().unwrap().solve(state.load_n * 1.001, state.twist_rad).unwrap().gap_m;
    let load = stretch_m / (heavier - state.gap_m) * 1e-3;
    // Of the stretch that was there while homing, the fit takes nearly all for load, and the rest for the LVDT's zero.
    let homed = 1.0 - ((-20.0f64 / 3.0).exp() + (-20.0f64 / 60.0).exp() + (-20.0f64 / 1800.0).exp()) / 3.0;
    let under = &budget.under[5];
    let taken = under.homing.gap(&under.column.each(|_| whole_m * homed)).0;
    assert!((0.5..1.0).contains(&(taken / load * crept / homed)), "{taken} of {load}");
    near(at(&budget, Part::Memory, 5, 10)[1], load + taken, 0.05, "load");
    assert!(at(&budget, Part::Memory, 5, 10)[0] < 1e-6, "a stretch is measured");
}

/// A tier that has no answer changes nothing; the full one makes no error; a rigid rod a large one.
#[test]
fn a_tier_is_the_difference_of_its_gap() {
    let scene = scene();
    let mut budget = of(&scene, &[]);
    assert!(budget.set_tier(Tier::Full));
    assert!(budget.fraction(Part::Tier).load < 1e-12);
    assert!(budget.set_tier(Tier::Rigid));
    let rigid = budget.fraction(Part::Tier).load;
    assert!(budget.set_tier(Tier::Elastica));
    assert!(rigid > 100.0 * budget.fraction(Part::Tier).load);
}

/// A table whose errors are as large as is worth raises the total by no more than that; one that is the model not at all.
#[test]
fn a_table_that_is_worth_having_adds_little() {
    let scene = scene();
    let mut budget = kind_of(&scene, RigPreset::Nominal);
    let without = budget.total();
    let worth = budget.worth();
    let rough = Scene { accuracy: Some(worth), ..scene.clone() };
    budget.set_table(&rough.fit_table().unwrap().table.table());
    let with = budget.total();
    for [before, after] in [[without.position_m, with.position_m], [without.load, with.load]] {
        assert!(after >= before && after <= (1.0 + WORTH) * before, "{before:?} {after:?}");
    }
    assert!(budget.fraction(Part::Table).load > 0.0);
}

/// A gap curve that is wrong by a ramp of 1 mm/rad makes the ratio wrong and the move lag by ε v/K.
#[test]
fn a_wrong_ratio_makes_a_move_lag() {
    let scene = scene();
    let mut budget = of(&scene, &[]);
    let under = &mut budget.under[3];
    let later = under.column.each(|s| 0.1 * s.gap_m);
    let homed = under.column.each(|_| 0.0);
    under.clear(Part::Law);
    under.add_gap(&Effect { later, ..Effect::homed(Part::Law, homed) });
    near(at(&budget, Part::Law, 3, 15)[0], 0.1 * 2e-3 / BANDWIDTH_PER_S, 0.02, "a tenth of the ratio");
}

#[test]
fn worse_rigs_are_worth_no_better_tables() {
    let scene = scene();
    let worth = RigPreset::ALL.map(|kind| {
        let budget = kind_of(&scene, kind);
        (budget.worth(), budget.total())
    });
    for [(better, small), (worse, large)] in [[worth[0], worth[1]], [worth[1], worth[2]]] {
        assert!(worse.tr_relative >= better.tr_relative, "{better:?} {worse:?}");
        assert!(large.position_m > small.position_m && large.load > small.load);
    }
    assert!(worth[2].0.contraction_m > worth[0].0.contraction_m, "{worth:?}");
    assert!(worth[0].0.tr_relative < MAX_TR_ERROR, "an ideal rig's position tells a tenth of the ratio");
    assert_eq!(worth[2].0.tr_relative, MAX_TR_ERROR, "the loop must stay stable on the worst rig");
}

#[test]
fn ninety_of_a_hundred_lie_within_the_half_width() {
    near(half_width(&[4.0; 7]), 2.0 * NINETY, 1e-3, "one normal");
    // Of ten states one is so wide that it holds none, so all of the others must lie inside.
    assert!(half_width(&[1e-12, 1e-12, 1e-12, 1e-12, 1e-12, 1e-12, 1e-12, 1e-12, 1e-12, 1.0]) < 1e-2);
    assert_eq!(half_width(&[0.0, 0.0]), 0.0);
}

#[test]
fn numbers_are_cut_to_two_digits() {
    for (value, text) in [(2.97e-5, "0.000029"), (0.1, "0.1"), (123.0, "120"), (0.0999, "0.099")] {
        assert_eq!(two_digits(value).to_string(), text);
    }
}

#[test]
fn a_scene_without_an_envelope_or_beyond_a_limit_is_refused_by_name() {
    let mut scene = scene();
    scene.envelope = None;
    let refused = |scene: &Scene| {
        Budget::new(scene, &RigErrors { sizes: &|_| 0.0, gauge_m: None }).err().expect("refused").to_string()
    };
    assert!(refused(&scene).contains("[envelope]"));
    scene.envelope = Some(rig_config::Envelope { load_n: [0.5, 18.0], turns: [0.0, 40.0] });
    assert!(refused(&scene).contains("envelope.turns"));
}

/// What a rough table adds rises, falls where homing relies less on the gap, and rises again: the first crossing counts.
#[test]
fn the_least_size_that_adds_too_much_is_found() {
    let bump = |size: f64| vec![if size < 2e-3 { 1e3 * size } else { 0.0 } + if size > 0.5 { 10.0 } else { 0.0 }];
    // 5 % more of a standard error of 1.
    near(max_added(&[1.0], bump), 1e-3 * (1.05f64.powi(2) - 1.0).sqrt(), 1e-3, "bump");
    near(max_added(&[100.0], bump), 0.5, 1e-3, "later");
}

/// Few turns, and one load twice: there are still states enough for the fit.
#[test]
fn a_small_envelope_has_a_budget() {
    let mut scene = scene();
    for (load_n, turns) in [([5.0, 5.01], [0.0, 0.5]), ([0.5, 18.0], [0.0, 0.1]), ([2.0, 3.0], [6.9, 7.0])] {
        scene.envelope = Some(rig_config::Envelope { load_n, turns });
        let mut budget = kind_of(&scene, RigPreset::Hard);
        budget.choose_tier();
        let (total, worth) = (budget.total(), budget.worth());
        for number in [total.position_m, total.load, worth.contraction_m, worth.tr_relative] {
            assert!(number > 0.0 && number.is_finite(), "{turns:?}: {total:?} {worth:?}");
        }
    }
}
