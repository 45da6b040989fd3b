//! `budget` as a user runs it.

mod common;

use common::{error_of, lines as objects, root, tool};

#[test]
fn every_part_is_an_object_with_its_three_keys() {
    let parts = objects(&tool(&["--json", "budget", "--rig", "hard"]));
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
    // more than 520 um of contraction and 10 % of TR buys nothing
    let words: Vec<&str> = text.lines().find(|l| l.starts_with("more than ")).unwrap().split_whitespace().collect();
    let [contraction_um, tr_percent] = [2, 7].map(|at| words[at].parse::<f64>().unwrap());
    let default = std::fs::read_to_string(root().join("scenes/default.toml")).unwrap();
    let (typed, worth) = (
        "contraction_m = 5e-6\ntr_relative = 2e-3\n",
        format!("contraction_m = {:e}\ntr_relative = {:e}\n", 1e-6 * contraction_um, 1e-2 * tr_percent),
    );
    assert!(default.contains(typed));
    let file = std::env::temp_dir().join(format!("tsa-lab-budget-{}.toml", std::process::id()));
    std::fs::write(&file, default.replace(typed, &worth)).unwrap();
    let table = objects(&tool(&["--json", "--scene", file.to_str().unwrap(), "table"])).remove(0);
    std::fs::remove_file(file).unwrap();
    let typed = objects(&tool(&["--json", "table"])).remove(0);
    let bytes = |table: &serde_json::Value| table["bytes"].as_u64().unwrap();
    assert!(text.contains(&format!("that takes {} bytes", bytes(&table))), "{text}");
    assert!(bytes(&table) < bytes(&typed));
    assert_ne!(table["scene_hash"], typed["scene_hash"]);
    for (found, asked) in [("contraction_max_m", "contraction_m"), ("tr_max_relative", "tr_relative")] {
        assert!(table["errors"][found].as_f64().unwrap() <= table["accuracy"][asked].as_f64().unwrap(), "{found}");
    }
}

/// Of every scene in the folder that has an envelope, on each kind of rig.
#[test]
fn all_budgets_of_a_folder_have_the_table_that_is_enough() {
    let folder = std::env::temp_dir().join(format!("tsa-lab-budgets-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for scene in ["finger.toml", "paper-printed.toml"] {
        std::fs::copy(root().join("scenes").join(scene), folder.join(scene)).unwrap();
    }
    let budgets =
        objects(&tool(&["--json", "--scene", folder.join("finger.toml").to_str().unwrap(), "budget", "--all"]));
    std::fs::remove_dir_all(folder).unwrap();
    let rigs: Vec<&str> = budgets.iter().map(|b| b["rig"].as_str().unwrap()).collect();
    assert_eq!(rigs, ["ideal", "nominal", "hard"]);
    for b in &budgets {
        assert!(b["scene"] == "finger" && b["position_m"].as_f64() > Some(0.0) && b["tier"].is_string(), "{b}");
        let (enough, used) = (&b["enough"], &b["used"]["table"]["bytes"]);
        assert!(enough["table"].is_null() || enough["table"]["bytes"].as_u64() > Some(0), "{b}");
        assert!(enough["contraction_m"].is_f64() && used.as_u64() > Some(0), "{b}");
    }
}

#[test]
fn what_has_no_budget_is_refused_by_name() {
    for (args, named) in [
        (&["budget", "--rig", "good"][..], "good"),
        (&["budget", "--gauge", "5mm"], "gauge"),
        (&["--scene", "scenes/paper-printed.toml", "budget"], "[envelope]"),
    ] {
        let output = tool(args);
        assert!(!output.status.success() && output.stdout.is_empty(), "{output:?}");
        assert!(error_of(&output).contains(named), "{args:?}: {}", error_of(&output));
    }
}
