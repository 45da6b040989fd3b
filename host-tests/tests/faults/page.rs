//! `docs/reference/faults.md` says what the code does, and `tested.md` where each fault is tested.

use rig_control::supervisor::fault_policy::{After, POLICY, Policy, Response};
use rig_link::messages::{Doubt, Fault, HomingFailure, Limit};

/// The page for the person at the bench says of every fault what the code does about it.
#[test]
fn every_fault_is_documented_and_the_table_is_what_the_code_does() {
    let page = std::fs::read_to_string(host_tests::root().join("docs/reference/faults.md")).unwrap();
    let mut last = 0;
    for Policy { fault, response, after, .. } in POLICY {
        let told = match response {
            Response::Hold => "hold",
            Response::HoldByDrive => "hold by drive",
            Response::HoldIfHeard => "hold, if it hears",
            Response::LetGo => "torque off",
            Response::Wait => "nothing",
        };
        let after = match after {
            After::Nothing => "go on",
            After::Home => "`home`",
            After::Restart => "the drive restarts; `home`",
            After::Never => "cannot be cleared",
        };
        let row = format!("| `{fault}` | {} | {told} | {after} |", fault.code());
        let at = page.find(&row).unwrap_or_else(|| panic!("docs/reference/faults.md lacks the row {row}"));
        assert!(last < at, "docs/reference/faults.md has {fault} before a more severe fault");
        last = at;
        let entry = page.split("\n### ").find(|e| e.starts_with(&format!("`{fault}`\n")));
        let entry = entry.unwrap_or_else(|| panic!("docs/reference/faults.md has no entry for {fault}"));
        for part in ["- **Means** ", "- **The rig** ", "- **Check** ", "- **Clear** "] {
            let text = entry.lines().find_map(|line| line.strip_prefix(part));
            assert!(text.is_some_and(|text| text.len() > 10), "{fault}: `{part}` is missing");
        }
    }
    let named = |line: &str| line.strip_prefix("### `").and_then(|rest| rest.strip_suffix('`')).map(String::from);
    for name in page.lines().filter_map(named) {
        assert!(Fault::from_name(&name).is_some(), "docs/reference/faults.md explains {name}, which is no fault");
    }
    for failure in HomingFailure::ALL {
        assert!(
            page.contains(&format!("| `{failure}` |")),
            "docs/reference/faults.md lacks the failed homing {failure}"
        );
    }
    for name in Limit::ALL.iter().map(|l| l.name()).chain(Doubt::ALL.iter().map(|d| d.name())) {
        assert!(page.contains(&format!("\n| `{name}` | ")), "docs/reference/faults.md lacks the limit or doubt {name}");
    }
}

/// A function or constant of a source file, from its name to its end.
fn item<'a>(source: &'a str, name: &str) -> Option<&'a str> {
    let start = [format!("\nfn {name}("), format!("\npub const {name}: ")].iter().find_map(|head| source.find(head))?;
    let end = ["\n}\n", "\n];\n"].iter().filter_map(|end| source[start..].find(end)).min()?;
    Some(&source[start..start + end])
}

/// Whether a cell of the table of tests names something that plays or tests the fault, or says why nothing can.
fn is_tested(cell: &str, fault: Fault, fires: bool) -> bool {
    let read = |path: &str| std::fs::read_to_string(host_tests::root().join(path)).unwrap_or_default();
    if let Some(reason) = cell.strip_prefix("not possible: ") {
        return reason.len() > 10;
    }
    let Some(named) = cell.strip_prefix('`').and_then(|rest| rest.split('`').next()) else { return false };
    if let Some((file, name)) = named.split_once("::") {
        // Of rig-control where it says so, else of host-tests.
        let source = match file.strip_prefix("rig-control/") {
            Some(file) => read(&format!("crates/rig-control/tests/control/{file}.rs")),
            None => read(&format!("host-tests/tests/{file}.rs")),
        };
        return item(&source, name).is_some_and(|body| body.contains(&format!("Fault::{fault:?}")));
    }
    let tests = read("crates/rigctl/tests/tool/faults.rs");
    let played = |body: &str| body.contains(&format!("play(\"{named}\")"));
    // What fires stands in the list of the test that plays the script; what is near may be near in several ways.
    tests.split("\n#[test]\n").any(|body| played(body) && (!fires || body.contains(&format!(", \"{fault}\")"))))
}

#[test]
fn the_page_says_of_every_fault_where_it_is_tested() {
    let table = std::fs::read_to_string(host_tests::root().join("host-tests/tests/faults/tested.md")).unwrap();
    for &fault in Fault::ALL {
        let row = table.lines().find_map(|line| line.strip_prefix(&format!("| `{fault}` | ")));
        let row = row.unwrap_or_else(|| panic!("{fault} has no row"));
        let cells: Vec<&str> = row.trim_end_matches(" |").split(" | ").collect();
        assert_eq!(cells.len(), 3, "{fault}: {row}");
        for (k, cell) in cells.into_iter().enumerate() {
            assert!(is_tested(cell, fault, k < 2), "{fault}: {cell}");
        }
    }
    assert!(!is_tested("`faults-homed`", Fault::NotFinite, true) && !is_tested("", Fault::NotFinite, false));
}
