//! The sections of the page, and how each is measured: by the commands that a user would type.

use super::Measured;
use crate::process::{cargo, foreign, shown};
use crate::toolchain::{Choice, choose};
use crate::{Folders, firmware, host, image};
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// One measurement.
pub(super) struct Section {
    /// As on the command line.
    pub name: &'static str,
    pub title: &'static str,
    /// What is measured, in a sentence or two.
    pub about: &'static str,
    /// The command that measures it, for the reader.
    pub command: &'static str,
    /// Pictures below `docs`, with their captions.
    pub figures: &'static [(&'static str, &'static str)],
    pub measure: fn(&Folders) -> Result<Measured>,
}

pub(super) const SECTIONS: &[Section] = &[
    Section {
        name: "demo",
        title: "Three loads homed and moved",
        about: "The firmware does not know the load: it homes, weighs the load and moves it 12 mm at 2 mm/s. The rig is the \
                nominal one of seed 1, on which neither constants nor LVDT are calibrated. The error after ± is the one \
                that the board states, meant to hold the truth in 90 of 100 cases.",
        command: "cargo xtask demo",
        figures: &[("move.svg", "Position, motor speed and transmission ratio of three moves")],
        measure: demo,
    },
    Section {
        name: "image",
        title: "Size of the image",
        about: "What the firmware takes of the board's memory, without the stack.",
        command: "cargo xtask firmware",
        figures: &[],
        measure: image_size,
    },
    Section {
        name: "table",
        title: "The table of the default scene",
        about: "Errors against the full model at random points and at the worst that a search from there finds.",
        command: "target/release/rigctl table",
        figures: &[],
        measure: super::model::chosen_table,
    },
    Section {
        name: "cost",
        title: "What each way of knowing the mechanism costs on the board",
        about: "Instructions on the emulated board, all in one image, over the same 30 states; collocation and the paper's method over three of them.",
        command: "cargo xtask cost",
        figures: &[("charts/target.svg", "Instructions on the board against error, for tables and for solvers")],
        measure: super::model::cost,
    },
    Section {
        name: "bench",
        title: "What the model costs on a desktop",
        about: "One thread; both sides take turns in one run, so that the ratios meet the same machine and load.",
        command: "cargo xtask bench",
        figures: &[],
        measure: super::model::model,
    },
    Section {
        name: "charts",
        title: "Speed, accuracy, stability",
        about: "The cheapest model and table that each scene needs, and where each method fails.",
        command: "target/release/tsa-lab chart --out docs/charts",
        figures: &[
            ("charts/work-precision.svg", "Work against precision of each method"),
            ("charts/stability.svg", "Which equilibrium each method finds, over load and twist of four rods"),
            ("charts/tiers.svg", "The cheapest sufficient model over load and twist"),
            ("charts/table-size.svg", "Bytes against error of every form of table"),
            ("charts/margin.svg", "Stability in time: gain, delay and sampling"),
        ],
        measure: super::model::charts,
    },
    Section {
        name: "report",
        title: "The page with the mechanism",
        about: "Size and times of the page that `tsa-lab report` writes, with the solver inside.",
        command: "cargo xtask results report",
        figures: &[],
        measure: super::report::measure,
    },
    Section {
        name: "budget",
        title: "Tables that are worth having",
        about: "The error budget of each scene on each kind of rig: half widths that hold 90 of 100 cases, without the table's own \
                error; and the cheapest model and the table that raise them by 5 % at most, beside the table of the accuracy in \
                the scene. Computed, not emulated ([Error budget](budget.md)).",
        command: "target/release/tsa-lab budget --all",
        figures: &[],
        measure: super::model::budget,
    },
    Section {
        name: "loop",
        title: "Cheaper models in the closed loop",
        about: "Each table is built into the firmware in turn, which then homes and moves on the emulated board.",
        command: "cargo xtask loop",
        figures: &[("charts/closed-loop.svg", "Errors of load and position by model and accuracy of the table")],
        measure: in_the_loop,
    },
    Section {
        name: "speed",
        title: "As fast as the motor allows",
        about: "How long a load that has changed at rest takes to come back to its place, and moves at full speed take, by the \
                firmware's control code on emulated rigs; over what is physically possible.",
        command: "cargo xtask results speed",
        figures: &[("charts/speed.svg", "Time to come back over the least possible, by load, place and kind of rig")],
        measure: super::speed::measure,
    },
    Section {
        name: "limit",
        title: "Changed loads by other controllers, over the physical limit",
        about: "The same changes of the load at rest by this controller and by seven others on the same rigs: how long the load \
                takes to come back to its place, over the least time of any control with this motor.",
        command: "cargo xtask results limit",
        figures: &[(
            "charts/limit.svg",
            "Time to come back over the least possible, by load, place, controller and kind of rig",
        )],
        measure: super::limit::measure,
    },
    Section {
        name: "margins",
        title: "Gain and delay that the position loop tolerates",
        about: "By how much the gain of the open loop may grow, and what delay beyond the known one it tolerates, by the linear \
                analysis of `tsa-lab chart --only margin` and by the firmware's control code on emulated rigs, whose measured gap is \
                made to change by more, or to come later than its time stamp says.",
        command: "cargo xtask results margins",
        figures: &[],
        measure: super::margins::measure,
    },
    Section {
        name: "following",
        title: "Streamed sines",
        about: "How the load follows set-points of a sine that are streamed to the board, by the firmware's control code on emulated \
                rigs as built.",
        command: "cargo xtask results following",
        figures: &[("charts/following.svg", "Amplitude ratio and phase of streamed sines over the frequency")],
        measure: super::following::measure,
    },
    Section {
        name: "compare",
        title: "Against other ways to drive the mechanism",
        about: "Every controller drives the same emulated rigs through the same frames along the same set-points; \
                only this one homes and weighs for itself. Mean over the loads.",
        command: "cargo xtask compare",
        figures: &[("comparison.svg", "Tracking, settling, overshoot and energy of the controllers")],
        measure: super::comparison::on_random_plants,
    },
    Section {
        name: "compare-rigs",
        title: "The same on rigs that are not their own model",
        about: "The same moves by all controllers on nominal and on hard rigs of seeds that nothing was tuned on. Each rig is \
                calibrated and identified first, and every controller has the calibration and the table.",
        command: "cargo xtask compare --rig nominal --plants 3",
        figures: &[
            ("comparison-nominal.svg", "Tracking, settling, overshoot and energy of the controllers on nominal rigs"),
            ("comparison-hard.svg", "Tracking, settling, overshoot and energy of the controllers on hard rigs"),
        ],
        measure: super::comparison::on_rigs,
    },
    Section {
        name: "rigs",
        title: "Rigs that are not their own model",
        about: "20 well-made rigs and 20 of the worst in ten (5 of each also as built, 2 of each also against a fixed \
                ratio), each drawn from a seed on which nothing was tuned, homed and moved under four loads by the \
                firmware's control code, with the constants identified on the same rig first and with the default \
                scene's table as built.",
        command: "cargo xtask results rigs",
        figures: &[
            ("charts/rigs.svg", "Errors of load and position, each effect alone and all together"),
            ("charts/effects.svg", "Where the chain breaks as one effect is turned up"),
        ],
        measure: super::rigs::measure,
    },
    Section {
        name: "calibration",
        title: "A new rig, calibrated",
        about: "Three emulated rigs that the scene does not know, before and after the six commands of \
                [calibration](calibration.md): eleven points of the LVDT, three sweeps, the constants, the table. Then a \
                move of 12 mm under two loads that the board weighs itself; errors after ± hold the truth in 90 of 100 cases. \
                The outside rig's mechanism is the program [leaf_springs.py](plants/leaf_springs.py), which obeys no law of \
                the tools.",
        command: "cargo xtask results calibration",
        figures: &[
            ("charts/calibration-nominal.svg", "A nominal rig: contraction before and after, with measured points"),
            ("charts/calibration-hard.svg", "A hard rig: contraction before and after, with measured points"),
            ("charts/calibration-outside.svg", "An outside plant: contraction before and after, with measured points"),
        ],
        measure: super::calibration::measure,
    },
    Section {
        name: "endurance",
        title: "Endurance",
        about: "Moves under changing loads on ten nominal rigs as built, with an incident at every third: faults, power failures, \
                restarts of the drive, steps of the load, streams, tables made anew. Halfway each rig is calibrated, swept under \
                three loads and identified, and goes on with the table that the board makes of it, where it can. Random bytes \
                on the host link and on the bus. More than an hour on two cores.",
        command: "cargo xtask endurance --moves 500 --rigs 10 --seed 1001 --bytes 7000000",
        figures: &[],
        measure: endurance,
    },
];

