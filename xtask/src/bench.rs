//! Measures the model beside an independent solver. Both run in turns, so that they meet the same machine and load.
//!
//! There are three measures: instructions, the ratio to scipy, and time. Other load on the machine does not disturb the
//! first and disturbs the last most. The first two need Python and valgrind; without them a line says so and their rows
//! stay empty. The wanted values are shown but not enforced, because a busy machine is not a fault of the model. A
//! difference between the two solvers is an error.

use crate::process::{cargo, exists, foreign, output_of, run, shown};
use crate::{Folders, system};
use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The default scene and the scene that is hardest for solvers.
const SCENES: [&str; 2] = ["scenes/default.toml", "scenes/niti-plateau.toml"];

/// Largest difference between the tip displacements of scipy and of the model (m).
const AGREEMENT_M: f64 = 1e-8;

/// Passes of the two runs of which the difference is taken, so that the instructions of the start cancel.
const PASSES: [u64; 2] = [1, 6];

/// Number of turns of the two solvers. A disturbance of some seconds then meets both.
const ROUNDS: usize = 5;

/// Measures everything, prints the table and writes `bench/model.json` under the target folder.
pub fn bench(folders: &Folders) -> Result<()> {
    let folder = folders.target.join("bench");
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    run(cargo(folders).args(["build", "--release", "--package", "lab"]))?;
    let binary = folders.target.join("release/tsa-lab");

    let interpreter = if_available(python(folders, &folder));
    let valgrind = if_available(system::ensure(&[(exists("valgrind"), "valgrind")], "count instructions", BY_HAND));

    let mut rounds = (0..ROUNDS)
        .map(|_| round(folders, &binary, interpreter.as_deref(), &folder.join("states.json")))
        .collect::<Result<Vec<_>>>()?;
    let ratio = |round: &Value| number(round, "/ratio/solve_bvp").unwrap_or_default();
    rounds.sort_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    if let Some(interpreter) = &interpreter {
        sweep(folders, &binary, interpreter, &folder.join("states.json"))?;
    }
    let times = read(Command::new(&binary).current_dir(&folders.root).args(["bench", "time"]).args(SCENES))?;
    let counted = valgrind
        .map(|()| SCENES.iter().map(|scene| instructions(folders, &binary, scene)).collect::<Result<Vec<_>>>())
        .transpose()?;
    let found = json!({ "model": times, "instructions_per_equilibrium": counted, "rounds_by_ratio": &rounds });
    print_table(&found, &rounds)?;
    let file = folder.join("model.json");
    write(&file, &found)?;
    println!("\n{}", file.display());
    match difference(&rounds)? {
        Some(m) if m > AGREEMENT_M => bail!("scipy differs by {m:.1e} m from the model, more than {AGREEMENT_M:.0e} m"),
        _ => Ok(()),
    }
}

/// Instruction for systems other than Debian.
const BY_HAND: &str = "Install valgrind and Python 3.11 or newer with venv by your system's package manager.";

/// The value; if there is none, the reason is printed.
fn if_available<T>(found: Result<T>) -> Option<T> {
    found.inspect_err(|error| eprintln!("left out: {error:#}")).ok()
}

/// Installs Python with scipy in a virtual environment and returns its interpreter.
fn python(folders: &Folders, folder: &Path) -> Result<PathBuf> {
    let has_venv = output_of(foreign("python3", Path::new("/")).args(["-c", "import ensurepip, venv"])).is_some();
    system::ensure(&[(has_venv, "python3-venv")], "run scipy beside the model", BY_HAND)?;
    let environment = folder.join("python");
    let interpreter = environment.join("bin/python");
    let pip = || {
        let mut command = foreign(&interpreter.to_string_lossy(), &folders.root);
        command.args(["-m", "pip"]);
        command
    };
    // An incomplete environment has no pip.
    if output_of(pip().arg("--version")).is_none() {
        run(foreign("python3", &folders.root).args(["-m", "venv", "--clear"]).arg(&environment))?;
    }
    run(pip()
        .args(["install", "--quiet", "--disable-pip-version-check", "--requirement"])
        .arg("host-tests/peers/requirements.txt"))
    .context("pip could not install numpy and scipy, which the benchmark needs")?;
    Ok(interpreter)
}

