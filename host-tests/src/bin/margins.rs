//! Gain and delay margins of the firmware's loop on emulated rigs, computed and measured: one JSON object a line.

use anyhow::Result;
use clap::Parser;
use host_tests::margins::{LOADS_KG, Margins, POSITIONS_M, Place, most, rigs};
use host_tests::rigs::subject::Subject;
use rigctl::parallel::parallel;
use serde_json::json;

#[derive(Parser)]
#[command(about, version)]
struct Arguments {
    /// First seed of the rigs
    #[arg(long, default_value_t = 1001)]
    seed: u64,
    /// Rigs of each kind that has several
    #[arg(long, default_value_t = 3)]
    rigs: u64,
}

fn main() -> Result<()> {
    let a = Arguments::parse();
    let at = |rig: &(Subject, String)| {
        let place = |load_kg, at_m| Place { rig: rig.clone(), load_kg, at_m };
        LOADS_KG.into_iter().flat_map(|load_kg| POSITIONS_M.map(|at_m| place(load_kg, at_m))).collect::<Vec<_>>()
    };
    let places: Vec<Place> = rigs(a.seed, a.rigs).iter().flat_map(at).collect();
    let margins = parallel(&|_, _| {}, places.len(), |k| places[k].margins());
    for (Place { rig: (subject, kind), load_kg, at_m }, margins) in places.iter().zip(margins) {
        let mut line = json!({"rig": kind, "seed": subject.seed, "load_kg": load_kg, "at_mm": (1e3 * at_m).round()});
        match margins {
            Ok(Margins { gain, delay_s }) => {
                line["gain"] = json!({"computed": gain.0, "measured": gain.1, "most": most().gain});
                line["delay_s"] = json!({"computed": delay_s.0, "measured": delay_s.1, "most": most().delay_s});
            }
            Err(why) => line["failed"] = json!(why),
        }
        println!("{line}");
    }
    Ok(())
}
