//! A table's certificate and why this table was chosen, for machines and people.

use rig_config::{Scene, TableError};
use rival_forms::LoadMap;
use rival_forms::fit::{Considered, considered};
use serde::Serialize;
use tsa_table::FORM;
use tsa_table::fit::{Errors, Fit, MAX_BYTES};
use tsa_table::instruction_model::{LOOKUP_INSTRUCTIONS, lookup_instructions};

/// The chosen table and how it was chosen.
#[derive(Debug, Serialize)]
pub struct TableReport {
    form: &'static str,
    size: String,
    bytes: usize,
    instructions: u32,
    tier: &'static str,
    axes: [AxisReport; 2],
    errors: ErrorReport,
    points: usize,
    worst_contraction_at: PointReport,
    worst_tr_at: PointReport,
    monotone: bool,
    closure_m: f64,
    rounding: RoundingReport,
    accuracy: AccuracyReport,
    scene_hash: String,
    table_crc: String,
    generator_version: u16,
    candidates: Vec<CandidateReport>,
    why: String,
}

#[derive(Debug, Serialize)]
struct AxisReport {
    parameter: &'static str,
    map: String,
    min: f32,
    max: f32,
    unit: &'static str,
}

#[derive(Debug, Serialize)]
struct ErrorReport {
    contraction_max_m: f64,
    contraction_rms_m: f64,
    tr_max_relative: f64,
    tr_rms_relative: f64,
}

#[derive(Debug, Serialize)]
struct RoundingReport {
    arithmetic_m: f64,
    inputs_m: f64,
    tr_arithmetic_relative: f64,
}

#[derive(Debug, Serialize)]
struct PointReport {
    load_n: f64,
    twist_rad: f64,
}

#[derive(Debug, Serialize)]
struct AccuracyReport {
    contraction_m: f64,
    tr_relative: f64,
    bytes: usize,
}

#[derive(Debug, Serialize)]
struct CandidateReport {
    tier: &'static str,
    form: &'static str,
    size: String,
    load_map: String,
    bytes: usize,
    instructions: u32,
    errors: ErrorReport,
    passes: bool,
}

impl From<Errors> for ErrorReport {
    fn from(e: Errors) -> Self {
        Self {
            contraction_max_m: e.contraction_max_m,
            contraction_rms_m: e.contraction_rms_m,
            tr_max_relative: e.tr_max,
            tr_rms_relative: e.tr_rms,
        }
    }
}

fn map_name(map: Option<LoadMap>) -> String {
    match map {
        Some(LoadMap::Ratio { knee_n }) => format!("F/(F + {knee_n} N)"),
        Some(LoadMap::Log) => "ln F".into(),
        Some(LoadMap::InverseRoot) => "F^(-1/2)".into(),
        None => "F".into(),
    }
}

impl TableReport {
    /// Of a scene and its table. It fits the other forms too, which the board does not use.
    ///
    /// # Errors
    /// If the scene has no demand on a table, or the envelope breaks the model.
    pub fn new(scene: &Scene, fit: &Fit) -> Result<Self, TableError> {
        let (metadata, rounding, demand) = (fit.table.metadata, fit.certificate.rounding, scene.demand()?);
        let all = considered(&scene.mechanism()?, &demand, fit)?;
        let passing = all.iter().filter(|c| c.passes).count();
        let fast = all.iter().filter(|c| c.passes && c.instructions <= LOOKUP_INSTRUCTIONS).count();
        let point = |[load_n, twist_rad]: [f64; 2]| PointReport { load_n, twist_rad };
        Ok(Self {
            form: FORM,
            size: fit.table.numbers.size(),
            bytes: fit.table.numbers.bytes(),
            instructions: lookup_instructions(&fit.table.numbers.series()),
            tier: tsa_model::Tier::Full.name(),
            axes: [
                AxisReport {
                    parameter: "load_n",
                    map: map_name(None),
                    min: metadata.load_min_n,
                    max: metadata.load_max_n,
                    unit: "N",
                },
                AxisReport {
                    parameter: "twist_rad",
                    map: "linear".into(),
                    min: metadata.twist_min_rad,
                    max: metadata.twist_max_rad,
                    unit: "rad",
                },
            ],
            errors: fit.certificate.errors.into(),
            points: fit.certificate.points,
            worst_contraction_at: point(fit.certificate.worst_contraction_at),
            worst_tr_at: point(fit.certificate.worst_tr_at),
            monotone: fit.certificate.monotone,
            closure_m: fit.certificate.closure_m,
            rounding: RoundingReport {
                arithmetic_m: rounding.arithmetic_m,
                inputs_m: rounding.inputs_m,
                tr_arithmetic_relative: rounding.tr_arithmetic,
            },
            accuracy: AccuracyReport {
                contraction_m: demand.accuracy.contraction_m,
                tr_relative: demand.accuracy.tr_relative,
                bytes: MAX_BYTES,
            },
            scene_hash: format!("{:08x}", metadata.scene_hash),
            table_crc: format!("{:08x}", fit.table.crc),
            generator_version: metadata.generator_version,
            why: format!(
                "smallest of the {fast} candidates that the board looks up within {LOOKUP_INSTRUCTIONS} instructions \
                 (of {passing} that meet the accuracy within {MAX_BYTES} bytes, of {} tried), and its certificate holds; \
                 were there none so fast, the smallest. All are fitted to the full tier: it is solved before the \
                 firmware is built, so a cheaper one would save the board nothing",
                all.len()
            ),
            candidates: all.into_iter().map(CandidateReport::new).collect(),
        })
    }

