//! The default method finds the right branch on every rod, where others fail.

use lab::chart::grid::Grid;
use lab::chart::stability::{Outcome, RODS, methods, truth, with_rod};
use tsa_model::twist_from_turns;

#[test]
fn the_default_method_finds_the_right_branch_everywhere() {
    let sure = methods().into_iter().filter(|(name, _)| ["first-integral", "continuation"].contains(name));
    let sure: Vec<_> = sure.collect();
    for rod in RODS {
        let mechanism = with_rod(rod).unwrap();
        // Other states than the figure's.
        let grid = Grid::new([0.3, 20.0], 11, [-0.5, 8.0], 13);
        let mut right = 0;
        for (load, turns) in grid.states() {
            let truth = truth(&mechanism, load, twist_from_turns(turns));
            for (name, method) in &sure {
                let outcome = Outcome::judge(&truth, &method.solve(&mechanism, load, twist_from_turns(turns)));
                assert!(!outcome.is_failure(), "{} {name} {load} N {turns} turns: {outcome:?}", rod.0);
                right += usize::from(outcome == Outcome::Right);
            }
        }
        assert!(right > 2 * 11 * 13 * 9 / 10, "{}: only {right} states have an equilibrium", rod.0);
    }
}
