//! What `identify` prints, and the scene file that it writes.

use crate::failure::Failure;
use crate::identify::Identified;
use crate::identify::compete::Verdict;
use crate::identify::constants::Constant;
use crate::identify::fit::Fit;
use crate::identify::plan::Plan;
use crate::output::Output;
use crate::statistics::Errors;
use crate::units::{MM, N, NUMBER, PERCENT, TURNS, UM, Unit};
use rig_config::Scene;

fn summary(name: &str, e: &Errors, unit: Unit) -> String {
    let [rms, median, worst] = [e.rms, e.median, e.worst].map(|x| unit.show(x));
    format!("{name:<10} {:>4} numbers: rms {rms}, median {median}, worst {worst}", e.count)
}

/// The fit and its constants; `unit` is that of the data's errors.
pub fn fit(fit: &Fit, fitted: &Scene, unit: Unit, output: &mut Output) -> Result<(), Failure> {
    output.line(summary("fitted", &fit.fitted, unit))?;
    output.line(summary("held out", &fit.held_out, unit))?;
    for row in &fit.rows {
        row.refused.iter().try_for_each(|why| output.line(format!("refused: {} ({why})", row.id)))?;
    }
    let s = &fitted.string;
    output.line(format!(
        "constants, with their 90 % uncertainty (the {} residuals count as {} independent ones):",
        fit.fitted.count,
        NUMBER.number(fit.effective_rows, 10.0)
    ))?;
    for e in &fit.estimates {
        let unit = Constant::named(&e.name).map_or(1.0, |_| e.value);
        output.line(format!("  {:<18} {}", e.name, NUMBER.within(e.value, unit * e.half_width_90)))?;
    }
    let curves = [Constant::OddCurve, Constant::Curve];
    if fit.unknowns.constants.iter().any(|c| curves.contains(c)) {
        let a = fitted.material.stress_coefficients_pa.map(|a| NUMBER.show(a)).join(", ");
        output.line(format!("  a1..a5 = {a} Pa: a tangent written as sums of squares is nowhere negative"))?;
    }
    output.line(match s.twist_exponent {
        Some(p) => format!("  radius grows as (twist/pi)^p, p = {}", NUMBER.show(p)),
        None if s.k4 > 0.0 => format!("  radius grows by eq. 6 and k4 ln(twist/pi), k4 = {}", NUMBER.show(s.k4)),
        None => "  radius grows by eq. 6".to_owned(),
    })?;
    output.line("correlations:")?;
    for (e, row) in fit.estimates.iter().zip(&fit.correlations) {
        let cells: Vec<String> = row.iter().map(|c| format!("{:>6}", NUMBER.number(*c, 0.1))).collect();
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
        text += &format!("# {}: ± {} (90 % uncertainty)\n", e.name, PERCENT.error(e.half_width_90));
    }
    Ok(text + "\n" + &toml::to_string(fitted).map_err(|e| Failure::failed(format!("scene: {e}")))?)
}

/// Tells of an envelope that had to be narrowed for a table, and warns of a scene without one.
pub fn table(before: &Scene, found: &Identified, output: &mut Output) -> Result<(), Failure> {
    if let Some(why) = &found.untabled {
        crate::output::say!(
            "no table: no firmware can be built for this scene: {why}; ask for less in [accuracy] or [envelope]"
        );
    }
    if let Some(fit) = &found.table {
        output.line(format!("table of this scene: {} bytes", fit.table.numbers.bytes()))?;
    }
    if let (Some(before), Some(after)) = (before.envelope, found.scene.envelope)
        && before != after
    {
        output.line(format!(
            "[envelope] is {} and {} instead of {} and {}: with these constants no table reaches the accuracy beyond",
            N.range(after.load_n),
            TURNS.range(after.turns),
            N.range(before.load_n),
            TURNS.range(before.turns)
        ))?;
    }
    Ok(())
}

/// The competition, and what follows from it.
pub fn judged(found: &Identified, output: &mut Output) -> Result<(), Failure> {
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
        let (fitted, held_out) = (UM.show(s.fitted_rms), UM.show(s.held_out_rms));
        output.line(format!(
            "  {:<16} {:<10} {:>9} {fitted:>12} {held_out:>12}  {verdict}",
            s.law, s.material, s.constants
        ))?;
    }
    let m = &found.residual;
    let explained = "sensor noise and friction in the mean of up and down explain";
    let rms = format!("its residual is {} rms, {explained} {}", UM.show(m.rms_m), UM.show(m.explained_m));
    output.line(match m.holds {
        true => format!("the law holds: {rms}"),
        false => {
            format!("no law holds, the best is taken: {rms}; {} is left", UM.show(m.excess_m))
        }
    })?;
    if let Some(c) = &found.correction {
        output.line(format!(
            "corrected by {} terms in the load times {} in the twist: {} rms is left; of what is held out the law alone \
             misses {}, the corrected one {}",
            c.order[0],
            c.order[1],
            UM.show(c.rms_m),
            UM.show(c.held_out_without_m),
            UM.show(c.held_out_m)
        ))?;
    }
    found.uncorrected.iter().try_for_each(|why| output.line(format!("no correction: {why}")))?;
    for l in &found.fit.loops {
        output.line(format!(
            "up and down lie {} either side of their mean at {}, as with {} of friction ({})",
            UM.show(l.half_width_m),
            N.show(l.load_n),
            N.show(l.friction_n),
            l.sweep
        ))?;
    }
    for m in &found.rod_memory {
        output.line(format!(
            "after {}, {} seems heavier by {} ({}): the rods' hysteresis",
            N.show(m.after_n),
            N.show(m.load_n),
            PERCENT.within(m.fraction, m.half_width_90),
            m.sweep
        ))?;
    }
    for p in &found.predictions {
        let value = match (p.contraction_m, p.half_width_m) {
            (Some(c), Some(h)) => MM.within(c, h) + " (90 % uncertainty)",
            _ => "no equilibrium by this law".to_owned(),
        };
        output.line(format!("contraction at {} and {}: {value}", N.show(p.load_n), TURNS.exact(p.turns)))?;
    }
    Ok(())
}

/// What to record next.
pub fn next(plan: &Plan, output: &mut Output) -> Result<(), Failure> {
    let [load_n, turns] = plan.at;
    output.line(format!(
        "largest 90 % uncertainty of a predicted contraction: {} at {} and {}",
        MM.error(plan.largest_half_width_m),
        N.show(load_n),
        TURNS.exact(turns)
    ))?;
    output.line(format!(
        "{}: {}",
        if plan.enough { "more sweeps buy nothing" } else { "a further sweep helps" },
        plan.why
    ))?;
    for next in &plan.sweeps {
        output.line(format!(
            "  sweep --load {}N --turns {}: leaves {}",
            NUMBER.show(next.load_n),
            NUMBER.exact(next.turns),
            MM.error(next.largest_half_width_m)
        ))?;
    }
    if let Some([load_n, after_n]) = plan.memory {
        output.line(format!(
            "the rods' hysteresis after a heavier load is not measured: sweep --load {}N --after {}N measures it",
            NUMBER.show(load_n),
            NUMBER.show(after_n)
        ))?;
    }
    Ok(())
}
