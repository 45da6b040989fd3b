//! The default method finds the right branch on every rod, where others fail.

use lab::chart::grid::Grid;
use lab::chart::rods::RODS;
use lab::chart::stability::{Outcome, methods, truth};
use tsa_model::{Mechanism, twist_from_turns};

fn judged(mechanism: &Mechanism, method: &str, load_n: f64, turns: f64) -> Outcome {
    let method = methods().into_iter().find(|m| m.name == method).unwrap().method;
    let twist_rad = twist_from_turns(turns);
    Outcome::judge(&truth(mechanism, load_n, twist_rad), &method.solve(mechanism, load_n, twist_rad))
}

#[test]
fn the_default_method_finds_the_right_branch_everywhere() {
    for case in &RODS {
        let mechanism = case.mechanism().unwrap();
        // Other states than the figure's.
        let grid = Grid::new([0.3, 20.0], 11, [-0.5, 8.0], 13);
        let mut right = 0;
        for (load, turns) in grid.states() {
            for method in ["first-integral", "continuation"] {
                let outcome = judged(&mechanism, method, load, turns);
                assert!(!outcome.is_failure(), "{} {method} {load} N {turns} turns: {outcome:?}", case.title);
                right += usize::from(outcome == Outcome::Right);
            }
        }
        assert!(right > 2 * 11 * 13 * 9 / 10, "{}: only {right} states have an equilibrium", case.title);
    }
}
