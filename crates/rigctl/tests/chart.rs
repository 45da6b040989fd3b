//! Where each method fails and how, pinned; and that the default one does not.

use rigctl::chart::rods::RODS;
use rigctl::chart::stability::{Grid, Outcome, methods, truth};
use tsa_model::{Mechanism, twist_from_turns};

fn rod(title: &str) -> Mechanism {
    RODS.iter().find(|r| r.title == title).unwrap().mechanism().unwrap()
}

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

/// Rod, method, load (N), turns, outcome, name of the error: each in the midst of others alike.
const FAILURES: [(&str, &str, f64, f64, &str, &str); 17] = [
    ("near-flat plateau", "paper, factor 1", 13.5, 0.6, "diverged", "diverged"),
    ("near-flat plateau", "adaptive-shooting", 13.5, 0.6, "diverged", "diverged"),
    ("near-flat plateau", "collocation", 4.72, 7.4, "diverged", "diverged"),
    ("slender", "paper, factor 1", 4.72, 7.0, "diverged", "diverged"),
    ("slender", "paper, factor 1", 1.27, 7.4, "refused", "overtwist"),
    ("slender", "paper, factor 0.5", 3.63, 5.8, "diverged", "diverged"),
    ("slender", "paper, factor 0.5", 4.72, 4.6, "wrong-branch", ""),
    ("slender", "adaptive-shooting", 0.977, 7.0, "refused", "overtwist"),
    ("slender", "adaptive-shooting", 6.14, 3.8, "wrong-branch", ""),
    ("slender", "collocation", 1.65, 5.8, "diverged", "diverged"),
    ("slender", "collocation", 6.14, 2.2, "wrong-branch", ""),
    ("more slender", "paper, factor 1", 2.15, 3.0, "diverged", "diverged"),
    ("more slender", "paper, factor 1", 0.977, 3.8, "wrong-branch", ""),
    ("more slender", "paper, factor 0.5", 0.977, 3.8, "wrong-branch", ""),
    ("more slender", "adaptive-shooting", 7.98, 5.8, "diverged", "not-converged"),
    ("more slender", "adaptive-shooting", 1.27, 4.6, "wrong-branch", ""),
    ("more slender", "collocation", 0.977, 7.0, "refused", "no-equilibrium"),
];

#[test]
fn each_failing_method_fails_where_and_how_it_did() {
    for (title, method, load, turns, name, kind) in FAILURES {
        let mechanism = rod(title);
        let outcome = judged(&mechanism, method, load, turns);
        assert_eq!((outcome.name(), outcome.kind()), (name, kind), "{title} {method} {load} N {turns}: {outcome:?}");
        // Where they fail, the default one does not.
        assert_eq!(judged(&mechanism, "first-integral", load, turns), Outcome::Right, "{title} {load} N {turns}");
        if let Outcome::Wrong { off_m } = outcome {
            assert!(off_m > 1e-2, "{title} {method}: {off_m} m is hardly another branch");
        }
    }
}
