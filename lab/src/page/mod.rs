//! The page that `report` writes: the mechanism with its solver, and everything known about a scene.
//!
//! - [`data`]: what the page's script computes with.
//! - [`fragments`]: the parts that need no script, as HTML.
//! - [`report`]: the command.
//!
//! Layout, style and script are the files in `web/page`; the solver is compiled by this crate's build script.

pub mod data;
pub mod fragments;
pub mod report;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use rigctl::failure::Failure;

/// The compiled solver, or why there is none.
const SOLVER: Result<&[u8], &str> = include!(concat!(env!("OUT_DIR"), "/solver.rs"));

const LAYOUT: &str = include_str!("../../web/page/page.html");
const STYLE: &str = include_str!("../../web/page/page.css");
/// The parts of the script, in the order in which they need each other.
const SCRIPT: [&str; 8] = [
    include_str!("../../web/page/solver.js"),
    include_str!("../../web/page/plot.js"),
    include_str!("../../web/page/drawing.js"),
    include_str!("../../web/page/curves.js"),
    include_str!("../../web/page/map.js"),
    include_str!("../../web/page/controls.js"),
    include_str!("../../web/page/playback.js"),
    include_str!("../../web/page/main.js"),
];

/// The solver, in the form in which it goes into a page.
///
/// # Errors
/// What was missing when this program was built.
fn solver() -> Result<String, Failure> {
    let bytes =
        SOLVER.map_err(|why| Failure::failed(format!("this tool was built without the page's solver: {why}")))?;
    Ok(STANDARD.encode(bytes))
}

/// The page as HTML, of what belongs in the places of the layout.
///
/// # Errors
/// As [`solver`].
fn html(parts: Vec<(&str, String)>) -> Result<String, Failure> {
    let own = [("style", STYLE.into()), ("solver", solver()?), ("script", SCRIPT.join("\n"))];
    Ok(filled(LAYOUT, &own.into_iter().chain(parts).collect::<Vec<_>>()))
}

/// A layout with each `{{name}}` replaced. What is put in is not searched again.
pub fn filled(layout: &str, parts: &[(&str, String)]) -> String {
    let mut text = String::new();
    let mut pieces = layout.split("{{");
    text += pieces.next().unwrap_or_default();
    for piece in pieces {
        let part = piece.split_once("}}").and_then(|(name, rest)| {
            let (_, part) = parts.iter().find(|(known, _)| *known == name)?;
            Some((part, rest))
        });
        match part {
            Some((part, rest)) => text = text + part + rest,
            None => text = text + "{{" + piece,
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_of_the_layout_is_filled_once() {
        let parts = [("a", "1 {{b}}".to_owned()), ("b", "2".to_owned())];
        assert_eq!(filled("x {{a}} y {{b}} {{c}}", &parts), "x 1 {{b}} y 2 {{c}}");
        for name in ["title", "style", "constants", "certificate", "figures", "recorded", "data", "solver", "script"] {
            assert!(LAYOUT.contains(&format!("{{{{{name}}}}}")), "{name}");
        }
    }

    #[test]
    fn no_part_of_the_script_ends_its_element() {
        for part in SCRIPT {
            assert!(!part.contains("</script"), "{part}");
        }
        assert!(!STYLE.contains("</style"));
    }
}
