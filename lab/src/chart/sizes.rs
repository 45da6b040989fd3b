//! How many bytes a table needs for an accuracy, form by form.

use super::{Inputs, Made};
use anyhow::Result;
use rig_config::{Accuracy, Scene, TableError};
use rigctl::csv_text::csv_text;
use rigctl::parallel::parallel;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour, extent};
use rival_forms::fit::{Considered, considered};
use tsa_table::FORM;
use tsa_table::fit::{Errors, Fit, FitError, MAX_BYTES};
use tsa_table::instruction_model::LOOKUP_INSTRUCTIONS;

/// Demanded accuracies (m); the error of TR keeps its ratio to that of the scene.
const ASKED_M: [f64; 7] = [200e-6, 100e-6, 50e-6, 20e-6, 10e-6, 5e-6, 2e-6];

/// In the order of the key.
const FORMS: [&str; 4] = ["arc-series", "chebyshev-series", "hermite-bicubic", "bilinear"];

/// The fits of one scene, each with what was asked of it.
struct Asked {
    contraction_m: f64,
    fit: Result<Found, TableError>,
}

/// A fit and the tables of all forms that were considered.
struct Found {
    fit: Fit,
    all: Vec<Considered>,
}

fn find(scene: &Scene) -> Result<Found, TableError> {
    let fit = scene.fit_table()?;
    let all = considered(&scene.mechanism()?, &scene.demand()?, &fit)?;
    Ok(Found { fit, all })
}

/// Fits the scene's table at several accuracies and draws bytes against error.
///
/// # Errors
/// If the scene says nothing of a table, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let scene = inputs.scene;
    let (_, accuracy) = scene.table_demand()?;
    let share = accuracy.tr_relative / accuracy.contraction_m;
    let asked = parallel(inputs.progress, ASKED_M.len(), |k| {
        let wanted = Accuracy { contraction_m: ASKED_M[k], tr_relative: share * ASKED_M[k] };
        let scene = Scene { accuracy: Some(wanted), ..scene.clone() };
        Asked { contraction_m: ASKED_M[k], fit: find(&scene) }
    });
    // Anything but an accuracy out of reach is the scene's fault.
    let mut fits = Vec::new();
    for one in asked {
        match one.fit {
            Err(e @ TableError::Fit(FitError::Accuracy { .. })) => fits.push(Asked { fit: Err(e), ..one }),
            Err(e) => return Err(e.into()),
            Ok(_) => fits.push(one),
        }
    }
    let figure = Figure {
        heading: "Table form and size against error".into(),
        rows: vec![vec![
            panel(&fits, "largest error of the contraction, um", |e| e.contraction_max_m * 1e6),
            panel(&fits, "largest error of TR, %", |e| e.tr_max * 1e2),
        ]],
        panel_size: (560, 400),
        blocks: key(),
        notes: notes(&fits),
    };
    Ok(Made {
        name: "table-size",
        svg: Some(figure.svg()?),
        csv: csv(&fits)?,
        findings: findings(&fits),
        left_out: Vec::new(),
    })
}

/// The smallest passing candidate of a form, or the best that failed.
fn best<'a>(found: &'a Found, form: &str) -> Option<&'a Considered> {
    let of_form = || found.all.iter().filter(|c| c.form == form);
    let passing = of_form().filter(|c| c.passes).min_by_key(|c| c.bytes);
    passing.or_else(|| of_form().min_by(|a, b| a.errors.contraction_max_m.total_cmp(&b.errors.contraction_max_m)))
}

