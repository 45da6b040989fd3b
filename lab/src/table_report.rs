//! `tsa-lab table`: a table's certificate and why this table was chosen, for machines and people.

use crate::page::filled;
use anyhow::Result;
use rig_config::{Accuracy, Scene, TableError};
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::write_file;
use rigctl::output::{Output, decimal};
use rigctl::scene_file;
use rigctl::units::{N, NM, PERCENT, TURNS_OF_RAD, UM};
use serde_json::{Value, json};
use std::path::PathBuf;
use table_forms::LoadMap;
use table_forms::considered::{Considered, considered};
use tsa_model::Tier;
use tsa_table::FORM;
use tsa_table::fit::{Errors, Fit, MAX_BYTES};
use tsa_table::instruction_model::{LOOKUP_INSTRUCTIONS, lookup_instructions};

/// The certificate for people, a sentence a line.
const CERTIFICATE: &str = include_str!("certificate.txt");

/// `tsa-lab table`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Also write table.json and table.rs into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If the scene allows no table, or the folder cannot be written.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let scene = global.scene()?;
        // The fit says where an envelope first reaches past the model, the check of the rig only that it does.
        let fit = scene.fit_table()?;
        scene_file::check_rig(&global.scene, &scene)?;
        let report = TableReport::new(&scene, &fit)?;
        output.object(&report.json())?;
        report.sentences().iter().try_for_each(|line| output.line(line))?;
        for [form, size, map, bytes, instructions, error, tr, passes] in report.considered() {
            output.line(format!(
                "{form:<17} {size:<29} {map:<16} {bytes:>6} {instructions:>12} {error:>10} {tr:>9}  {passes}"
            ))?;
        }
        if let Some(folder) = &self.out {
            write_file(folder, "table.json", &(serde_json::to_string_pretty(&report.json())? + "\n"))?;
            write_file(folder, "table.rs", &tsa_table::emit::rust_source(&fit))?;
            output.line(format!("written: table.json, table.rs in {}", folder.display()))?;
        }
        Ok(())
    }
}

/// The chosen table and how it was chosen.
pub struct TableReport<'a> {
    fit: &'a Fit,
    accuracy: Accuracy,
    /// Every table that was considered, in the order of preference.
    candidates: Vec<Considered>,
    why: String,
}

/// A map of the load for people.
fn map_name(map: Option<LoadMap>) -> String {
    match map {
        Some(LoadMap::Ratio { knee_n }) => format!("F/(F + {})", N.exact(knee_n)),
        Some(LoadMap::Log) => "ln F".into(),
        Some(LoadMap::InverseRoot) => "F^(-1/2)".into(),
        None => "F".into(),
    }
}

fn errors(e: &Errors) -> Value {
    json!({
        "contraction_max_m": e.contraction_max_m,
        "contraction_rms_m": e.contraction_rms_m,
        "tr_max_relative": e.tr_max,
        "tr_rms_relative": e.tr_rms,
    })
}

impl<'a> TableReport<'a> {
    /// Of a scene and its table. It fits the other forms too, which the board does not use.
    ///
    /// # Errors
    /// If the scene has no demand on a table, or the envelope breaks the model.
    pub fn new(scene: &Scene, fit: &'a Fit) -> Result<Self, TableError> {
        let table_spec = scene.table_spec()?;
        let candidates = considered(&scene.mechanism()?, &table_spec, fit)?;
        let passing = candidates.iter().filter(|c| c.passes).count();
        let fast = candidates.iter().filter(|c| c.passes && c.instructions <= LOOKUP_INSTRUCTIONS).count();
        let why = format!(
            "smallest of the {fast} candidates that the board looks up within {LOOKUP_INSTRUCTIONS} instructions \
             (of {passing} that meet the accuracy within {MAX_BYTES} bytes, of {} tried), and its certificate holds; \
             were there none so fast, the smallest. All are fitted to the full tier: it is solved before the \
             firmware is built, so a cheaper one would save the board nothing",
            candidates.len()
        );
        Ok(Self { fit, accuracy: table_spec.accuracy, candidates, why })
    }

