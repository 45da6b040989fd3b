//! Data as CSV.

use anyhow::Result;

/// Lines of comma-separated cells under a header, quoted where necessary.
///
/// # Errors
/// If a line has another number of cells than the header.
pub fn csv_text(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(header)?;
    for row in rows {
        writer.write_record(row)?;
    }
    Ok(String::from_utf8(writer.into_inner().map_err(|e| e.into_error())?)?)
}

/// A cell that may be empty.
pub fn optional(value: Option<f64>) -> String {
    value.map_or(String::new(), |v| v.to_string())
}
