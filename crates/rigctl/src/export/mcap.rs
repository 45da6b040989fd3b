//! MCAP with messages in JSON and their JSON schemas, which Foxglove and PlotJuggler read without plug-ins.
//!
//! A key is left out where its cell is empty, and the schema names plain types: Foxglove refuses a schema in which a field
//! may be a number or null.

use super::{Table, WORDS};
use ::mcap::records::{MessageHeader, Metadata};
use ::mcap::{McapResult, WriteOptions, Writer};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Topic of the rows.
pub const TELEMETRY: &str = "/telemetry";
/// Topic of requests and events, with the messages that Foxglove's log panel shows.
pub const LOG: &str = "/log";
/// Name of the metadata record with the log's header.
pub const METADATA: &str = "tsa-log";
/// Level of every message in `/log`: information.
const INFO: u8 = 2;

/// The file's content. Both times of a message are the log's `t_s` (ns).
///
/// # Errors
/// If the writer fails.
pub fn encode(table: &Table<'_>) -> McapResult<Vec<u8>> {
    let mut file = Cursor::new(Vec::new());
    let library = concat!("rigctl ", env!("CARGO_PKG_VERSION"));
    let mut writer = WriteOptions::new().compression(None).library(library).create(&mut file)?;
    let telemetry = channel(&mut writer, TELEMETRY, "tsa.Telemetry", telemetry_schema(table))?;
    let log = channel(&mut writer, LOG, "foxglove.Log", log_schema())?;
    let metadata = table.log.header.0.iter().cloned().collect();
    writer.write_metadata(&Metadata { name: METADATA.into(), metadata })?;
    let mut marks = table.marks().peekable();
    for (row, (_, cells)) in table.log.rows.iter().zip(&table.cells.rows) {
        while let Some((t_s, text)) = marks.next_if(|(t_s, _)| *t_s <= row.t_s) {
            send(&mut writer, log, t_s, &log_message(t_s, text))?;
        }
        let cells = table.cells.names.1.iter().zip(cells).filter(|(_, cell)| !cell.is_empty());
        let message: Map<String, Value> = cells.map(|(name, cell)| (name.to_owned(), value(name, cell))).collect();
        send(&mut writer, telemetry, row.t_s, &message.into())?;
    }
    for (t_s, text) in marks {
        send(&mut writer, log, t_s, &log_message(t_s, text))?;
    }
    writer.finish()?;
    drop(writer);
    Ok(file.into_inner())
}

type FileWriter<'a> = Writer<&'a mut Cursor<Vec<u8>>>;

fn channel(writer: &mut FileWriter<'_>, topic: &str, name: &str, schema: Value) -> McapResult<MessageHeader> {
    let schema_id = writer.add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
    let channel_id = writer.add_channel(schema_id, topic, "json", &BTreeMap::new())?;
    Ok(MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 })
}

fn send(writer: &mut FileWriter<'_>, channel: MessageHeader, t_s: f64, message: &Value) -> McapResult<()> {
    let time = nanoseconds(t_s);
    let header = MessageHeader { log_time: time, publish_time: time, ..channel };
    writer.write_to_known_channel(&header, message.to_string().as_bytes())
}

/// A time of the log (s) in ns.
fn nanoseconds(t_s: f64) -> u64 {
    (t_s * 1e9).round() as u64
}

fn telemetry_schema(table: &Table<'_>) -> Value {
    let kind = |name: &str| json!({"type": if WORDS.contains(&name) { "string" } else { "number" }});
    let properties: Map<String, Value> = table.cells.names.1.iter().map(|name| (name.to_owned(), kind(name))).collect();
    json!({"type": "object", "title": "tsa.Telemetry", "properties": properties})
}

fn value(name: &str, cell: &str) -> Value {
    match cell.parse::<f64>() {
        Ok(number) if !WORDS.contains(&name) => number.into(),
        _ => cell.into(),
    }
}

/// The schema that Foxglove publishes for its log panel.
fn log_schema() -> Value {
    let integer = json!({"type": "integer"});
    let string = json!({"type": "string"});
    json!({"type": "object", "title": "foxglove.Log", "properties": {
        "timestamp": {"type": "object", "title": "time", "properties": {"sec": integer, "nsec": integer}},
        "level": integer, "message": string, "name": string, "file": string, "line": integer,
    }})
}

fn log_message(t_s: f64, text: &str) -> Value {
    let time = nanoseconds(t_s);
    let timestamp = json!({"sec": time / 1_000_000_000, "nsec": time % 1_000_000_000});
    let (name, message) = text.split_once(' ').unwrap_or(("", text));
    json!({"timestamp": timestamp, "level": INFO, "message": message, "name": name, "file": "", "line": 0})
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::mcap::{MessageStream, Summary};

    const TEXT: &str = "# format = tsa-log 1\n# seed = 3\nt_s,state,position_m,twist_rad,limit\n\
        # at 0.01 request home\n0.02,ready,,3.2,\n# at 0.02 event stopped\n0.03,moving,-1e-7,3.3,travel\n\
        # at 0.04 event move-done error_m=1e-6\n# end rows = 2\n";

    #[test]
    fn what_the_crate_reads_is_the_log() {
        let table = Table::read(TEXT, false).expect("a log");
        let file = encode(&table).expect("a file");
        let messages: Vec<_> = MessageStream::new(&file).expect("MCAP").map(|m| m.expect("a message")).collect();
        let heard: Vec<(&str, u64, Value)> = messages
            .iter()
            .map(|m| (m.channel.topic.as_str(), m.log_time, serde_json::from_slice(&m.data).expect("JSON")))
            .collect();
        let topics: Vec<(&str, u64)> = heard.iter().map(|(topic, time, _)| (*topic, *time)).collect();
        let ms = 1_000_000;
        // A mark of the time of a row goes before it.
        assert_eq!(
            topics,
            [(LOG, 10 * ms), (LOG, 20 * ms), (TELEMETRY, 20 * ms), (TELEMETRY, 30 * ms), (LOG, 40 * ms)]
        );
        let rows: Vec<&Value> = heard.iter().filter(|(topic, ..)| *topic == TELEMETRY).map(|(.., v)| v).collect();
        assert_eq!(*rows[0], json!({"t_s": 0.02, "state": "ready", "twist_rad": 3.2}), "no key without a value");
        assert_eq!(
            *rows[1],
            json!({"t_s": 0.03, "state": "moving", "position_m": -1e-7, "twist_rad": 3.3, "limit": "travel"})
        );
        let last = &heard.last().expect("there").2;
        assert_eq!((&last["name"], &last["message"]), (&json!("event"), &json!("move-done error_m=1e-6")));
        assert_eq!(last["timestamp"], json!({"sec": 0, "nsec": 40 * ms}));
        let schema = messages[0].channel.schema.as_ref().expect("a schema");
        assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("foxglove.Log", "jsonschema"));
        let summary = Summary::read(&file).expect("MCAP").expect("a summary");
        let found = ::mcap::read::metadata(&file, &summary.metadata_indexes[0]).expect("a record");
        assert_eq!((found.name.as_str(), found.metadata.get("seed").map(String::as_str)), (METADATA, Some("3")));
    }
}
