//! Measures the effect of a cheaper model, or of a less accurate table, on the closed loop: each table is built into
//! the firmware, which then homes and moves on the emulated board under two loads.

use crate::process::{foreign, shown};
use crate::toolchain::{Choice, choose};
use crate::{Folders, firmware, host, system};
use anyhow::{Context, Result};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Stdio;

/// Name, tier, and accuracy of the table's fit to that tier: contraction (m) and TR.
const VARIANTS: [(&str, &str, [f64; 2]); 10] = [
    ("rigid", "rigid", [5e-6, 2e-3]),
    ("beam-column", "beam-column", [5e-6, 2e-3]),
    ("pseudo-rigid", "pseudo-rigid", [5e-6, 2e-3]),
    ("elastica", "elastica", [5e-6, 2e-3]),
    ("inextensible", "inextensible", [5e-6, 2e-3]),
    ("full", "full", [5e-6, 2e-3]),
    ("full, 24 um", "full", [24e-6, 5e-3]),
    ("full, 100 um", "full", [100e-6, 2e-2]),
    ("full, 1 mm", "full", [1e-3, 0.2]),
    ("full, 2 um", "full", [2e-6, 1e-3]),
];
const LOADS: [&str; 2] = ["0.5kg", "1.5kg"];
const SCRIPT: &str = "2.5 home\n47 move 12mm speed=2mm/s\n55.5 move 2mm speed=2mm/s\n63 move 9mm speed=2mm/s\n69 end\n";

/// Result of one run; `None` where nothing was moved or estimated.
#[derive(Default)]
struct Outcome {
    rms_m: Option<f64>,
    max_m: Option<f64>,
    rest_m: Option<f64>,
    load_error: Option<f64>,
    tick_mean: f64,
    tick_max: f64,
    fault: Option<String>,
}

/// Runs all variants under all loads, prints a line for each and writes `out/loop.csv`.
pub fn run(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    host::build(folders)?;
    let toolchain = choose(Choice::Auto)?;
    let folder = folders.target.join("loop");
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let script = folder.join("loop.script");
    std::fs::write(&script, SCRIPT).with_context(|| format!("{}", script.display()))?;
    let mut csv =
        String::from("variant,load,rms_m,max_m,rest_m,load_relative_error,instructions_mean,instructions_max,fault\n");
    for (name, tier, [contraction_m, tr_relative]) in VARIANTS {
        let image = folder.join(format!("{}.elf", name.replace([',', ' '], "-")));
        firmware::build_study(folders, &toolchain, &format!("{tier} {contraction_m:e} {tr_relative:e}"), &image)?;
        for load in LOADS {
            let o = play(folders, &image, &script, load)?;
            let shown = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.1}"));
            println!(
                "{name:<14} {load}: tracking {} um rms, {} um at most; at rest {} um; load {} %; {:.0} instructions a tick, \
                 {:.0} at most{}",
                shown(o.rms_m.map(|m| m * 1e6)),
                shown(o.max_m.map(|m| m * 1e6)),
                shown(o.rest_m.map(|m| m * 1e6)),
                shown(o.load_error.map(|error| error * 1e2)),
                o.tick_mean,
                o.tick_max,
                o.fault.as_ref().map_or(String::new(), |f| format!("; {f}"))
            );
            let cell = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.3e}"));
            writeln!(
                csv,
                "\"{name}\",{load},{},{},{},{},{:.0},{:.0},{}",
                cell(o.rms_m),
                cell(o.max_m),
                cell(o.rest_m),
                cell(o.load_error),
                o.tick_mean,
                o.tick_max,
                o.fault.unwrap_or_default()
            )?;
        }
    }
    let out = folders.root.join("out");
    std::fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
    std::fs::write(out.join("loop.csv"), csv).context("out/loop.csv")?;
    println!("\n{}", out.join("loop.csv").display());
    // `rigctl` boots the firmware with the scene's own table again.
    firmware::build(folders, &toolchain)
}

fn play(folders: &Folders, image: &Path, script: &Path, load: &str) -> Result<Outcome> {
    let mut command = foreign(&folders.target.join("release/rigctl").to_string_lossy(), &folders.root);
    // What a table does is told best by a rig that has nothing else.
    command.args(["--json", "--rig", "ideal", "--firmware"]).arg(image);
    command.args(["--plant", &format!("load={load}"), "sim", "--script"]).arg(script);
    let output = command.stderr(Stdio::inherit()).output().with_context(|| shown(&command))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let mut o = Outcome::default();
    let (mut squares, mut count) = (0.0, 0u32);
    for line in text.lines() {
        let value: Value = serde_json::from_str(line).with_context(|| format!("rigctl printed no JSON: {line}"))?;
        let number = |key: &str| value[key].as_f64();
        if let Some(summary) = value.get("summary") {
            o.tick_mean = summary["instructions_per_tick_mean"].as_f64().unwrap_or_default();
            o.tick_max = summary["instructions_per_tick_max"].as_f64().unwrap_or_default();
            continue;
        }
        if let Some(fault) = value["fault"].as_str() {
            o.fault.get_or_insert(fault.to_owned());
        }
        let state = value["state"].as_str().unwrap_or_default();
        if let (Some(set), Some(position)) = (number("setpoint_m"), number("true_position_m")) {
            let error = position - set;
            if state == "moving" {
                squares += error * error;
                count += 1;
                o.max_m = Some(o.max_m.unwrap_or(0.0).max(error.abs()));
            }
            o.rest_m = Some(error);
        }
        if let (Some(estimate), Some(truth)) = (number("load_n"), number("true_load_n")) {
            o.load_error = Some(estimate / truth - 1.0);
        }
        if state == "unhomed" && number("t_s") > Some(46.0) {
            o.fault.get_or_insert("homing refused".into());
        }
    }
    o.rms_m = (count > 0).then(|| (squares / f64::from(count)).sqrt());
    Ok(o)
}
