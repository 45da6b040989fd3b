//! How streamed sines are followed, over the frequency: one JSON object a line, and a figure.

use anyhow::Result;
use clap::Parser;
use host_tests::following::{AMPLITUDES_M, LOADS_KG, PERIOD_TICKS, Response, Series, figure, frequency_hz};
use rig_plant::RigPreset;
use rigctl::parallel::parallel;
use serde_json::json;
use std::path::PathBuf;

const KINDS: [RigPreset; 2] = [RigPreset::Ideal, RigPreset::Nominal];

#[derive(Parser)]
#[command(about, version)]
struct Arguments {
    /// Seed of the rigs
    #[arg(long, default_value_t = 1001)]
    seed: u64,
    /// The figure
    #[arg(long, value_name = "FILE.svg")]
    figure: Option<PathBuf>,
}

fn main() -> Result<()> {
    let a = Arguments::parse();
    let of = |rig, load_kg| AMPLITUDES_M.map(|amplitude_m| Series { rig: (rig, a.seed), load_kg, amplitude_m });
    let all: Vec<Series> = KINDS.iter().flat_map(|rig| LOADS_KG.into_iter().flat_map(move |kg| of(*rig, kg))).collect();
    let answers = parallel(&|_, _| {}, all.len(), |k| all[k].play());
    let played: Vec<_> = all.into_iter().zip(answers).collect();
    for (series, answers) in &played {
        let one = |(period, answer): (&usize, &Result<_, String>)| match answer {
            Ok(Response { ratio, phase_rad }) => {
                json!({"frequency_hz": frequency_hz(*period), "ratio": ratio, "phase_deg": phase_rad.to_degrees()})
            }
            Err(why) => json!({"frequency_hz": frequency_hz(*period), "ended": why}),
        };
        let answers: Vec<_> = PERIOD_TICKS.iter().zip(answers).map(one).collect();
        let rig = series.rig.0.to_string();
        let of = json!({"rig": rig, "load_kg": series.load_kg, "amplitude_m": series.amplitude_m, "answers": answers});
        println!("{of}");
    }
    if let Some(file) = a.figure {
        std::fs::write(&file, figure(&KINDS, &played).svg().map_err(anyhow::Error::msg)?)?;
    }
    Ok(())
}
