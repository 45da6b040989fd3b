//! What code and pages cite stands in this repository: the page exists, and so does the section.

use crate::common::root;
use std::path::{Path, PathBuf};

const ENDING: &str = ".md";

/// Every page named in a text: its line, its name, and the numbers of the sections that follow the name, if need be on the next
/// line: `2.6`, `section 6`, `sections 2.2, 2.4 and 6`.
fn citations(text: &str) -> Vec<(usize, String, Vec<String>)> {
    let lines = (1..).zip(text.lines());
    let words: Vec<(usize, &str)> = lines
        .flat_map(|(line, text)| {
            let text = text.trim_start_matches([' ', '/', '!', '#', '*']);
            text.split_whitespace().map(move |word| (line, word))
        })
        .collect();
    let mut found = Vec::new();
    for (at, (line, word)) in words.iter().enumerate() {
        for (end, _) in word.match_indices(ENDING) {
            let in_a_name = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
            let name = &word[word[..end].rfind(|c| !in_a_name(c)).map_or(0, |k| k + 1)..end];
            let rest = &word[end + ENDING.len()..];
            // A longer word, or a name that a program puts together.
            if name.is_empty() || rest.starts_with(|c: char| c.is_ascii_alphanumeric()) {
                continue;
            }
            let follow = words[at + 1..].iter().map(|(_, word)| *word).skip_while(|word| word.starts_with("section"));
            let sections = if rest.trim_matches(['`', ')', '"']).is_empty() { numbers(follow) } else { Vec::new() };
            found.push((*line, format!("{name}{ENDING}"), sections));
        }
    }
    found
}

/// The numbers that words begin with. One with a unit at its end is no section.
fn numbers<'a>(mut words: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut found = Vec::new();
    while let Some(word) = words.next() {
        let number = word.trim_end_matches([',', '.', ';', ':', ')', '"', '`', '?']);
        if number.is_empty() || !number.chars().all(|c| c.is_ascii_digit() || c == '.') {
            break;
        }
        found.push(number.to_owned());
        let more =
            word.ends_with(',') || word == number && words.next().is_some_and(|word| word == "and" || word == "to");
        if !more {
            break;
        }
    }
    found
}

/// What is wrong with the citations of a text; `file` is for the message.
fn wrong(file: &str, text: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    for (line, page, sections) in citations(text) {
        let beside = root().join(file).with_file_name(&page);
        let places = [root().join("docs").join(&page), root().join(&page), beside];
        let Some(text) = places.iter().find_map(|place| std::fs::read_to_string(place).ok()) else {
            wrong.push(format!("{file}:{line}: {page} is neither in docs/ nor at the root nor beside the file"));
            continue;
        };
        let headings = text.lines().filter(|line| line.starts_with('#'));
        let headed: Vec<&str> = headings.filter_map(|line| line.split_whitespace().nth(1)).collect();
        for number in
            sections.iter().filter(|number| !headed.iter().any(|first| first.trim_end_matches('.') == **number))
        {
            wrong.push(format!("{file}:{line}: {page} has no section {number}"));
        }
    }
    wrong
}

/// Sources, manifests and scenes of the repository, and its pages.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let ending = path.extension().unwrap_or_default();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            files(&path, found);
        } else if ending == "rs"
            || ending == "toml"
            || ending == "md" && (folder == root() || folder.starts_with(root().join("docs")))
        {
            found.push(path);
        }
    }
}

#[test]
fn every_cited_section_exists() {
    let mut paths = Vec::new();
    files(&root(), &mut paths);
    let (mut cited, mut problems) = (0, Vec::new());
    for path in paths {
        // The fuzzers' corpus may hold anything.
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        cited += citations(&text).iter().map(|(.., sections)| sections.len()).sum::<usize>();
        problems.extend(wrong(&path.display().to_string(), &text));
    }
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
    // A walk that finds nothing proves nothing.
    assert!(cited > 50, "{cited} sections cited");
}

#[test]
fn citations_are_read_as_people_write_them_and_named_where_they_are_wrong() {
    // Put together here, so that the other test does not read these lines as citations.
    let page = format!("reference/faults{ENDING}");
    for (text, numbers) in [
        ("// at least 500 ms (PAGE 2.5).", &["2.5"][..]),
        ("/// PAGE section 8; the table", &["8"]),
        ("//! PAGE sections 6 and 8) and", &["6", "8"]),
        ("//! (PAGE 2.2 and 2.4, functions 0xB)", &["2.2", "2.4"]),
        ("see [a page](PAGE) 10.", &["10"]),
        ("// PAGE section 6: 26 numbers", &["6"]),
        ("//! Facts from `PAGE`\n//! 7.1 and elsewhere", &["7.1"]),
        ("// PAGE, 3 mm", &[]),
        ("// PAGE 3mm", &[]),
        ("// docs/PAGE lacks a row", &[]),
    ] {
        let found = citations(&text.replace("PAGE", &page));
        assert!(found.len() == 1 && found[0].0 == 1 && found[0].2 == numbers, "{text}: {found:?}");
    }
    assert!(citations(&format!("*{ENDING} {{}}{ENDING} {page}x")).is_empty());
    let expected = ["0.5", "99"].map(|number| format!("a.rs:2: {page} has no section {number}"));
    assert_eq!(wrong("a.rs", &format!("nothing\n// {page} 0.5 and 99")), expected);
    let nowhere = format!("nowhere{ENDING}");
    let expected = [format!("a.rs:1: {nowhere} is neither in docs/ nor at the root nor beside the file")];
    assert_eq!(wrong("a.rs", &format!("{nowhere} 1")), expected);
}
