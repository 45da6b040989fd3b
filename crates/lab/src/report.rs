//! One page with everything about a scene: model, table certificate, charts, stability map, a recorded move.

use crate::table_report::TableReport;
use anyhow::Result;
use rig_scene::Scene;
use serde_json::Value;
use std::fmt::Write as _;

/// A figure of the page, or why it is missing.
pub struct Section {
    /// Its name.
    pub name: &'static str,
    /// Picture and findings, or the reason in words.
    pub content: Result<Picture, String>,
}

/// A picture, if there is one, and what it shows in a few lines.
pub struct Picture {
    /// SVG.
    pub svg: Option<String>,
    /// What it shows.
    pub findings: Vec<String>,
}

/// The page as HTML; `scene_name` stands in its title.
///
/// # Errors
/// Never for the scenes and certificates that exist: each has a JSON form.
pub fn page(
    scene_name: &str,
    scene: &Scene,
    table: &TableReport,
    charts: &[Section],
    recorded: &Section,
) -> Result<String> {
    let certificate = serde_json::to_value(table)?;
    let mut page = Page::new(&format!("Twisted-string actuator: {scene_name}"));
    page.heading("Model");
    page.paragraph(
        "All numbers are computed or emulated; nothing here has met hardware. SI units. Constants as in the scene file:",
    );
    page.values(&serde_json::to_value(scene)?);
    page.heading("Table certificate");
    page.paragraph(certificate["why"].as_str().unwrap_or_default());
    page.values(&certificate);
    page.list("Candidates", &certificate["candidates"]);
    page.heading("Speed, accuracy, stability");
    charts.iter().for_each(|chart| page.section(chart));
    page.heading("A recorded move");
    page.section(recorded);
    Ok(page.end())
}

/// The page while it is written.
struct Page {
    text: String,
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

const STYLE: &str = "body{font:16px/1.5 sans-serif;max-width:1200px;margin:2em auto;padding:0 1em}\
    svg{max-width:100%;height:auto}table{border-collapse:collapse;margin:1em 0}\
    td,th{border-bottom:1px solid #ccc;padding:.2em .8em .2em 0;text-align:left;vertical-align:top}\
    pre{overflow-x:auto;background:#f5f5f5;padding:.6em;font-size:13px}";

impl Page {
    fn new(title: &str) -> Self {
        let title = escaped(title);
        let text = format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<title>{title}</title>\n\
             <style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
        );
        Self { text }
    }

    fn push(&mut self, arguments: std::fmt::Arguments<'_>) {
        // A string takes whatever is written.
        let _ = self.text.write_fmt(arguments);
    }

    fn heading(&mut self, text: &str) {
        self.push(format_args!("<h2>{}</h2>\n", escaped(text)));
    }

    fn paragraph(&mut self, text: &str) {
        self.push(format_args!("<p>{}</p>\n", escaped(text)));
    }

    /// Every number and word of an object, inner ones under their path; lists of objects have [`Page::list`].
    fn values(&mut self, value: &Value) {
        let mut rows = Vec::new();
        collect("", value, &mut rows);
        self.text.push_str("<table>\n");
        for (key, value) in rows {
            self.push(format_args!("<tr><td>{}</td><td>{}</td></tr>\n", escaped(&key), escaped(&value)));
        }
        self.text.push_str("</table>\n");
    }

    /// A list of objects with the same keys.
    fn list(&mut self, title: &str, list: &Value) {
        let lines: Vec<Vec<(String, String)>> = list
            .as_array()
            .into_iter()
            .flatten()
            .map(|line| {
                let mut rows = Vec::new();
                collect("", line, &mut rows);
                rows
            })
            .collect();
        let Some(first) = lines.first() else { return };
        let heads: String = first.iter().map(|(key, _)| format!("<th>{}</th>", escaped(key))).collect();
        self.push(format_args!("<details><summary>{}</summary><table><tr>{heads}</tr>\n", escaped(title)));
        for line in &lines {
            let cells: String = line.iter().map(|(_, value)| format!("<td>{}</td>", escaped(value))).collect();
            self.push(format_args!("<tr>{cells}</tr>\n"));
        }
        self.text.push_str("</table></details>\n");
    }

    fn section(&mut self, section: &Section) {
        let name = escaped(section.name);
        match &section.content {
            Ok(Picture { svg, findings }) => {
                self.push(format_args!("<h3>{name}</h3>\n{}\n", svg.as_deref().unwrap_or_default()));
                self.push(format_args!("<pre>{}</pre>\n", escaped(&findings.join("\n"))));
            }
            Err(why) => {
                self.push(format_args!("<h3>{name}</h3>\n"));
                self.paragraph(&format!("left out: {}: {why}", section.name));
            }
        }
    }

    fn end(mut self) -> String {
        self.text.push_str("</body></html>\n");
        self.text
    }
}

/// Leaves of a value with their paths.
fn collect(path: &str, value: &Value, rows: &mut Vec<(String, String)>) {
    let inside = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Null => {}
        Value::Object(map) => map.iter().for_each(|(key, value)| collect(&inside(key), value, rows)),
        Value::Array(list) if list.iter().all(|v| !v.is_object()) => {
            rows.push((path.into(), list.iter().map(shown).collect::<Vec<_>>().join(", ")));
        }
        Value::Array(list) if path == "candidates" => rows.push((path.into(), list.len().to_string())),
        Value::Array(list) => list.iter().enumerate().for_each(|(k, v)| collect(&inside(&k.to_string()), v, rows)),
        leaf => rows.push((path.into(), shown(leaf))),
    }
}

fn shown(leaf: &Value) -> String {
    match leaf {
        Value::String(text) => text.clone(),
        Value::Number(n) => match n.as_f64() {
            Some(x) if x != 0.0 && !(1e-4..1e6).contains(&x.abs()) => format!("{x:.4e}"),
            _ => n.to_string(),
        },
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_from_outside_becomes_markup_and_every_value_is_there() {
        let mut page = Page::new("a < b");
        page.values(&serde_json::json!({"x": {"y": 2.5e-6, "z": [1, 2]}, "s": "<script>", "none": null}));
        page.list("many", &serde_json::json!([{"k": 1}, {"k": 2}]));
        page.section(&Section {
            name: "f",
            content: Ok(Picture { svg: Some("<svg></svg>".into()), findings: vec!["1 & 2".into()] }),
        });
        let text = page.end();
        for part in ["a &lt; b", "x.y", "2.5000e-6", "1, 2", "&lt;script&gt;", "<td>2</td>", "<svg></svg>", "1 &amp; 2"]
        {
            assert!(text.contains(part), "{part} in {text}");
        }
        assert!(!text.contains("<script>") && !text.contains("none"));
    }
}
