//! One study after the other: `study NAME` measures and prints it, `study record NAME …` writes it into docs/results.md.
//!
//! `host-tests/studies.toml` lists the studies of that page. Tools and firmware must be built: `cargo xtask results` sees to it.

use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};
use host_tests::results::{List, Section};
use host_tests::study::{Rigs, Study};
use host_tests::{
    agreement, compare, coverage, endurance, following, limit, loop_gain, margins, oracle, rigs, slow, speed,
};

#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Print the study as JSON, as docs/results.json keeps it
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Measure studies of docs/results.md again, and write it
    Record {
        /// Which (default: all)
        names: Vec<String>,
    },
    /// How fast changed loads are back at their places, and moves at full speed take
    Speed(Rigs),
    /// Changed loads by this controller and by seven others, over the least time of any control
    Limit(Rigs),
    /// Gain and delay that the position loop tolerates
    Margins(Rigs),
    /// The setting loop-gain: margin against speed
    LoopGain(Rigs),
    /// How streamed sines are followed, over the frequency
    Following(Rigs),
    /// Slow motion: how long a load stands, and how uneven its speed is
    Slow(Rigs),
    /// The firmware's control beside the usual ways to drive a twisted string
    Compare(compare::Arguments),
    /// The control code on emulated rigs that are not their own model
    Rigs(rigs::Arguments),
    /// How often the stated errors of load and position hold the truth
    Coverage(Rigs),
    /// How the control code on the fast bench agrees with the firmware on the emulated board
    Agreement(Rigs),
    /// Random scenarios: whether beliefs hold, and faults have causes
    Scenarios(Rigs),
    /// Long runs on the emulated board
    Endurance(endurance::Arguments),
}

fn main() -> Result<()> {
    let Arguments { json, task } = Arguments::parse();
    if let Task::Record { names } = task {
        return record(&names);
    }
    let study = measured(&task)?;
    if json {
        println!("{}", serde_json::to_string(&study)?)
    } else {
        print!("{study}")
    }
    Ok(())
}

fn measured(task: &Task) -> Result<Study> {
    match task {
        Task::Record { .. } => bail!("not a study"),
        Task::Speed(rigs) => speed::study(rigs),
        Task::Limit(rigs) => limit::study(rigs),
        Task::Margins(rigs) => margins::study(rigs),
        Task::LoopGain(rigs) => loop_gain::study(rigs),
        Task::Slow(rigs) => Ok(slow::study(rigs)),
        Task::Following(rigs) => following::study(rigs),
        Task::Compare(arguments) => compare::study(arguments),
        Task::Rigs(arguments) => rigs::measured(arguments),
        Task::Coverage(rigs) => Ok(coverage::study(rigs)),
        Task::Agreement(rigs) => Ok(agreement::study(rigs)),
        Task::Scenarios(rigs) => Ok(oracle::study(rigs)),
        Task::Endurance(arguments) => Ok(endurance::study(arguments)),
    }
}

fn record(names: &[String]) -> Result<()> {
    let list = List::read()?;
    let known: Vec<&str> = list.sections.iter().map(|section| section.name.as_str()).collect();
    if let Some(wrong) = names.iter().find(|name| !known.contains(&name.as_str())) {
        bail!("no section is called {wrong:?}; there are {}", known.join(", "));
    }
    for section in list.sections.iter().filter(|section| names.is_empty() || names.contains(&section.name)) {
        eprintln!("measuring {}: {}", section.name, section.command);
        let study = recorded(section).with_context(|| format!("section {}", section.name))?;
        list.keep(&section.name, study)?;
    }
    println!("docs/results.md, docs/results.json, README.md");
    Ok(())
}

/// A study of the page.
fn recorded(section: &Section) -> Result<Study> {
    let studies = section.study.iter().map(|line| measured(&Arguments::try_parse_from(words(line))?.task));
    let studies = studies.reduce(|one, other| Ok(one?.and(other?))).transpose()?;
    let printed = section.tools.run()?;
    // Of what a study has measured the tools only draw a figure.
    studies.map_or_else(|| section.tools.study(&printed), Ok)
}

fn words(line: &str) -> impl Iterator<Item = &str> {
    std::iter::once("study").chain(line.split_whitespace())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_study_of_the_page_can_be_called() {
        for section in List::read().unwrap().sections {
            for line in section.study {
                assert!(Arguments::try_parse_from(words(&line)).is_ok(), "{line}");
            }
        }
    }
}
