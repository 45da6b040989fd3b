//! A table written out as Rust source, bit for bit.

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
    let (table, e) = (&fit.table, &fit.certificate.errors);
    let doc = format!(
        "{FORM}, {}: contraction within {:.3e} m (rms {:.3e}), TR within {:.3e} (rms {:.3e}) of the full solver at {} \
         random points and the worst found by search.",
        table.numbers.size(),
        e.contraction_max_m,
        e.contraction_rms_m,
        e.tr_max,
        e.tr_rms,
        fit.certificate.points
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::owned::OwnedSeries;
    use crate::{Growth, Metadata, Patch, Shape};

    #[test]
    fn every_number_is_written_by_its_bits_in_its_place() {
        assert_eq!(floats(&[1.0, -0.5]), "f32::from_bits(0x3f800000), f32::from_bits(0xbf000000)");
        let metadata = Metadata { scene_hash: 0xabcd, generator_version: 4, ..Metadata::EXAMPLE };
        let numbers = OwnedSeries {
            growth: Growth { per_load_m_n: 2e-4, powers: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], per_log_m: 7.0 },
            shape: Shape::of(2, 3).unwrap(),
            patches: vec![Patch { load_max_n: 16.0, centre: [8.0, 0.02] }],
            coefficients: vec![0.0, -1.0, 0.0, -0.06, 5e-5, 0.0085],
        };
        assert_eq!((numbers.size().as_str(), numbers.bytes()), ("1 ranges of 2x3 coefficients", 32 + 12 + 24));
        let source =
            table_source("OTHER", "What it is.", &OwnedTable { metadata, numbers: numbers.clone(), crc: 0x77 });
        assert!(source.starts_with("/// What it is.\npub static OTHER: tsa_table::Table<'static> = "));
        for part in [
            format!("load_min_n: {}, load_max_n: {}, twist_min_rad: {}", float(1.0), float(16.0), float(3.0)),
            format!("contraction_error_m: {}, tr_relative_error: {}", float(5e-6), float(2e-3)),
            "scene_hash: 0x0000abcd, generator_version: 4".into(),
            format!("powers: [{}], per_log_m: {} }}", floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), float(7.0)),
            "shape: tsa_table::Shape::of(2, 3).unwrap()".into(),
            format!(
                "patches: &[tsa_table::Patch {{ load_max_n: {}, centre: [{}] }}]",
                float(16.0),
                floats(&[8.0, 0.02])
            ),
            format!("coefficients: &[{}]", floats(&numbers.coefficients)),
            "crc: 0x00000077".into(),
        ] {
            assert!(source.contains(&part), "{part} is not in {source}");
        }
    }
}
