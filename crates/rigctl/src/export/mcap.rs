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
use std::time::UNIX_EPOCH;

/// Topic of the rows.
pub const TELEMETRY: &str = "/telemetry";
/// Topic of requests and events, with the messages that Foxglove's log panel shows.
pub const LOG: &str = "/log";
/// Name of the metadata record with the log's header.
pub const METADATA: &str = "tsa-log";
/// Level of every message in `/log`: information.
const INFO: u8 = 2;

/// The file's content. Both times of a message are the host's clock (ns since 1970), of which the log's header has that of the
/// first row; without it they are the log's `t_s` (ns).
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
    let clock = Clock::of(table);
    let mut marks = table.marks().peekable();
    for (row, (_, cells)) in table.log.rows.iter().zip(&table.cells.rows) {
        while let Some((t_s, text)) = marks.next_if(|(t_s, _)| *t_s <= row.t_s) {
            send(&mut writer, log, clock.at(t_s), &log_message(clock.at(t_s), text))?;
        }
        let cells = table.cells.names.1.iter().zip(cells).filter(|(_, cell)| !cell.is_empty());
        let message: Map<String, Value> = cells.map(|(name, cell)| (name.to_owned(), value(name, cell))).collect();
        send(&mut writer, telemetry, clock.at(row.t_s), &message.into())?;
    }
    for (t_s, text) in marks {
        send(&mut writer, log, clock.at(t_s), &log_message(clock.at(t_s), text))?;
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

fn send(writer: &mut FileWriter<'_>, channel: MessageHeader, time: u64, message: &Value) -> McapResult<()> {
    let header = MessageHeader { log_time: time, publish_time: time, ..channel };
    writer.write_to_known_channel(&header, message.to_string().as_bytes())
}

/// When the host's clock was at the zero of the log's `t_s` (ns since 1970).
struct Clock(u64);

impl Clock {
    fn of(table: &Table<'_>) -> Self {
        let first_ns = Self(0).at(table.log.rows.first().map_or(0.0, |row| row.t_s));
        let since_1970 = table.log.header.host_time().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let host_ns = since_1970.and_then(|time| u64::try_from(time.as_nanos()).ok());
        Self(host_ns.map_or(0, |host_ns| host_ns.saturating_sub(first_ns)))
    }

    /// At a time of the log (s).
    fn at(&self, t_s: f64) -> u64 {
        self.0.saturating_add((t_s * 1e9).round() as u64)
    }
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

fn log_message(time: u64, text: &str) -> Value {
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
    fn times_are_those_of_the_hosts_clock_if_the_log_has_it() {
        let text = TEXT.replace("# seed", "# host_time = 2026-01-02T03:04:05.500Z\n# seed");
        let file = encode(&Table::read(&text, false).expect("a log")).expect("a file");
        let times: Vec<u64> =
            MessageStream::new(&file).expect("MCAP").map(|m| m.expect("a message").log_time).collect();
        // 1767323045.5 s after 1970 is the first row, whose t_s is 0.02.
        assert_eq!(times, [490, 500, 500, 510, 520].map(|ms| (1_767_323_045_000 + ms) * 1_000_000));
        let last = MessageStream::new(&file).expect("MCAP").last().expect("there").expect("a message");
        let last: Value = serde_json::from_slice(&last.data).expect("JSON");
        assert_eq!(last["timestamp"], json!({"sec": 1_767_323_045, "nsec": 520_000_000}));
    }

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