fn panel(fits: &[Asked], label: &str, error: impl Fn(&Errors) -> f64) -> Panel {
    let mut items = Vec::new();
    for (k, form) in FORMS.iter().enumerate() {
        let colour = colour(k, FORMS.len());
        let found: Vec<&Considered> = fits.iter().filter_map(|f| best(f.fit.as_ref().ok()?, form)).collect();
        let at = |c: &Considered| (error(&c.errors), c.bytes as f64);
        let points = found.iter().filter(|c| c.passes).map(|c| at(c)).collect();
        items.push(Item::Line { points, pen: Pen::solid(colour) });
        let shape = |c: &Considered| if c.passes { Shape::Dot } else { Shape::Circle };
        items.extend(found.iter().map(|c| Item::Mark { at: at(c), shape: shape(c), colour }));
    }
    for Found { fit, .. } in fits.iter().filter_map(|f| f.fit.as_ref().ok()) {
        let chosen = fit.candidates.iter().find(|c| c.table.numbers == fit.table.numbers);
        let at = chosen.map(|c| (error(&c.errors), c.table.numbers.bytes() as f64));
        items.extend(at.map(|at| Item::Mark { at, shape: Shape::Diamond, colour: INK }));
    }
    let across = extent(items.iter().flat_map(Item::points).map(|p| p.0));
    let up = extent(items.iter().flat_map(Item::points).map(|p| p.1).chain([100.0, MAX_BYTES as f64]));
    Panel { title: String::new(), x: Axis::log(label, across), y: Axis::log("bytes of numbers", up), items }
}

fn key() -> Vec<Block> {
    let line = |(k, form): (usize, &&str)| KeyRow::sample(Sample::Line(Pen::solid(colour(k, FORMS.len()))), *form);
    let mark = |shape, name: &str| KeyRow::sample(Sample::Mark(shape, INK), name);
    vec![
        Block { rows: FORMS.iter().enumerate().map(line).collect() },
        Block {
            rows: vec![
                mark(Shape::Dot, "the smallest of its form that is accurate enough"),
                mark(Shape::Circle, "none is: the most accurate one tried"),
                mark(Shape::Diamond, "what the fit chooses"),
            ],
        },
    ]
}

fn notes(fits: &[Asked]) -> Vec<String> {
    let asked: Vec<String> = fits.iter().map(|f| format!("{:.0}", f.contraction_m * 1e6)).collect();
    let mut notes = vec![format!(
        "Asked for {} um of contraction, TR in proportion as in the scene; at most {MAX_BYTES} bytes. Of equal accuracy the fit prefers \
         what the board looks up in {LOOKUP_INSTRUCTIONS} instructions. Errors against the \
         full solver on the grid by which candidates are selected.",
        asked.join(", ")
    )];
    for f in fits {
        if let Err(e) = &f.fit {
            notes.push(format!("{:.0} um: {e}", f.contraction_m * 1e6));
        }
    }
    notes
}

fn csv(fits: &[Asked]) -> Result<String> {
    let mut lines = Vec::new();
    for f in fits {
        let Ok(Found { all, .. }) = &f.fit else {
            let cells = [format!("{:.1e}", f.contraction_m), "none".into()];
            lines.push(cells.into_iter().chain((0..6).map(|_| String::new())).chain(["false".into()]).collect());
            continue;
        };
        for c in all {
            lines.push(vec![
                format!("{:.1e}", f.contraction_m),
                c.form.into(),
                c.size.clone(),
                c.load_map.map_or("Linear".into(), |map| format!("{map:?}")),
                c.bytes.to_string(),
                format!("{:.3e}", c.errors.contraction_max_m),
                format!("{:.3e}", c.errors.tr_max),
                c.instructions.to_string(),
                c.passes.to_string(),
            ]);
        }
    }
    let header = [
        "asked_m",
        "form",
        "size",
        "load_map",
        "bytes",
        "contraction_error_m",
        "tr_relative_error",
        "predicted_instructions",
        "passes",
    ];
    csv_text(&header, lines)
}

fn findings(fits: &[Asked]) -> Vec<String> {
    let line = |f: &Asked| match &f.fit {
        Ok(Found { fit, .. }) => format!(
            "{:.0} um: {FORM} in {} bytes, {:.2} um certified",
            f.contraction_m * 1e6,
            fit.table.numbers.bytes(),
            fit.certificate.errors.contraction_max_m * 1e6
        ),
        Err(e) => e.to_string(),
    };
    fits.iter().map(line).collect()
}