pub(super) fn text(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// What a command prints on its standard output.
pub(super) fn printed(command: &mut Command) -> Result<String> {
    eprintln!("> {}", shown(command));
    let output = command.stderr(Stdio::inherit()).output().with_context(|| shown(command))?;
    ensure!(output.status.success(), "failed ({}): {}", output.status, shown(command));
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Each line of a text as JSON.
pub(super) fn json_lines(text: &str) -> Result<Vec<Value>> {
    text.lines().map(|line| serde_json::from_str(line).with_context(|| format!("no JSON: {line}"))).collect()
}

/// The tool with these words, and each line that it prints as JSON.
pub(super) fn rigctl(folders: &Folders, words: &[&str]) -> Result<Vec<Value>> {
    let mut command = foreign(&folders.target.join("release/rigctl").to_string_lossy(), &folders.root);
    let text = printed(command.arg("--json").args(words))?;
    json_lines(&text)
}

/// What a program of the host tests prints, each line as JSON; it draws the figure with its own name.
pub(super) fn drawn(folders: &Folders, program: &str) -> Result<Vec<Value>> {
    let mut command = cargo(folders);
    command.args(["run", "--release", "--package", "host-tests", "--bin", program, "--", "--figure"]);
    command.arg(folders.root.join(format!("docs/charts/{program}.svg")));
    let text = printed(&mut command)?;
    json_lines(&text)
}

pub(super) fn number(value: &Value, at: &str) -> Result<f64> {
    value.pointer(at).and_then(Value::as_f64).with_context(|| format!("{at}: no number"))
}

/// Head and rows of a CSV file.
pub(super) fn csv(file: &Path) -> Result<Vec<Vec<String>>> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .comment(Some(b'#'))
        .from_path(file)
        .with_context(|| format!("{}", file.display()))?;
    reader.records().map(|row| Ok(row?.iter().map(str::to_owned).collect())).collect()
}

/// A cell of a CSV file's row by the name of its column; `None` where it is empty or no number.
pub(super) fn cell(head: &[String], row: &[String], column: &str) -> Option<f64> {
    row.get(head.iter().position(|name| name == column)?)?.parse().ok()
}

pub(super) fn copy(folders: &Folders, from: &str, to: &str) -> Result<()> {
    let [from, to] = [from, to].map(|file| folders.root.join(file));
    std::fs::copy(&from, &to).map(drop).with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))
}

