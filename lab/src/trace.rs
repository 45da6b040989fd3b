//! Contraction and TR of one mechanism at one load, along the turns, and where the model ends.

use rigctl::failure::Refused;
use tsa_model::{Equilibrium, Mechanism, SolveError, twist_from_turns};

/// One state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Turns past the half-turn pre-twist.
    pub turns: f64,
    /// Contraction since the half-turn pre-twist (m).
    pub contraction_m: f64,
    /// Transmission ratio (rad/m); infinite at zero twist.
    pub tr_rad_per_m: f64,
}

/// The end of a curve at a limit of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct End {
    /// The last state before it; none if already the first is refused.
    pub at: Option<Point>,
    /// The limit.
    pub limit: Refused,
}

/// Contraction and TR along the turns.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// States that the strings can reach.
    pub reached: Vec<Point>,
    /// Past overtwist: the equations' root, which no strings can reach ([`Mechanism::formal`]).
    pub formal: Vec<Point>,
    /// The limits, in order: of `reached`, then of `formal`.
    pub ends: Vec<End>,
}

/// Follows one mechanism from one number of turns to a greater one in equal steps. Limits are found to within rounding.
pub fn trace(mechanism: &Mechanism, load_n: f64, [from, to]: [f64; 2], steps: u32) -> Trace {
    let mut trace = Trace::default();
    let start = match mechanism.formal(load_n, twist_from_turns(0.0)) {
        Ok(start) => start,
        Err(e) => {
            trace.ends.push(End { at: None, limit: e.into() });
            return trace;
        }
    };
    let point = |turns: f64, e: &Equilibrium| Point {
        turns,
        contraction_m: start.gap_m - e.gap_m,
        tr_rad_per_m: e.tr_rad_per_m(),
    };
    let solve = |formal: bool, turns: f64| {
        let twist = twist_from_turns(turns);
        if formal { mechanism.formal(load_n, twist) } else { mechanism.solve(load_n, twist) }
    };
    let mut formal = false;
    for k in 0..=steps {
        let turns = from + (to - from) * f64::from(k) / f64::from(steps.max(1));
        let mut answer = solve(formal, turns);
        while let Err(error) = answer {
            let way = if formal { &mut trace.formal } else { &mut trace.reached };
            if let Some(last) = way.last().copied() {
                let limit = last_before(|turns| solve(formal, turns).ok().map(|e| point(turns, &e)), last, turns);
                way.push(limit);
            }
            trace.ends.push(End { at: way.last().copied(), limit: error.into() });
            if formal || !matches!(error, SolveError::Overtwist { .. }) {
                return trace;
            }
            formal = true;
            trace.formal.extend(trace.reached.last().copied());
            answer = solve(formal, turns);
        }
        if let Ok(e) = answer {
            if formal { &mut trace.formal } else { &mut trace.reached }.push(point(turns, &e));
        }
    }
    trace
}

/// The last point with an answer, by bisection between a point that has one and turns that have none.
fn last_before(answer: impl Fn(f64) -> Option<Point>, mut good: Point, mut bad_turns: f64) -> Point {
    for _ in 0..48 {
        let middle = 0.5 * (good.turns + bad_turns);
        match answer(middle) {
            Some(point) => good = point,
            None => bad_turns = middle,
        }
    }
    good
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_config::Scene;

    fn scene() -> Scene {
        Scene::from_toml_str(include_str!("../../scenes/paper-identified.toml")).unwrap()
    }

    #[test]
    fn a_whole_way_has_no_end() {
        let trace = trace(&scene().mechanism().unwrap(), 7.5, [0.0, 7.5], 30);
        assert_eq!((trace.reached.len(), trace.formal.len(), trace.ends.len()), (31, 0, 0));
        assert_eq!(trace.reached[0].contraction_m, 0.0);
        assert!(trace.reached.is_sorted_by(|a, b| a.contraction_m < b.contraction_m));
    }

    #[test]
    fn an_overtwisted_way_ends_where_the_strings_lie_side_by_side() {
        let mut scene = scene();
        scene.string.diameter_m = 0.0025;
        let mechanism = scene.mechanism().unwrap();
        let trace = trace(&mechanism, 7.5, [0.0, 7.5], 30);
        let end = trace.ends[0].at.unwrap();
        assert_eq!(trace.ends[0].limit.kind, "overtwist");
        assert_eq!(trace.reached.last(), Some(&end));
        assert_eq!(trace.formal[0], end);
        let state = mechanism.solve(7.5, twist_from_turns(end.turns)).unwrap();
        let needed = 0.0025 * state.twist_rad / std::f64::consts::PI;
        assert!((state.x_m - needed).abs() < 1e-9, "{} against {needed}", state.x_m);
    }

    #[test]
    fn a_slack_way_has_not_even_a_start() {
        let trace = trace(&scene().mechanism().unwrap(), 0.0, [0.0, 7.5], 3);
        assert_eq!((trace.reached.len(), trace.ends[0].at), (0, None));
        assert_eq!(trace.ends[0].limit.kind, "slack");
    }
}
