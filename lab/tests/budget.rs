//! `budget` as a user runs it.

mod common;

use common::{lines as objects, root, tool};
use std::path::PathBuf;

/// The default scene with other lines in the place of its accuracy, in a file that is removed afterwards.
struct Changed(PathBuf);

impl Changed {
    fn new(name: &str, accuracy: &str) -> Self {
        let text = std::fs::read_to_string(root().join("scenes/default.toml")).unwrap();
        let numbers = "[accuracy]\ncontraction_m = 5e-6\ntr_relative = 2e-3\n";
        assert!(text.contains(numbers));
        let file = std::env::temp_dir().join(format!("rigctl-budget-{}-{name}.toml", std::process::id()));
        std::fs::write(&file, text.replace(numbers, accuracy)).unwrap();
        Self(file)
    }

    fn path(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for Changed {
    fn drop(&mut self) {
        // A file that is left in the temporary folder does no harm.
        let _ = std::fs::remove_file(&self.0);
    }
}

#[test]
fn every_part_is_an_object_with_its_three_keys() {
    let output = tool(&["--json", "budget", "--rig", "hard"]);
    let parts = objects(&output);
    let names: Vec<&str> = parts.iter().map(|p| p["part"].as_str().unwrap()).collect();
    assert_eq!(names, ["sensor", "friction", "memory", "law", "tier", "table", "loop"]);
    for part in &parts {
        assert_eq!(part.as_object().unwrap().len(), 3, "{part}");
        for key in ["position_m", "load_relative"] {
            assert!(part[key].as_f64().is_some_and(|x| x >= 0.0 && x.is_finite()), "{part}");
        }
    }
    let nominal = objects(&tool(&["--json", "budget"]));
    assert!(parts[1]["position_m"].as_f64() > nominal[1]["position_m"].as_f64(), "friction of a hard rig");
    let calibrated = objects(&tool(&["--json", "budget", "--gauge", "20um"]));
    assert!(calibrated[0]["position_m"].as_f64() < nominal[0]["position_m"].as_f64());
}

#[test]
fn the_accuracy_that_is_worth_having_gets_the_table_that_the_budget_names() {
    let text = String::from_utf8(tool(&["budget"]).stdout).unwrap();
    let words: Vec<&str> = text.lines().find(|l| l.starts_with("more than ")).unwrap().split_whitespace().collect();
    let number = |at: usize| words[at].parse::<f64>().unwrap();
    // more than 520 um of contraction and 10 % of TR buys nothing
    let accuracy = format!(
        "[accuracy]\ncontraction_m = {:e}\ntr_relative = {:e}\n",
        1e-6 * number(2),
        1e-2 * number(words.iter().position(|word| *word == "%").unwrap() - 1)
    );
    let scene = Changed::new("worth", &accuracy);
    let table = objects(&tool(&["--json", "--scene", scene.path(), "table"])).remove(0);
    let typed = objects(&tool(&["--json", "table"])).remove(0);
    let bytes = |table: &serde_json::Value| table["bytes"].as_u64().unwrap();
    assert!(text.contains(&format!("that takes {} bytes", bytes(&table))), "{text}");
    assert!(bytes(&table) < bytes(&typed));
    assert_ne!(table["scene_hash"], typed["scene_hash"]);
    for at in ["contraction", "tr"] {
        let [found, asked] = if at == "tr" {
            [&table["errors"]["tr_max_relative"], &table["accuracy"]["tr_relative"]]
        } else {
            [&table["errors"]["contraction_max_m"], &table["accuracy"]["contraction_m"]]
        };
        assert!(found.as_f64().unwrap() <= asked.as_f64().unwrap(), "{at}");
    }
}

#[test]
fn what_has_no_budget_is_refused_by_name() {
    let error = |args: &[&str]| {
        let output = tool(args);
        assert!(!output.status.success() && output.stdout.is_empty(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    for (args, named) in [
        (&["budget", "--rig", "good"][..], "good"),
        (&["budget", "--gauge", "5mm"], "gauge"),
        (&["--scene", "scenes/paper-printed.toml", "budget"], "[envelope]"),
    ] {
        assert!(error(args).contains(named), "{args:?}: {}", error(args));
    }
}