fn demo(folders: &Folders) -> Result<Measured> {
    host::build(folders)?;
    firmware::build(folders, &choose(Choice::Auto)?)?;
    let runs = rigctl(folders, &["demo", "--out", "out"])?;
    copy(folders, "out/demo.svg", "docs/move.svg")?;
    let mut measured = Measured::default();
    measured.table.push(text(&[
        "load",
        "estimate",
        "TR, start to end",
        "motor turns",
        "homing",
        "error at rest (true)",
        "instructions a tick, mean (most)",
        "core busy",
        "times real time",
    ]));
    for run in &runs {
        let estimate = 100.0 * (number(run, "/move/load_n")? / number(run, "/load_true_n")? - 1.0);
        measured.table.push(vec![
            format!("{} kg", number(run, "/load_kg")?),
            format!(
                "{estimate:+.1} % ± {:.1} %",
                100.0 * number(run, "/move/load_error_n")? / number(run, "/load_true_n")?
            ),
            format!(
                "{:.2} to {:.2} rad/mm",
                1e-3 * number(run, "/move/tr_start_rad_per_m")?,
                1e-3 * number(run, "/move/tr_end_rad_per_m")?
            ),
            format!("{:.0}", number(run, "/motor_turns")?),
            format!("{:.1} s", number(run, "/home/duration_s")?),
            format!(
                "{:+.1} µm ± {:.0} µm",
                1e6 * number(run, "/true_error_at_rest_m")?,
                1e6 * number(run, "/move/position_error_m")?
            ),
            format!(
                "{:.0} ({:.0})",
                number(run, "/instructions_per_tick_mean")?,
                number(run, "/instructions_per_tick_max")?
            ),
            format!("{:.2} %", 100.0 * number(run, "/core_busy")?),
            format!("{:.1}", number(run, "/realtime_factor")?),
        ]);
        let mut most = |name: &str, value: f64| {
            let slot = measured.values.entry(name.to_owned()).or_insert(0.0);
            *slot = slot.max(value.abs());
        };
        most("load_error_max_percent", estimate);
        most("rest_error_max_um", 1e6 * number(run, "/true_error_at_rest_m")?);
        most("homing_max_s", number(run, "/home/duration_s")?);
        most("tick_instructions_max", number(run, "/instructions_per_tick_max")?);
        most("core_busy_max_percent", 100.0 * number(run, "/core_busy")?);
    }
    for (name, run) in [("light", runs.first()), ("heavy", runs.last())] {
        let run = run.context("the demo printed nothing")?;
        for end in ["start", "end"] {
            let ratio = 1e-3 * number(run, &format!("/move/tr_{end}_rad_per_m"))?;
            measured.values.insert(format!("tr_{end}_{name}_rad_per_mm"), ratio);
        }
    }
    Ok(measured)
}