    /// For machines.
    pub fn json(&self) -> Value {
        let (error_bounds, table) = (&self.fit.error_bounds, &self.fit.table);
        let (m, rounding) = (&table.metadata, &error_bounds.rounding);
        let axis = |parameter, map, [min, max]: [f32; 2], unit| {
            // As f32 they would be printed with digits that they do not have.
            json!({ "parameter": parameter, "map": map, "min": decimal(min), "max": decimal(max), "unit": unit })
        };
        let point = |[load_n, twist_rad]: [f64; 2]| json!({ "load_n": load_n, "twist_rad": twist_rad });
        let tier = Tier::Full.name();
        let candidate = |c: &Considered| {
            json!({
                "tier": tier, "form": c.form, "size": c.size, "load_map": map_name(c.load_map), "bytes": c.bytes,
                "instructions": c.instructions, "errors": errors(&c.errors), "passes": c.passes,
            })
        };
        json!({
            "form": FORM,
            "size": table.numbers.size(),
            "bytes": table.numbers.bytes(),
            "instructions": lookup_instructions(&table.numbers.series()),
            "tier": tier,
            "axes": [
                axis("load_n", "F", [m.load_min_n, m.load_max_n], "N"),
                axis("twist_rad", "linear", [m.twist_min_rad, m.twist_max_rad], "rad"),
            ],
            "errors": errors(&error_bounds.errors),
            "points": error_bounds.points,
            "worst_contraction_at": point(error_bounds.worst_contraction_at),
            "worst_tr_at": point(error_bounds.worst_tr_at),
            "monotone": error_bounds.monotone,
            "closure_m": error_bounds.closure_m,
            "rounding": {
                "arithmetic_m": rounding.arithmetic_m,
                "inputs_m": rounding.inputs_m,
                "tr_arithmetic_relative": rounding.tr_arithmetic,
            },
            "accuracy": {
                "contraction_m": self.accuracy.contraction_m,
                "tr_relative": self.accuracy.tr_relative,
                "bytes": MAX_BYTES,
            },
            "scene_hash": format!("{:08x}", m.scene_hash),
            "table_crc": format!("{:08x}", table.crc),
            "generator_version": m.generator_version,
            "candidates": self.candidates.iter().map(candidate).collect::<Vec<_>>(),
            "why": self.why,
        })
    }

    /// The certificate as sentences, for somebody who has never seen the table.
    pub fn sentences(&self) -> Vec<String> {
        let (error_bounds, table, m) = (&self.fit.error_bounds, &self.fit.table, &self.fit.table.metadata);
        let turns = |twist_rad: f64| TURNS_OF_RAD.exact(twist_rad - tsa_model::PRETWIST_RAD);
        let at = |[load_n, twist_rad]: [f64; 2]| {
            format!("{} and {}", N.show(load_n), TURNS_OF_RAD.show(twist_rad - tsa_model::PRETWIST_RAD))
        };
        let e = &error_bounds.errors;
        let monotone = if error_bounds.monotone {
            "Everywhere in the table the gap falls with the twist and rises with the load, so that a gap belongs to one twist."
        } else {
            "The gap does not fall with the twist everywhere in the table: do not build firmware with it."
        };
        let parts = [
            ("bytes", table.numbers.bytes().to_string()),
            ("form", FORM.into()),
            ("size", table.numbers.size()),
            ("instructions", lookup_instructions(&table.numbers.series()).to_string()),
            ("loads", N.range([m.load_min_n, m.load_max_n])),
            ("last", turns(m.twist_max_rad.into())),
            ("contraction", UM.error(e.contraction_max_m)),
            ("contraction rms", UM.error(e.contraction_rms_m)),
            ("contraction allowed", UM.exact(self.accuracy.contraction_m)),
            ("contraction at", at(error_bounds.worst_contraction_at)),
            ("tr", PERCENT.error(e.tr_max)),
            ("tr rms", PERCENT.error(e.tr_rms)),
            ("tr allowed", PERCENT.exact(self.accuracy.tr_relative)),
            ("tr at", at(error_bounds.worst_tr_at)),
            ("points", error_bounds.points.to_string()),
            ("arithmetic", NM.error(error_bounds.rounding.arithmetic_m)),
            ("inputs", NM.error(error_bounds.rounding.inputs_m)),
            ("monotone", monotone.into()),
            ("closure", UM.error(error_bounds.closure_m)),
            ("why", self.why.clone()),
            ("hash", format!("{:08x}", m.scene_hash)),
            ("crc", format!("{:08x}", table.crc)),
        ];
        filled(CERTIFICATE, &parts).lines().map(str::to_owned).collect()
    }

    /// Every table that was considered, for people: head and rows.
    pub fn considered(&self) -> impl Iterator<Item = [String; 8]> {
        let head = ["considered", "size", "load map", "bytes", "instructions", "max µm", "TR max %", "passes"];
        let row = |c: &Considered| {
            [
                c.form.into(),
                c.size.clone(),
                map_name(c.load_map),
                c.bytes.to_string(),
                c.instructions.to_string(),
                UM.number(c.errors.contraction_max_m, None::<f64>),
                PERCENT.number(c.errors.tr_max, None::<f64>),
                if c.passes { "yes" } else { "no" }.into(),
            ]
        };
        [head.map(str::to_owned)].into_iter().chain(self.candidates.iter().map(row))
    }
}
