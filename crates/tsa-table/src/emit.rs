//! A table written out as Rust source, bit for bit: at its start the board compares the checksum, which covers every number.

use crate::arc::FORM;
use crate::fit::Fit;
use crate::owned::OwnedTable;

fn float(value: f32) -> String {
    format!("f32::from_bits({:#010x})", value.to_bits())
}

/// The values as a list of Rust expressions.
pub fn floats<'a>(values: impl IntoIterator<Item = &'a f32>) -> String {
    values.into_iter().map(|v| float(*v)).collect::<Vec<_>>().join(", ")
}

/// Source of `pub static TABLE: tsa_table::Table<'static>` with its certificate in the doc comment.
pub fn rust_source(fit: &Fit) -> String {
    let (table, e) = (&fit.table, &fit.error_bounds.errors);
    let doc = format!(
        "{FORM}, {}: contraction within {:.3e} m (rms {:.3e}), TR within {:.3e} (rms {:.3e}) of the full solver at {} \
         random points and the worst found by search.",
        table.numbers.size(),
        e.contraction_max_m,
        e.contraction_rms_m,
        e.tr_max,
        e.tr_rms,
        fit.error_bounds.points
    );
    table_source("TABLE", &doc, table)
}

/// Source of a static table of this name.
pub fn table_source(name: &str, doc: &str, table: &OwnedTable) -> String {
    let m = &table.metadata;
    let numbers = &table.numbers;
    let patch = |p: &crate::Patch| {
        format!("tsa_table::Patch {{ load_max_n: {}, centre: [{}] }}", float(p.load_max_n), floats(&p.centre))
    };
    let patches: Vec<String> = numbers.patches.iter().map(patch).collect();
    format!(
        "/// {doc}\n\
         pub static {name}: tsa_table::Table<'static> = tsa_table::Table {{\n\
         \x20   metadata: tsa_table::Metadata {{\n\
         \x20       load_min_n: {f0}, load_max_n: {f1}, twist_min_rad: {t0}, twist_max_rad: {t1},\n\
         \x20       contraction_error_m: {ce}, tr_relative_error: {te},\n\
         \x20       uncertainty: tsa_table::{uncertainty:?},\n\
         \x20       scene_hash: {hash:#010x}, generator_version: {version},\n\
         \x20   }},\n\
         \x20   series: tsa_table::ArcSeries {{\n\
         \x20       growth: tsa_table::Growth {{ per_load_m_n: {growth}, powers: [{powers}], per_log_m: {per_log} }},\n\
         \x20       shape: tsa_table::Shape::of({rows}, {columns}).unwrap(),\n\
         \x20       patches: &[{patches}],\n\
         \x20       coefficients: &[{coefficients}],\n\
         \x20   }},\n\
         \x20   crc: {crc:#010x},\n\
         }};\n",
        f0 = float(m.load_min_n),
        f1 = float(m.load_max_n),
        t0 = float(m.twist_min_rad),
        t1 = float(m.twist_max_rad),
        ce = float(m.contraction_error_m),
        te = float(m.tr_relative_error),
        uncertainty = m.uncertainty,
        hash = m.scene_hash,
        version = m.generator_version,
        growth = float(numbers.growth.per_load_m_n),
        powers = floats(&numbers.growth.powers),
        per_log = float(numbers.growth.per_log_m),
        rows = numbers.shape.rows,
        columns = numbers.shape.columns,
        patches = patches.join(", "),
        coefficients = floats(&numbers.coefficients),
        crc = table.crc,
    )
}
