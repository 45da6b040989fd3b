//! The README's table of specifications, from the records.

use super::Records;
use super::page::table;
use anyhow::{Context, Result};

/// What encloses the table in the README.
const BEGIN: &str = "<!-- written by `cargo xtask results` -->\n";
const END: &str = "<!-- end -->\n";

/// The README with its table of specifications written anew.
pub(super) fn replaced(readme: &str, records: &Records) -> Result<String> {
    let (before, rest) = readme.split_once(BEGIN).with_context(|| format!("README.md has no line {BEGIN:?}"))?;
    let (_, after) = rest.split_once(END).with_context(|| format!("README.md has no line {END:?}"))?;
    Ok(format!("{before}{BEGIN}{}{END}{after}", table(&rows(records)?)))
}

/// A number of a section.
fn value(records: &Records, section: &str, name: &str) -> Result<f64> {
    let record = records.get(section).with_context(|| format!("not measured yet: cargo xtask results {section}"))?;
    record.measured.values.get(name).copied().with_context(|| format!("section {section} has no value {name}"))
}

fn rows(records: &Records) -> Result<Vec<Vec<String>>> {
    let demo = |name: &str| value(records, "demo", name);
    let chosen = |name: &str| value(records, "table", name);
    let model = |name: &str| value(records, "bench", name);
    let compared = |name: &str| value(records, "compare", name);
    let long = |name: &str| value(records, "endurance", name);
    let image = |name: &str| value(records, "image", name);
    let rigs = |name: &str| value(records, "rigs", name);
    let row = |what: &str, text: String| vec![what.to_owned(), text];
    Ok(vec![
        row("", "emulated, but for the times of the solver".into()),
        row(
            "loads of the default scene",
            format!(
                "{} to {} N, 0 to {:.1} turns of the strings past the half-turn pre-twist",
                chosen("load_min_n")?,
                chosen("load_max_n")?,
                chosen("turns_max")?
            ),
        ),
        row(
            "transmission ratio in a 12 mm move",
            format!(
                "{:.1} to {:.1} rad/mm under 0.1 kg, {:.1} to {:.1} rad/mm under 1.5 kg",
                demo("tr_start_light_rad_per_mm")?,
                demo("tr_end_light_rad_per_mm")?,
                demo("tr_start_heavy_rad_per_mm")?,
                demo("tr_end_heavy_rad_per_mm")?
            ),
        ),
        row(
            "error of position at rest",
            format!(
                "{:.0} µm in 95 of 100 cases on calibrated nominal rigs; {:.0} µm at most in the demo, where nothing is \
                 calibrated",
                1e6 * rigs("nominal_identified_rest_true_m_p95")?,
                demo("rest_error_max_um")?
            ),
        ),
        row(
            "error while moving, without load steps",
            format!(
                "{:.0} µm rms on {:.0} random plants, {:.1} times less than a fixed ratio",
                compared("rms_um")?,
                compared("plants")?,
                compared("fixed_ratio_times")?
            ),
        ),
        row(
            "error of the load estimate",
            format!(
                "{:.1} % in 95 of 100 cases after homing on calibrated nominal rigs; {:.1} % at most in the demo",
                100.0 * rigs("nominal_identified_load_after_homing_p95")?,
                demo("load_error_max_percent")?
            ),
        ),
        row("homing without switches", format!("{:.0} s, weighs the load", demo("homing_max_s")?)),
        row(
            "control",
            format!(
                "100 Hz, {:.0} instructions in the longest tick, core {:.1} % busy",
                demo("tick_instructions_max")?,
                demo("core_busy_max_percent")?
            ),
        ),
        row(
            "table on the board",
            format!(
                "{:.0} bytes; {:.0} instructions give the gap to {:.1} µm and the ratio to {:.2} %",
                chosen("bytes")?,
                value(records, "cost", "lookup_instructions")?,
                chosen("contraction_error_um")?,
                chosen("tr_error_percent")?
            ),
        ),
        row(
            "full model on a desktop",
            format!(
                "{:.1} µs an equilibrium; SciPy's `solve_bvp` takes {:.0} times as long for one rod",
                model("us_per_equilibrium")?,
                model("solve_bvp_times")?
            ),
        ),
        row(
            "endurance",
            format!(
                "{:.0} moves on ten nominal rigs with {:.0} faults, power failures and other incidents: {:.0} faults without a \
                 cause, {:.0} moves away from their target unannounced, {:.0} resets",
                long("moves")?,
                long("incidents")?,
                long("faults_without_cause")?,
                long("unannounced")?,
                long("resets")?
            ),
        ),
        row("image", format!("{:.0} KiB of flash, {:.0} KiB of static RAM", image("flash_kib")?, image("ram_kib")?)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_readme_without_the_marks_is_named() {
        let error = replaced("# Title\n", &Records::new()).unwrap_err().to_string();
        assert!(error.contains("README.md has no line"), "{error}");
    }

    #[test]
    fn a_section_that_was_not_measured_is_named_with_its_command() {
        let text = format!("x\n{BEGIN}{END}");
        let error = replaced(&text, &Records::new()).unwrap_err().to_string();
        assert!(error.contains("cargo xtask results"), "{error}");
    }
}
