//! What `identify` prints, and the scene file that it writes.

use crate::failure::Failure;
use crate::identify::Identified;
use crate::identify::compete::Verdict;
use crate::identify::constants::Constant;
use crate::identify::fit::Fit;
use crate::identify::plan::Plan;
use crate::output::Output;
use crate::statistics::Errors;
use rig_config::Scene;

/// The unit of the data's errors.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Of sweeps.
    Metres,
    /// Of the paper's numbers.
    Relative,
}

impl Unit {
    fn shown(self, error: f64) -> String {
        match self {
            Self::Metres => format!("{:.2} um", error * 1e6),
            Self::Relative => format!("{:.2} %", error * 1e2),
        }
    }
}

fn summary(name: &str, e: &Errors, unit: Unit) -> String {
    let [rms, median, worst] = [e.rms, e.median, e.worst].map(|x| unit.shown(x));
    format!("{name:<10} {:>4} numbers: rms {rms}, median {median}, worst {worst}", e.count)
}

/// The fit and its constants.
pub fn fit(fit: &Fit, fitted: &Scene, unit: Unit, output: &mut Output) -> Result<(), Failure> {
    output.line(summary("fitted", &fit.fitted, unit))?;
    output.line(summary("held out", &fit.held_out, unit))?;
    for row in &fit.rows {
        row.refused.iter().try_for_each(|why| output.line(format!("refused: {} ({why})", row.id)))?;
    }
    let s = &fitted.string;
    output.line(format!(
        "constants, with half the width of the interval that holds the truth nine times in ten (of positive ones relative; the \
         {} residuals count as {:.0} independent ones):",
        fit.fitted.count, fit.effective_rows
    ))?;
    for e in &fit.estimates {
        let value = match Constant::named(&e.name) {
            Some(Constant::Modulus) => fit.base.stress_coefficients_pa[0] * e.unknown.exp(),
            Some(_) => e.unknown.exp(),
            None => e.unknown,
        };
        output.line(format!("  {:<18} {value:>14.6e}  +- {:.3} %", e.name, e.half_width_90 * 1e2))?;
    }
    let curves = [Constant::OddCurve, Constant::Curve];
    if fit.unknowns.constants.iter().any(|c| curves.contains(c)) {
        let a = fitted.material.stress_coefficients_pa.map(|a| format!("{a:.4e}")).join(", ");
        output.line(format!("  a1..a5 = {a} Pa: a tangent written as sums of squares is nowhere negative"))?;
    }
    output.line(match s.twist_exponent {
        Some(p) => format!("  radius grows as (twist/pi)^p, p = {p:.4}"),
        None if s.k4 > 0.0 => format!("  radius grows by eq. 6 and k4 ln(twist/pi), k4 = {:.4}", s.k4),
        None => "  radius grows by eq. 6".to_owned(),
    })?;
    output.line("correlations:")?;
    for (e, row) in fit.estimates.iter().zip(&fit.correlations) {
        let cells: Vec<String> = row.iter().map(|c| format!("{c:>6.2}")).collect();
        output.line(format!("  {:<18} {}", e.name, cells.join(" ")))?;
    }
    Ok(())
}

/// The scene file, with a head that says where its constants come from.
///
/// # Errors
/// If the scene cannot be written as text.
pub fn file(fit: &Fit, fitted: &Scene, source: &str, unit: Unit) -> Result<String, Failure> {
    let mut text = format!("# Identified by rigctl {} from {source}.\n", env!("CARGO_PKG_VERSION"));
    for line in [summary("fitted", &fit.fitted, unit), summary("held out", &fit.held_out, unit)] {
        text += &format!("# {line}\n");
    }
    for e in &fit.estimates {
        text += &format!("# {}: +- {:.3} % (90 of 100 cases)\n", e.name, e.half_width_90 * 1e2);
    }
    Ok(text + "\n" + &toml::to_string(fitted).map_err(|e| Failure::failed(format!("scene: {e}")))?)
}

/// Tells of an envelope that had to be narrowed for a table, and warns of a scene without one.
pub fn table(before: &Scene, found: &Identified, output: &mut Output) -> Result<(), Failure> {
    if let Some(why) = &found.untabled {
        eprintln!("no table: no firmware can be built for this scene: {why}; ask for less in [accuracy] or [envelope]");
    }
    if let Some(fit) = &found.table {
        output.line(format!("table of this scene: {} bytes", fit.table.numbers.bytes()))?;
    }
    if let (Some(before), Some(after)) = (before.envelope, found.scene.envelope)
        && before != after
    {
        output.line(format!(
            "[envelope] begins at {} N and ends at {} turns, instead of {} N and {} turns: with these constants no table \
             reaches the accuracy beyond",
            after.load_n[0], after.turns[1], before.load_n[0], before.turns[1]
        ))?;
    }
    Ok(())
}