    /// The certificate as sentences, for somebody who has never seen the table.
    pub fn sentences(&self) -> Vec<String> {
        let e = &self.errors;
        let [load, twist] = &self.axes;
        let turns = |twist_rad: f64| (twist_rad - tsa_model::PRETWIST_RAD) / std::f64::consts::TAU;
        let at = |point: &PointReport| format!("{:.2} N and {:.2} turns", point.load_n, turns(point.twist_rad));
        vec![
            format!(
                "The board does not solve the model: it looks gap, contraction and transmission ratio up in a table of {} \
                 bytes, which takes about {} instructions.",
                self.bytes, self.instructions
            ),
            format!(
                "The table covers loads from {} to {} N and twists up to {:.2} turns past the half-turn pre-twist.",
                load.min,
                load.max,
                turns(f64::from(twist.max))
            ),
            format!(
                "The contraction is at most {:.2} µm from that of the full model ({:.2} µm in the root mean square); {:.2} µm \
                 are allowed. The largest error lies at {}.",
                e.contraction_max_m * 1e6,
                e.contraction_rms_m * 1e6,
                self.accuracy.contraction_m * 1e6,
                at(&self.worst_contraction_at)
            ),
            format!(
                "The transmission ratio is at most {:.3} % from that of the full model ({:.3} % in the root mean square); {:.3} \
                 % are allowed. The largest error lies at {}.",
                e.tr_max_relative * 1e2,
                e.tr_rms_relative * 1e2,
                self.accuracy.tr_relative * 1e2,
                at(&self.worst_tr_at)
            ),
            format!(
                "Both were compared at {} random points off the table's grid, and at the worst points that a search from there \
                 found.",
                self.points
            ),
            format!(
                "Rounding to single precision is part of these errors: {:.0} nm by the arithmetic, and up to {:.0} nm because \
                 load and twist themselves are rounded.",
                self.rounding.arithmetic_m * 1e9,
                self.rounding.inputs_m * 1e9
            ),
            if self.monotone {
                "Everywhere in the table the gap falls with the twist and rises with the load, so that a gap belongs to one \
                 twist."
                    .into()
            } else {
                "The gap does not fall with the twist everywhere in the table: do not build firmware with it.".into()
            },
            format!(
                "Contraction and transmission ratio agree with each other: 1/TR summed over the twist gives the contraction \
                 to {:.2} µm.",
                self.closure_m * 1e6
            ),
            format!("This table is the {}.", self.why),
            format!(
                "Its scene has the hash {}, its numbers have the checksum {}; `rigctl doctor` compares both with the board's.",
                self.scene_hash, self.table_crc
            ),
        ]
    }

    /// The same for people, in lines.
    pub fn text(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "{} ({}), {} bytes, {} instructions a lookup (predicted), tier {}",
            self.form, self.size, self.bytes, self.instructions, self.tier
        )];
        for a in &self.axes {
            lines.push(format!("  {:<10} {} to {} {}, map {}", a.parameter, a.min, a.max, a.unit, a.map));
        }
        let e = &self.errors;
        lines.push(format!(
            "errors against the full solver at {} random points, and the worst searched for from there:\n  \
             contraction  max {:.3} um, rms {:.3} um (allowed {:.3} um)\n  \
             TR           max {:.4} %, rms {:.4} % (allowed {:.4} %)",
            self.points,
            e.contraction_max_m * 1e6,
            e.contraction_rms_m * 1e6,
            self.accuracy.contraction_m * 1e6,
            e.tr_max_relative * 1e2,
            e.tr_rms_relative * 1e2,
            self.accuracy.tr_relative * 1e2,
        ));
        lines.push(format!(
            "  of which rounding: arithmetic {:.0} nm and {:.1e} of TR, load and twist as f32 {:.0} nm",
            self.rounding.arithmetic_m * 1e9,
            self.rounding.tr_arithmetic_relative,
            self.rounding.inputs_m * 1e9
        ));
        lines.push(format!("  1/TR summed over the twist gives the contraction to {:.2} um", self.closure_m * 1e6));
        lines.push(format!("  gap falls with twist and rises with load everywhere: {}", self.monotone));
        lines.push(format!("why this one: {}", self.why));
        lines.push(format!(
            "{:<17} {:<29} {:<16} {:>6} {:>12} {:>10} {:>9}  passes",
            "considered", "size", "load map", "bytes", "instructions", "max um", "TR max %"
        ));
        for c in &self.candidates {
            lines.push(format!(
                "{:<17} {:<29} {:<16} {:>6} {:>12} {:>10.3} {:>9.4}  {}",
                c.form,
                c.size,
                c.load_map,
                c.bytes,
                c.instructions,
                c.errors.contraction_max_m * 1e6,
                c.errors.tr_max_relative * 1e2,
                if c.passes { "yes" } else { "no" }
            ));
        }
        lines
    }
}

impl CandidateReport {
    fn new(c: Considered) -> Self {
        Self {
            tier: tsa_model::Tier::Full.name(),
            form: c.form,
            size: c.size,
            load_map: map_name(c.load_map),
            bytes: c.bytes,
            instructions: c.instructions,
            errors: c.errors.into(),
            passes: c.passes,
        }
    }
}
