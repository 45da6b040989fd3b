//! A table written out as Rust source, bit for bit.

use crate::axis::LoadMap;
use crate::fit::{Fit, Numbers, OwnedTable};
use std::fmt::Write;

fn float(value: f32) -> String {
    format!("f32::from_bits({:#010x})", value.to_bits())
}

fn floats<'a>(values: impl IntoIterator<Item = &'a f32>) -> String {
    values.into_iter().map(|v| float(*v)).collect::<Vec<_>>().join(", ")
}

/// Source of `pub static TABLE: tsa_table::Table<'static>` with its certificate in the doc comment.
pub fn rust_source(fit: &Fit) -> String {
    let (table, e) = (&fit.table, &fit.certificate.errors);
    let doc = format!(
        "{}, {}: contraction within {:.3e} m (rms {:.3e}), TR within {:.3e} (rms {:.3e}) of the full solver at {} \
         random points and the worst found by search.",
        table.numbers.kind(),
        table.numbers.size(),
        e.contraction_max_m,
        e.contraction_rms_m,
        e.tr_max,
        e.tr_rms,
        fit.certificate.points
    );
    table_source("TABLE", &doc, table)
}

/// Source of a static table of that name.
pub fn table_source(name: &str, doc: &str, table: &OwnedTable) -> String {
    let m = &table.metadata;
    let axis = |a: crate::Axis| {
        format!("tsa_table::Axis {{ centre: {}, inverse_half: {} }}", float(a.centre), float(a.inverse_half))
    };
    let form = match &table.numbers {
        Numbers::Series { row_lengths, coefficients } => {
            format!("Series {{ row_lengths: &{row_lengths:?}, coefficients: &[{}] }}", floats(coefficients))
        }
        Numbers::Hermite { loads, twists, nodes } => {
            let nodes: Vec<String> = nodes.iter().map(|n| format!("[{}]", floats(n))).collect();
            format!("Hermite {{ loads: {loads}, twists: {twists}, nodes: &[{}] }}", nodes.join(", "))
        }
        Numbers::Bilinear { loads, twists, nodes } => {
            format!("Bilinear {{ loads: {loads}, twists: {twists}, nodes: &[{}] }}", floats(nodes))
        }
        Numbers::Arc { growth, shape, patches, coefficients } => {
            let patch = |p: &crate::Patch| {
                format!("tsa_table::Patch {{ load_max_n: {}, centre: [{}] }}", float(p.load_max_n), floats(&p.centre))
            };
            let patches: Vec<String> = patches.iter().map(patch).collect();
            format!(
                "Arc(tsa_table::ArcSeries {{ growth: tsa_table::Growth {{ per_load_m_n: {}, powers: [{}] }}, \
                 shape: tsa_table::Shape::of({}, {}).unwrap(), patches: &[{}], coefficients: &[{}] }})",
                float(growth.per_load_m_n),
                floats(&growth.powers),
                shape.rows,
                shape.columns,
                patches.join(", "),
                floats(coefficients)
            )
        }
    };
    let map = match m.load_map {
        LoadMap::Ratio { knee_n } => format!("Ratio {{ knee_n: {} }}", float(knee_n)),
        LoadMap::Log => "Log".into(),
        LoadMap::InverseRoot => "InverseRoot".into(),
        LoadMap::Linear => "Linear".into(),
    };
    let mut source = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        source,
        "/// {doc}\n\
         pub static {name}: tsa_table::Table<'static> = tsa_table::Table {{\n\
         \x20   metadata: tsa_table::Metadata {{\n\
         \x20       load_min_n: {f0}, load_max_n: {f1}, twist_min_rad: {t0}, twist_max_rad: {t1},\n\
         \x20       load_map: tsa_table::LoadMap::{map}, load_axis: {la}, twist_axis: {ta},\n\
         \x20       contraction_error_m: {ce}, tr_relative_error: {te},\n\
         \x20       scene_hash: {hash:#010x}, generator_version: {version},\n\
         \x20   }},\n\
         \x20   form: tsa_table::Form::{form},\n\
         \x20   crc: {crc:#010x},\n\
         }};\n",
        f0 = float(m.load_min_n),
        f1 = float(m.load_max_n),
        t0 = float(m.twist_min_rad),
        t1 = float(m.twist_max_rad),
        la = axis(m.load_axis),
        ta = axis(m.twist_axis),
        ce = float(m.contraction_error_m),
        te = float(m.tr_relative_error),
        hash = m.scene_hash,
        version = m.generator_version,
        crc = table.crc,
    );
    source
}
