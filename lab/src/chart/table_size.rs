//! How many bytes a table needs for an accuracy, form by form.

use super::{Inputs, Made};
use anyhow::{Result, bail};
use rig_config::{Accuracy, Scene, TableError};
use rigctl::csv_text::below;
use rigctl::parallel::parallel;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, Shape, colour, extent};
use serde::Serialize;
use std::cmp::Ordering;
use table_forms::considered::{Considered, considered};
use tsa_table::FORM;
use tsa_table::fit::{Errors, Fit, FitError, MAX_BYTES};
use tsa_table::instruction_model::LOOKUP_INSTRUCTIONS;

/// Demanded accuracies (m); the error of TR keeps its ratio to that of the scene.
const ASKED_M: [f64; 7] = [200e-6, 100e-6, 50e-6, 20e-6, 10e-6, 5e-6, 2e-6];

/// In the order of the key.
const FORMS: [&str; 4] = ["arc-series", "chebyshev-series", "hermite-bicubic", "bilinear"];

/// A demanded accuracy (m); the fit to it, and the tables of all forms that were considered.
type Asked = (f64, Result<(Fit, Vec<Considered>), TableError>);

/// Fits the scene's table at several accuracies and draws bytes against error.
///
/// # Errors
/// If the scene says nothing of a table, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let scene = inputs.scene;
    let (_, accuracy) = scene.table_requirement()?;
    let fraction = accuracy.tr_relative / accuracy.contraction_m;
    let fits = parallel(inputs.progress, ASKED_M.len(), |k| {
        let wanted = Accuracy { contraction_m: ASKED_M[k], tr_relative: fraction * ASKED_M[k] };
        let scene = Scene { accuracy: Some(wanted), ..scene.clone() };
        let found = scene.fit_table().and_then(|fit| {
            let all = considered(&scene.mechanism()?, &scene.table_spec()?, &fit)?;
            Ok((fit, all))
        });
        match found {
            // Anything but an accuracy out of reach is the scene's fault.
            Err(e) if !matches!(e, TableError::Fit(FitError::Accuracy { .. })) => Err(e),
            found => Ok((ASKED_M[k], found)),
        }
    });
    let fits = fits.into_iter().collect::<Result<Vec<Asked>, _>>()?;
    let mut drawn = fits.iter().filter_map(|(_, found)| found.as_ref().ok()).flat_map(|(_, all)| all);
    if let Some(Considered { form, .. }) = drawn.find(|c| !FORMS.contains(&c.form)) {
        bail!("the chart has no colour for the form {form}: add it to FORMS in lab/src/chart/table_size.rs");
    }
    let line = |(k, form): (usize, &&str)| KeyRow::line(Pen::solid(colour(k, FORMS.len())), *form);
    let asked: Vec<String> = ASKED_M.iter().map(|asked_m| format!("{:.0}", asked_m * 1e6)).collect();
    let mut notes = vec![format!(
        "Asked for {} µm of contraction, TR in proportion as in the scene; at most {MAX_BYTES} bytes. Of equal accuracy the fit prefers \
         what the board looks up in {LOOKUP_INSTRUCTIONS} instructions. Errors against the \
         full solver on the grid by which candidates are selected.",
        asked.join(", ")
    )];
    let failed = |(asked_m, found): &Asked| Some(format!("{:.0} µm: {}", asked_m * 1e6, found.as_ref().err()?));
    notes.extend(fits.iter().filter_map(failed));
    let figure = Figure {
        heading: "Table form and size against error".into(),
        rows: vec![vec![
            panel(&fits, "largest error of the contraction, µm", |e| e.contraction_max_m * 1e6),
            panel(&fits, "largest error of TR, %", |e| e.tr_max * 1e2),
        ]],
        panel_size: (560, 400),
        blocks: vec![
            Block::new(FORMS.iter().enumerate().map(line)),
            Block::new([
                KeyRow::mark(Shape::Dot, INK, "the smallest of its form that is accurate enough"),
                KeyRow::mark(Shape::Circle, INK, "none is: the most accurate one tried"),
                KeyRow::mark(Shape::Diamond, INK, "what the fit chooses"),
            ]),
        ],
        notes,
    };
    let finding = |(asked_m, found): &Asked| match found {
        Ok((fit, _)) => format!(
            "{:.0} µm: {FORM} in {} bytes, {:.2} µm certified",
            asked_m * 1e6,
            fit.table.numbers.bytes(),
            fit.error_bounds.errors.contraction_max_m * 1e6
        ),
        Err(e) => e.to_string(),
    };
    let header = "asked_m,form,size,load_map,bytes,contraction_error_m,tr_relative_error,predicted_instructions,\
         passes";
    let csv = below(header, fits.iter().flat_map(rows))?;
    Made::new(&figure, csv, fits.iter().map(finding).collect())
}

fn panel(fits: &[Asked], label: &str, error: impl Fn(&Errors) -> f64) -> Panel {
    let found = || fits.iter().filter_map(|(_, found)| found.as_ref().ok());
    let mut items = Vec::new();
    for (k, form) in FORMS.iter().enumerate() {
        let colour = colour(k, FORMS.len());
        let shape = |c: &Considered| if c.passes { Shape::Dot } else { Shape::Circle };
        let at = |c: &Considered| (error(&c.errors), c.bytes as f64);
        // The smallest that passes, or the most accurate one that failed.
        let order = |c: &&Considered| (!c.passes, if c.passes { c.bytes as f64 } else { c.errors.contraction_max_m });
        let best = found().filter_map(|(_, all)| {
            all.iter()
                .filter(|c| c.form == *form)
                .min_by(|a, b| order(a).partial_cmp(&order(b)).unwrap_or(Ordering::Equal))
        });
        let best: Vec<&Considered> = best.collect();
        items.push(Item::line(best.iter().filter(|c| c.passes).map(|c| at(c)), Pen::solid(colour)));
        items.extend(best.iter().map(|c| Item::mark(at(c), shape(c), colour)));
    }
    for (fit, _) in found() {
        let chosen = fit.candidates.iter().find(|c| c.table.numbers == fit.table.numbers);
        let at = chosen.map(|c| (error(&c.errors), c.table.numbers.bytes() as f64));
        items.extend(at.map(|at| Item::mark(at, Shape::Diamond, INK)));
    }
    let across = extent(items.iter().flat_map(Item::points).map(|p| p.0));
    let up = extent(items.iter().flat_map(Item::points).map(|p| p.1).chain([100.0, MAX_BYTES as f64]));
    Panel::new("", Axis::log(label, across), Axis::log("bytes of numbers", up), items)
}

/// A line for each table that was considered: the accuracy that was asked for, and the table where there is one.
fn rows((asked_m, found): &Asked) -> Vec<impl Serialize> {
    let asked_m = format!("{asked_m:.1e}");
    let Ok((_, all)) = found else {
        let none = <(String, String)>::default;
        return vec![(asked_m, "none", none(), None, none(), None, false)];
    };
    let row = |c: &Considered| {
        let map = c.load_map.map_or("Linear".into(), |map| format!("{map:?}"));
        let errors = (format!("{:.3e}", c.errors.contraction_max_m), format!("{:.3e}", c.errors.tr_max));
        (asked_m.clone(), c.form, (c.size.clone(), map), Some(c.bytes), errors, Some(c.instructions), c.passes)
    };
    all.iter().map(row).collect()
}