fn image_size(folders: &Folders) -> Result<Measured> {
    let toolchain = choose(Choice::Auto)?;
    let mut measured = Measured { table: vec![text(&["image", "flash", "static RAM"])], ..Measured::default() };
    let mut add = |name: &str, file: &Path| -> Result<()> {
        let image::Size { flash, ram } = image::size(file)?;
        let [flash, ram] = [flash, ram].map(|bytes| bytes as f64 / 1024.0);
        measured.table.push(vec![name.to_owned(), format!("{flash:.1} KiB"), format!("{ram:.1} KiB")]);
        measured.values.entry("flash_kib".into()).or_insert(flash);
        measured.values.entry("ram_kib".into()).or_insert(ram);
        Ok(())
    };
    firmware::build(folders, &toolchain)?;
    add("drive on CAN (default)", &folders.target.join("firmware/tsa-firmware.elf"))?;
    firmware::build_variant(folders, &toolchain, firmware::Variant::Uart)?;
    add("drive on the serial line", &folders.target.join("firmware/uart/tsa-firmware.elf"))?;
    Ok(measured)
}

/// Three significant digits, without an exponent.
pub(super) fn significant(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { (2 - value.abs().log10().floor() as i32).max(0) };
    format!("{value:.*}", digits.min(12) as usize)
}

fn in_the_loop(folders: &Folders) -> Result<Measured> {
    host::closed_loop(folders)?;
    rigctl(folders, &["chart", "--only", "closed-loop", "--out", "docs/charts"])?;
    let rows = csv(&folders.root.join("out/loop.csv"))?;
    let (head, rows) = rows.split_first().context("out/loop.csv is empty")?;
    let mut measured = Measured {
        table: vec![text(&["table of", "load", "rms error, moving", "largest", "at rest", "load estimate", "fault"])],
        ..Measured::default()
    };
    for row in rows {
        // Empty where nothing was moved.
        let shown = |column: &str, show: fn(f64) -> String| cell(head, row, column).map_or("-".into(), show);
        measured.table.push(vec![
            row[0].clone(),
            row[1].clone(),
            shown("rms_m", |m| format!("{:.1} µm", 1e6 * m)),
            shown("max_m", |m| format!("{:.0} µm", 1e6 * m)),
            shown("rest_m", |m| format!("{:+.1} µm", 1e6 * m)),
            shown("load_relative_error", |error| format!("{:+.1} %", 1e2 * error)),
            row.last().cloned().unwrap_or_default(),
        ]);
    }
    Ok(measured)
}

fn endurance(folders: &Folders) -> Result<Measured> {
    firmware::build(folders, &choose(Choice::Auto)?)?;
    let mut command = cargo(folders);
    command.args(["run", "--release", "--package", "host-tests", "--bin", "endurance", "--"]);
    command.args(["--json", "--moves", "500", "--rigs", "10", "--seed", "1001", "--bytes", "7000000"]);
    let mut measured = Measured { table: vec![text(&["", ""])], ..Measured::default() };
    for found in json_lines(&printed(&mut command)?)? {
        let found = found.as_object().context("no object")?;
        for (name, value) in found {
            let Some(value) = value.as_f64() else { continue };
            measured.values.insert(name.clone(), value);
            measured.table.push(vec![name.replace('_', " "), significant(value)]);
        }
    }
    Ok(measured)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_whatever_the_size() {
        let shown = [0.0, 1.0, 0.012_345, 12_345.0, -3.456_78, 99.96].map(significant);
        assert_eq!(shown, ["0", "1.00", "0.0123", "12345", "-3.46", "100.0"].map(str::to_owned));
    }

    #[test]
    fn a_cell_is_found_by_its_column() {
        let (head, row) = (text(&["a", "b"]), text(&["x", "2.5"]));
        assert_eq!(cell(&head, &row, "b"), Some(2.5));
        assert_eq!(cell(&head, &row, "a"), None, "no number");
        assert_eq!(cell(&head, &row, "c"), None, "no column");
    }
}
