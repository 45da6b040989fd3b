//! What the exports do, in safe code.

use core::fmt::Write;
use heapless::String;
use tsa_model::correction::TERMS;
use tsa_model::rod::TipForce;
use tsa_model::tiers::{TierError, Tiered};
use tsa_model::{
    Correction, Equilibrium, Geometry, Material, Mechanism, ParameterError, Parameters, RadiusLaw, SolveError,
    StringParameters, Tier, twist_from_turns,
};

/// Numbers that the page shares with the solver.
pub const NUMBERS: usize = 128;
/// Points of a drawn rod.
const ROD_POINTS: usize = 41;
/// Longest text; what is longer is cut.
const LONGEST_TEXT: usize = 512;

/// What the page and the solver share, and the mechanism between two calls.
pub struct Page {
    /// Numbers in and out.
    pub numbers: [f64; NUMBERS],
    /// Text out.
    pub text: String<LONGEST_TEXT>,
    mechanism: Option<Mechanism>,
    state: Option<Equilibrium>,
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error("parameter: {0}")]
    Parameter(#[from] ParameterError),
    #[error("{kind}: {0}", kind = .0.kind())]
    Solve(#[from] SolveError),
    /// No constants have been accepted, or there is no such tier.
    #[error("{0}")]
    Call(&'static str),
}

impl Page {
    /// Without constants.
    pub const fn new() -> Self {
        Self { numbers: [0.0; NUMBERS], text: String::new(), mechanism: None, state: None }
    }

    /// Takes the constants: L0, D0, c, R, r0, K, k1, k2, k3, k4, p (NaN with `radius_law = "length-ratio"`), a1 to a5, and
    /// where a measured correction is (1, else 0) its load range, range of turns and coefficients row by row. All as in a
    /// scene file. Constants that are refused leave no mechanism.
    pub fn set_constants(&mut self) -> bool {
        self.mechanism = None;
        self.state = None;
        let answer = mechanism(&self.numbers).map(|mechanism| self.mechanism = Some(mechanism));
        self.answered(answer)
    }

    /// Solves. The result: contraction, gap, TR (NaN at zero twist), α, X, D, w, r, tension, bending strain, sag at the
    /// half-turn pre-twist, ∂G/∂F, and the tier's estimate of its error of contraction and TR. SI units.
    pub fn solve(&mut self, load_n: f64, turns: f64, tier: u32) -> bool {
        let answer = self.solved(load_n, turns, tier);
        self.state = answer.as_ref().ok().map(|(tiered, _)| tiered.equilibrium);
        let answer = answer.map(|(tiered, start_length_m)| {
            let e = &tiered.equilibrium;
            let tr = e.finite_tr_rad_per_m();
            let results = [
                tiered.contraction_m(),
                e.gap_m,
                tr.unwrap_or(f64::NAN),
                e.alpha_rad,
                e.x_m,
                e.d_m,
                e.w_m,
                e.r_m,
                e.tension_n,
                e.bending_strain,
                tiered.start_gap_m - start_length_m,
                e.dgap_dload_m_per_n,
                tiered.error.contraction_m,
                tiered.error.tr_relative,
            ];
            for (place, result) in self.numbers.iter_mut().zip(results) {
                *place = result;
            }
            (e.warnings, tr.is_none())
        });
        let Ok((warnings, no_tr)) = answer else { return self.answered(answer.map(|_| ())) };
        self.text.clear();
        let names = warnings.names().chain(no_tr.then_some("tr-infinite"));
        for (k, name) in names.enumerate() {
            // All names together are shorter than the text.
            let _ = write!(self.text, "{}{name}", if k == 0 { "" } else { "," });
        }
        true
    }

    fn solved(&self, load_n: f64, turns: f64, tier: u32) -> Result<(Tiered, f64), Refusal> {
        let mechanism = self.mechanism.as_ref().ok_or(Refusal::Call("no-constants: the constants are refused"))?;
        let tier = Tier::ALL.get(tier as usize).ok_or(Refusal::Call("tier: there is none of this number"))?;
        let tiered = mechanism.solve_tier(*tier, load_n, twist_from_turns(turns))?;
        Ok((tiered, mechanism.start_length_m()))
    }

    /// The torque on the strings that conserves energy (N m); NaN where a lighter load has no equilibrium at this twist.
    pub fn torque(&self, load_n: f64, turns: f64) -> f64 {
        let torque = |mechanism: &Mechanism| mechanism.conservative_torque_nm(load_n, twist_from_turns(turns)).ok();
        self.mechanism.as_ref().and_then(torque).unwrap_or(f64::NAN)
    }

    /// Number of the cheapest tier that is this accurate, or −1.
    pub fn cheapest(&mut self, load_n: f64, turns: f64, contraction_m: f64, tr_relative: f64) -> i32 {
        let wanted = TierError { contraction_m, tr_relative };
        let answer = match &self.mechanism {
            Some(mechanism) => {
                mechanism.solve_auto(load_n, twist_from_turns(turns), wanted).map_err(Refusal::from).map(|t| t.tier)
            }
            None => Err(Refusal::Call("no-constants: the constants are refused")),
        };
        let number = answer.as_ref().ok().and_then(|tier| Tier::ALL.iter().position(|t| t == tier));
        self.answered(answer.map(|_| ()));
        number.map_or(-1, |k| k as i32)
    }

    /// The bent half of a rod in the state of the last solve; returns the number of points.
    pub fn rod_path(&mut self) -> usize {
        let (Some(mechanism), Some(state)) = (&self.mechanism, &self.state) else { return 0 };
        let mut points = [[0.0; 2]; ROD_POINTS];
        let force = TipForce::of(state);
        let tip = [mechanism.rod().length_m + state.u_m, state.w_m];
        let answer = mechanism.rod().path(force, tip, &mut points);
        for (place, number) in self.numbers.iter_mut().zip(points.as_flattened()) {
            *place = *number;
        }
        if self.answered(answer.map_err(Refusal::from)) { ROD_POINTS } else { 0 }
    }

    /// Keeps the text of a refusal.
    fn answered(&mut self, answer: Result<(), Refusal>) -> bool {
        self.text.clear();
        if let Err(refusal) = &answer {
            // A text that is too long is cut.
            let _ = write!(self.text, "{refusal}");
        }
        answer.is_ok()
    }
}

fn mechanism(n: &[f64; NUMBERS]) -> Result<Mechanism, Refusal> {
    let geometry = Geometry { string_length_m: n[0], rod_span_m: n[1], clamp_width_m: n[2], rod_radius_m: n[3] };
    let radius_law = if n[10].is_nan() { RadiusLaw::LengthRatio } else { RadiusLaw::TwistPower };
    let string = StringParameters {
        diameter_m: n[4],
        stiffness_n_per_m: n[5],
        k1_per_n: n[6],
        k2: n[7],
        k3: n[8],
        k4: n[9],
        radius_law,
        twist_exponent: (radius_law == RadiusLaw::TwistPower).then_some(n[10]),
    };
    let material = Material { stress_coefficients_pa: core::array::from_fn(|k| n[11 + k]) };
    let law = Parameters::new(&geometry, &string, &material)?;
    let correction = (n[16] != 0.0).then(|| Correction {
        load_n: [n[17], n[18]],
        turns: [n[19], n[20]],
        coefficients_m: core::array::from_fn(|row| core::array::from_fn(|k| n[21 + TERMS * row + k])),
    });
    correction.as_ref().map_or(Ok(()), Correction::validate)?;
    Ok(Mechanism::of(Parameters { correction, ..law }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The default scene's; NaN: the law has no exponent.
    fn constants() -> [f64; NUMBERS] {
        let mut numbers = [0.0; NUMBERS];
        numbers[..10].copy_from_slice(&[0.097, 0.032, 0.006, 0.0005, 0.0015, 1370.0, 6.522, 0.127, 0.06878, 0.09601]);
        (numbers[10], numbers[11]) = (f64::NAN, 3.51e10);
        numbers
    }

    fn page() -> Page {
        let mut page = Page::new();
        page.numbers = constants();
        assert!(page.set_constants(), "{}", page.text);
        page
    }

    #[test]
    fn a_state_is_that_of_the_mechanism() {
        let mut page = page();
        let mechanism = mechanism(&constants());
        let Ok(mechanism) = mechanism else { panic!("constants") };
        let e = mechanism.solve(5.0, twist_from_turns(3.0)).unwrap();
        assert!(page.solve(5.0, 3.0, 5));
        assert_eq!([page.numbers[1], page.numbers[2], page.numbers[6]], [e.gap_m, e.tr_rad_per_m(), e.w_m]);
        assert_eq!(page.text, "");
        let points = page.rod_path();
        let tip = [page.numbers[2 * points - 2], page.numbers[2 * points - 1]];
        assert!((tip[0] - 0.013 - e.u_m).abs() < 1e-7 && (tip[1] - e.w_m).abs() < 1e-7, "{tip:?}");
    }

    #[test]
    fn warnings_and_refusals_come_as_text_and_the_next_state_is_solved() {
        let mut page = page();
        assert!(page.solve(0.3, -0.5, 5));
        assert_eq!(page.text, "light-load,open-strings,tr-infinite");
        assert!(page.numbers[2].is_nan());
        for (load_n, turns, tier, kind) in [
            (f64::NAN, 1.0, 5, "not-finite: load"),
            (5.0, f64::INFINITY, 5, "not-finite: twist"),
            (-1.0, 1.0, 5, "slack: "),
            (5.0, 40.0, 5, ""),
            (5.0, 1.0, 6, "tier: "),
        ] {
            assert!(!page.solve(load_n, turns, tier) && page.text.starts_with(kind), "{}", page.text);
            assert_eq!(page.rod_path(), 0);
        }
        assert!(page.solve(5.0, 1.0, 5));
        page.numbers = constants();
        page.numbers[3] = -1.0;
        assert!(!page.set_constants());
        assert!(page.text.contains("geometry.rod_radius_m"));
        assert!(!page.solve(5.0, 1.0, 5) && page.text.starts_with("no-constants"));
    }

    #[test]
    fn the_cheapest_tier_rises_with_the_accuracy() {
        let mut page = page();
        assert_eq!(page.cheapest(5.0, 3.0, 1.0, 1.0), 0);
        let fine = page.cheapest(5.0, 3.0, 1e-6, 1e-4);
        assert!(fine > page.cheapest(5.0, 3.0, 1e-3, 0.1), "{fine}");
        assert_eq!(page.cheapest(5.0, 40.0, 1e-6, 1e-4), -1);
    }
}