/// One turn of both solvers on the same rods: times (µs) of the model, times and differences of scipy, and their
/// ratios.
fn round(folders: &Folders, binary: &Path, interpreter: Option<&Path>, states_file: &Path) -> Result<Value> {
    let states = read(Command::new(binary).current_dir(&folders.root).args(["bench", "states", SCENES[0]]))?;
    write(states_file, &states)?;
    let us = number(&states, "/us_per_equilibrium")?;
    let peer = interpreter.map(|interpreter| scipy(folders, interpreter, states_file)).transpose()?;
    let ratio = |solver: &str| -> Result<Option<f64>> {
        peer.as_ref().map(|p| Ok(number(p, &format!("/{solver}/ms_per_rod"))? * 1e3 / us)).transpose()
    };
    Ok(json!({
        "us_per_equilibrium": us,
        "us_per_rod": number(&states, "/us_per_rod")?,
        "ratio": { "solve_bvp": ratio("solve_bvp")?, "shooting": ratio("shooting")? },
        "peer": peer,
    }))
}

/// Times and differences of scipy.
fn scipy(folders: &Folders, interpreter: &Path, states: &Path) -> Result<Value> {
    let mut command = foreign(&interpreter.to_string_lossy(), &folders.root);
    // The model uses one thread too.
    command.env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1");
    read(command.arg("host-tests/peers/solve_bvp.py").arg(states))
}

/// Writes the error and time of scipy over its tolerance for `tsa-lab chart`, measured in turns with the model.
fn sweep(folders: &Folders, binary: &Path, interpreter: &Path, states_file: &Path) -> Result<()> {
    let states = read(Command::new(binary).current_dir(&folders.root).args(["bench", "states", SCENES[0]]))?;
    write(states_file, &states)?;
    let mut command = foreign(&interpreter.to_string_lossy(), &folders.root);
    command.env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1");
    let points = read(command.args(["host-tests/peers/solve_bvp.py", "--repeats", "3", "--sweep"]).arg(states_file))?;
    let mut csv = String::from("solver,tolerance,error_m,us,failed\n");
    for (name, at) in [("first-integral, rod", "/us_per_rod"), ("first-integral, equilibrium", "/us_per_equilibrium")] {
        csv += &format!("\"{name}\",,,{:.3},0\n", number(&states, at)?);
    }
    for point in points.as_array().context("the sweep of scipy is not a list")? {
        let us = point["us"].as_f64().map_or(String::new(), |us| format!("{us:.3}"));
        let solver = point["solver"].as_str().unwrap_or_default();
        csv += &format!("{solver},{},{},{us},{}\n", point["tolerance"], point["error_m"], point["failed"]);
    }
    let out = folders.root.join("out");
    std::fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
    let file = out.join("peers.csv");
    std::fs::write(&file, csv).with_context(|| format!("cannot write {}", file.display()))
}

/// Instructions per equilibrium, as callgrind counts them.
fn instructions(folders: &Folders, binary: &Path, scene: &str) -> Result<f64> {
    // The number of instructions, and of the states that they solved.
    let run = |passes: u64| -> Result<(u64, u64)> {
        let mut command = foreign("valgrind", &folders.root);
        command.args(["--tool=callgrind", "--cache-sim=no", "--callgrind-out-file=/dev/null"]).arg(binary);
        command.args(["bench", "kernel", scene, &passes.to_string()]);
        eprintln!("> {}", shown(&command));
        let output = command.output().context("could not start valgrind")?;
        let messages = String::from_utf8_lossy(&output.stderr);
        if !output.status.success() {
            bail!("failed ({}): {}\n{messages}", output.status, shown(&command));
        }
        let instructions =
            collected(&messages).with_context(|| format!("no count in the output of valgrind:\n{messages}"))?;
        let states =
            String::from_utf8_lossy(&output.stdout).trim().parse().context("`tsa-lab bench` printed no count")?;
        Ok((instructions, states))
    };
    let [(few, few_states), (many, many_states)] = [run(PASSES[0])?, run(PASSES[1])?];
    Ok((many - few) as f64 / (many_states - few_states) as f64)
}