/// The competition, and what follows from it.
pub fn judged(found: &Identified, output: &mut Output) -> Result<(), Failure> {
    let um = |m: Option<f64>| m.map_or_else(|| "-".to_owned(), |m| format!("{:.1} um", m * 1e6));
    output.line("laws, each fitted to a part of the sweeps and predicting the rest:")?;
    output.line(format!(
        "  {:<16} {:<10} {:>9} {:>12} {:>12}",
        "radius law", "material", "constants", "fitted", "held out"
    ))?;
    for s in &found.competition.scored {
        let verdict = match s.verdict {
            Verdict::Chosen => "enough: written",
            Verdict::Indistinguishable => "cannot be told from the best",
            Verdict::Worse => "worse",
            Verdict::Undetermined => "not determined by these sweeps",
        };
        let (fitted, held_out) = (um(s.fitted_rms), um(s.held_out_rms));
        output.line(format!(
            "  {:<16} {:<10} {:>9} {fitted:>12} {held_out:>12}  {verdict}",
            s.law, s.material, s.constants
        ))?;
    }
    let m = &found.misfit;
    let explained = "sensor noise and friction in the mean of up and down explain";
    let rms = format!("the law misses {:.1} um rms, {explained} {:.1} um", m.rms_m * 1e6, m.explained_m * 1e6);
    output.line(match m.holds {
        true => format!("the law holds: {rms}"),
        false => {
            format!("no law holds: {rms}; {:.1} um are left (the best law is taken all the same)", m.excess_m * 1e6)
        }
    })?;
    if let Some(c) = &found.correction {
        output.line(format!(
            "corrected by {} terms in the load times {} in the twist: {:.1} um rms are left; of what is held out the law \
             alone misses {:.1} um, the corrected one {:.1} um",
            c.order[0],
            c.order[1],
            c.rms_m * 1e6,
            c.held_out_without_m * 1e6,
            c.held_out_m * 1e6
        ))?;
    }
    found.uncorrected.iter().try_for_each(|why| output.line(format!("no correction: {why}")))?;
    for l in &found.fit.loops {
        output.line(format!(
            "up and down lie {:.1} um either side of their mean at {:.2} N, as with {:.3} N of friction ({})",
            l.half_width_m * 1e6,
            l.load_n,
            l.friction_n,
            l.sweep
        ))?;
    }
    for m in &found.rod_memory {
        output.line(format!(
            "after {:.2} N, {:.2} N seem {:+.1} +- {:.1} % heavier ({}): the rods remember",
            m.after_n,
            m.load_n,
            m.fraction * 1e2,
            m.half_width_90 * 1e2,
            m.sweep
        ))?;
    }
    for p in &found.predictions {
        let value = match (p.contraction_m, p.half_width_m) {
            (Some(c), Some(h)) => format!("{:.3} +- {:.3} mm (90 of 100 cases)", c * 1e3, h * 1e3),
            _ => "no equilibrium by this law".to_owned(),
        };
        output.line(format!("contraction at {:.2} N and {} turns: {value}", p.load_n, p.turns))?;
    }
    Ok(())
}

/// What to record next.
pub fn next(plan: &Plan, output: &mut Output) -> Result<(), Failure> {
    let [load_n, turns] = plan.at;
    output.line(format!(
        "largest error of a predicted contraction: {:.3} mm at {load_n:.2} N and {turns} turns (90 of 100 cases)",
        plan.largest_half_width_m * 1e3
    ))?;
    output.line(format!(
        "{}: {}",
        if plan.enough { "more sweeps buy nothing" } else { "a further sweep helps" },
        plan.why
    ))?;
    for next in &plan.sweeps {
        output.line(format!(
            "  sweep --load {:.2}N --turns {}: leaves {:.3} mm",
            next.load_n,
            next.turns,
            next.largest_half_width_m * 1e3
        ))?;
    }
    if let Some([load_n, after_n]) = plan.memory {
        output.line(format!(
            "what the rods remember of a heavier load is not measured; sweep --load {load_n:.2}N --after {after_n:.2}N tells it"
        ))?;
    }
    Ok(())
}
