//! The parts of the page that need no script, as HTML.

use crate::scene_key;
use crate::table_report::TableReport;
use rig_config::Scene;
use serde_json::Value;
use std::fmt::Write as _;

/// A figure of the page.
pub struct Figure {
    /// Its name, as `tsa-lab chart` uses it.
    pub name: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// SVG, if there is a picture, and what it shows in a few lines; none if it could not be made.
    pub content: Option<(Option<String>, Vec<String>)>,
}

/// Text that HTML shows as it is.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A figure, closed except where it is the only one of its heading.
pub fn figure(figure: &Figure) -> String {
    let title = escaped(figure.title);
    match &figure.content {
        Some((svg, findings)) => {
            let mut text = format!("<details class=\"figure\"><summary>{title}</summary>\n");
            if let Some(svg) = svg {
                // The declaration of an XML file has no place inside a page.
                let svg = svg.find("<svg").map_or(svg.as_str(), |start| &svg[start..]);
                let _ = writeln!(text, "<div class=\"paper\">{svg}</div>");
            }
            if !findings.is_empty() {
                let _ = writeln!(text, "<pre>{}</pre>", escaped(&findings.join("\n")));
            }
            text + "</details>\n"
        }
        None => format!("<p class=\"missing\">{title}: not part of this page.</p>\n"),
    }
}

/// The scene's constants with their units, by the keys of the scene file.
pub fn constants(scene: &Scene) -> String {
    let mut text = String::from("<table><thead><tr><th>Key</th><th>Symbol</th><th>Value</th></tr></thead><tbody>\n");
    let scene = serde_json::to_value(scene).unwrap_or_default();
    for group in ["geometry", "string", "material", "correction", "envelope", "accuracy", "rig"] {
        for (key, value) in scene[group].as_object().into_iter().flatten() {
            let key = format!("{group}.{key}");
            let symbol = Some(scene_key::symbol(&key)).filter(|symbol| *symbol != key).unwrap_or_default();
            let shown = |value: &Value| match (value, value.as_f64()) {
                (_, Some(x)) => with_unit(&key, x),
                (Value::String(word), _) => word.clone(),
                (other, _) => other.to_string(),
            };
            let shown = match value {
                Value::Null => continue,
                Value::Array(values) => values.iter().map(shown).collect::<Vec<_>>().join(", "),
                value => shown(value),
            };
            let _ = writeln!(text, "<tr><td>{key}</td><td>{symbol}</td><td>{}</td></tr>", escaped(&shown));
        }
    }
    text + "</tbody></table>\n"
}

/// A number of the scene with the unit that its key names.
fn with_unit(key: &str, value: f64) -> String {
    let endings = [
        ("_rad_per_s2", " rad/s²"),
        ("_nm_per_a", " N m/A"),
        ("_kg_m2", " kg m²"),
        ("_ohm", " Ω"),
        ("_a", " A"),
        ("_pa", " Pa"),
        (".load_n", " N"),
        (".turns", " turns"),
        ("lvdt_volts_at_stroke", " V"),
        ("lvdt_volts_at_zero", " V"),
    ];
    let unit = endings.into_iter().find(|(ending, _)| key.ends_with(ending)).map_or("", |(_, unit)| unit);
    scene_key::shown(key, value) + unit
}

/// The table's error bounds as sentences, and the candidates as a table.
pub fn error_bounds(table: &TableReport<'_>) -> String {
    let mut text = String::from("<ul class=\"certificate\">\n");
    for sentence in table.sentences() {
        let _ = writeln!(text, "<li>{}</li>", escaped(&sentence));
    }
    text += "</ul>\n<details><summary>Every table that was considered</summary><div class=\"wide\"><table>\n";
    for (row, tag) in table.considered().zip(["th"].into_iter().chain(std::iter::repeat("td"))) {
        let cells = row.map(|cell| format!("<{tag}>{}</{tag}>", escaped(&cell)));
        let _ = writeln!(text, "<tr>{}</tr>", cells.concat());
    }
    text + "</table></div></details>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_from_outside_becomes_markup() {
        let picture = (Some("<?xml?><svg></svg>".into()), vec!["1 & <script>".into()]);
        let text = figure(&Figure { name: "margin", title: "Margin", content: Some(picture) });
        assert!(
            text.contains("<div class=\"paper\"><svg></svg></div>") && text.contains("1 &amp; &lt;script&gt;"),
            "{text}"
        );
        let text = figure(&Figure { name: "margin", title: "<Margin>", content: None });
        assert!(text.contains("&lt;Margin&gt;: not part of this page"), "{text}");
    }

    #[test]
    fn every_constant_of_the_scene_has_its_unit() {
        let scene = Scene::from_toml_str(include_str!("../../../scenes/default.toml")).expect("the scene");
        let text = constants(&scene);
        for part in [
            "<td>geometry.string_length_m</td><td>L0</td><td>97 mm</td>",
            "1.37 kN/m",
            "0.75 N, 18 N",
            "0.5 A",
            "rig.encoder_lines",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }
}