/// `==1== Collected : 3561649` -> 3561649
fn collected(messages: &str) -> Option<u64> {
    messages.lines().find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok())
}

/// Runs a command and parses its output as JSON.
fn read(command: &mut Command) -> Result<Value> {
    eprintln!("> {}", shown(command));
    let output = command.output().with_context(|| format!("could not start: {}", shown(command)))?;
    if !output.status.success() {
        bail!("failed ({}): {}\n{}", output.status, shown(command), String::from_utf8_lossy(&output.stderr));
    }
    serde_json::from_slice(&output.stdout).with_context(|| format!("no JSON from: {}", shown(command)))
}

fn write(file: &Path, value: &Value) -> Result<()> {
    let text = serde_json::to_string_pretty(value)? + "\n";
    std::fs::write(file, text).with_context(|| format!("cannot write {}", file.display()))
}

/// A number in a JSON value.
fn number(value: &Value, at: &str) -> Result<f64> {
    value.pointer(at).and_then(Value::as_f64).with_context(|| format!("{at} is not a number"))
}

/// Largest difference of u and w in any round (m); `None` without scipy.
fn difference(rounds: &[Value]) -> Result<Option<f64>> {
    let mut worst = None;
    for peer in rounds.iter().map(|round| &round["peer"]).filter(|peer| !peer.is_null()) {
        for at in ["/solve_bvp/max_du_m", "/solve_bvp/max_dw_m", "/shooting/max_du_m", "/shooting/max_dw_m"] {
            worst = Some(number(peer, at)?.max(worst.unwrap_or(0.0)));
        }
    }
    Ok(worst)
}

/// Prints a line of the table: the value with `digits` after the point, and the wanted value.
fn line(what: &str, value: Option<f64>, digits: usize, wanted: &str) {
    let value = value.map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}"));
    println!("{what:<48} {value:>12}  {wanted}");
}

fn print_table(found: &Value, rounds: &[Value]) -> Result<()> {
    let optional = |at: &str| found.pointer(at).and_then(Value::as_f64);
    let states = number(found, "/model/scenes/0/states")?;
    println!("{:<48} {:>12}  wanted", "one thread, medians", "");
    line("default: µs per equilibrium", optional("/model/scenes/0/us"), 2, "at most 10");
    line(&format!("default: s per grid of {states}"), optional("/model/scenes/0/seconds"), 4, "at most 0.2");
    line("default: instructions per equilibrium", optional("/instructions_per_equilibrium/0"), 0, "");
    line("niti-plateau: µs per equilibrium", optional("/model/scenes/1/us"), 2, "");
    line("niti-plateau: instructions per equilibrium", optional("/instructions_per_equilibrium/1"), 0, "");
    // The round with the median ratio.
    let middle = |at: &str| rounds[rounds.len() / 2].pointer(at).and_then(Value::as_f64);
    line("scipy's states: µs per equilibrium", middle("/us_per_equilibrium"), 2, "");
    line("scipy's states: µs per rod alone", middle("/us_per_rod"), 2, "");
    line("scipy solve_bvp: ms per rod", middle("/peer/solve_bvp/ms_per_rod"), 2, "");
    line("scipy DOP853 shooting: ms per rod", middle("/peer/shooting/ms_per_rod"), 2, "");
    line("solve_bvp's rod in equilibria of the model", middle("/ratio/solve_bvp"), 0, "at least 1000");
    let ratio = |round: &Value| number(round, "/ratio/solve_bvp").ok();
    line("  least of the rounds", rounds.first().and_then(ratio), 0, "");
    line("  most of the rounds", rounds.last().and_then(ratio), 0, "");
    line("DOP853's rod in equilibria of the model", middle("/ratio/shooting"), 0, "");
    line("largest difference of u and w: pm", difference(rounds)?.map(|m| m * 1e12), 3, "at most 10000");

    Ok(())
}

#[cfg(test)]
mod tests {
    use super::collected;

    #[test]
    fn the_total_is_found_in_the_output_of_valgrind() {
        let messages = "==7== Events    : Ir\n==7== Collected : 3561649\n==7== \n==7== I   refs:      3,561,649\n";
        assert_eq!(collected(messages), Some(3_561_649));
        assert_eq!(collected("==7== Collected : \n"), None);
    }
}
