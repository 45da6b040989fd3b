//! Parquet: a column of doubles or of text for each column of the log, an empty cell is null.

use super::Table;
use super::table::{Cells, Mark};
use ::parquet::basic::{LogicalType, Repetition, Type as Physical};
use ::parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType};
use ::parquet::errors::Result;
use ::parquet::file::metadata::KeyValue;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use ::parquet::schema::types::Type;
use std::sync::Arc;

/// Key of the file's metadata that holds requests and events: JSON, a list of pairs of time (s) and text.
pub const MARKS: &str = "marks";

/// The file's content.
///
/// # Errors
/// If the writer fails.
pub fn encode(table: &Table<'_>) -> Result<Vec<u8>> {
    let fields = table.columns.iter().map(|column| field(column.name, &column.cells)).collect::<Result<Vec<_>>>()?;
    let schema = Type::group_type_builder("telemetry").with_fields(fields).build()?;
    let properties = WriterProperties::builder()
        .set_created_by(concat!("rigctl ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(metadata(table)))
        .build();
    let mut file = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut file, Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for column in &table.columns {
        match &column.cells {
            Cells::Numbers(numbers) => write::<DoubleType>(&mut group, numbers.iter().copied())?,
            Cells::Words(words) => {
                write::<ByteArrayType>(&mut group, words.iter().map(|word| word.map(ByteArray::from)))?;
            }
        }
    }
    group.close()?;
    writer.close()?;
    Ok(file)
}

fn field(name: &str, cells: &Cells<'_>) -> Result<Arc<Type>> {
    let (physical, logical) = match cells {
        Cells::Numbers(_) => (Physical::DOUBLE, None),
        Cells::Words(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    let field = Type::primitive_type_builder(name, physical);
    Ok(Arc::new(field.with_repetition(Repetition::OPTIONAL).with_logical_type(logical).build()?))
}

fn metadata(table: &Table<'_>) -> Vec<KeyValue> {
    let marks: Vec<(f64, &str)> = table.marks.iter().map(|Mark { t_s, text }| (*t_s, *text)).collect();
    let marks = serde_json::json!(marks).to_string();
    let facts = table.facts.iter().cloned().chain([(MARKS.to_owned(), marks)]);
    facts.map(|(key, value)| KeyValue::new(key, value)).collect()
}

/// Writes the next column: the cells that are there, and for each row whether its cell is.
fn write<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, &mut Vec<u8>>,
    cells: impl Iterator<Item = Option<T::T>> + Clone,
) -> Result<()> {
    let Some(mut column) = group.next_column()? else { return Ok(()) };
    let levels: Vec<i16> = cells.clone().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<T::T> = cells.flatten().collect();
    column.typed::<T>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    use ::parquet::record::Field;

    #[test]
    fn what_the_crate_reads_is_the_log() {
        let text = "# format = tsa-log 1\n# seed = 3\nt_s,state,position_m,twist_rad,limit\n0.02,ready,,3.2,\n\
            # at 0.02 event stopped\n0.03,moving,-1e-7,3.3,speed\n# end rows = 2\n";
        let file = encode(&Table::read(text, false).expect("a log")).expect("a file");
        let reader = SerializedFileReader::new(bytes(file)).expect("Parquet");
        let facts = reader.metadata().file_metadata().key_value_metadata().expect("metadata").clone();
        let fact = |key: &str| facts.iter().find(|kv| kv.key == key).and_then(|kv| kv.value.clone());
        assert_eq!(fact("seed").as_deref(), Some("3"));
        assert_eq!(fact(MARKS).as_deref(), Some("[[0.02,\"event stopped\"]]"));
        let rows: Vec<Vec<Field>> = reader
            .get_row_iter(None)
            .expect("rows")
            .map(|row| row.expect("a row").get_column_iter().map(|(_, field)| field.clone()).collect())
            .collect();
        let word = |text: &str| Field::Str(text.into());
        assert_eq!(rows[0], [Field::Double(0.02), word("ready"), Field::Null, Field::Double(3.2), Field::Null]);
        assert_eq!(
            rows[1],
            [Field::Double(0.03), word("moving"), Field::Double(-1e-7), Field::Double(3.3), word("speed")]
        );
    }

    /// What the reader takes, without a dependency on its crate of buffers.
    fn bytes(file: Vec<u8>) -> impl ::parquet::file::reader::ChunkReader + 'static {
        let path = std::env::temp_dir().join(format!("rigctl-parquet-{}", std::process::id()));
        std::fs::write(&path, file).expect("written");
        let opened = std::fs::File::open(&path).expect("there");
        std::fs::remove_file(path).expect("there");
        opened
    }
}
