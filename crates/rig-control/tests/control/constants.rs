//! Every number of this crate has its kind and source in `constants.csv` (docs/explanation/control.md 7).

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

const KINDS: [&str; 5] = ["derived", "sheet", "limit", "tuned", "layout"];
/// Types of constants that are numbers.
const NUMBERS: [&str; 9] = ["f32", "u8", "u16", "u32", "u64", "i16", "i32", "i64", "usize"];
/// No more than these; a change that needs fewer lowers them.
const MOST: usize = 119;
const MOST_TUNED: usize = 24;

/// File and name of each constant that is a number, in a folder of sources and below, without those of tests.
fn declared(root: &Path, folder: &Path, found: &mut BTreeSet<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            if !path.ends_with("tests") {
                declared(root, &path, found);
            }
            continue;
        }
        let file = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
        let source = fs::read_to_string(&path).unwrap();
        for line in source.lines().take_while(|line| !line.starts_with("#[cfg(test)]")) {
            let Some((_, declaration)) = line.split_once("const ").filter(|(before, _)| !before.contains("//")) else {
                continue;
            };
            let Some((name, rest)) = declaration.split_once(": ") else { continue };
            let type_ = rest.split(['=', ';']).next().unwrap().trim().trim_start_matches('[');
            if !line.starts_with(' ') && NUMBERS.contains(&type_) {
                found.insert((file.clone(), name.to_owned()));
            }
        }
    }
}

#[test]
fn every_number_has_a_kind_and_a_source_and_there_are_no_more_than_there_were() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut declared_in_code = BTreeSet::new();
    declared(&root.join("src"), &root.join("src"), &mut declared_in_code);
    let table = fs::read_to_string(root.join("constants.csv")).unwrap();
    let (mut listed, mut tuned) = (BTreeSet::new(), 0);
    for line in table.lines().skip(1) {
        let [file, name, kind, source] = line.splitn(4, ',').collect::<Vec<_>>()[..] else { panic!("{line}") };
        assert!(KINDS.contains(&kind) && (kind == "layout" || !source.is_empty()), "{line}");
        assert!(listed.insert((file.to_owned(), name.to_owned())), "twice: {line}");
        tuned += usize::from(kind == "tuned");
    }
    let difference: Vec<_> = listed.symmetric_difference(&declared_in_code).collect();
    assert!(difference.is_empty(), "in the code or in constants.csv alone: {difference:?}");
    assert!(listed.len() <= MOST && tuned <= MOST_TUNED, "{} constants, {tuned} tuned", listed.len());
}
