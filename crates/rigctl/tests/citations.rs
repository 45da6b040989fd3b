//! What code and pages cite stands in this repository: the page exists, and so does the section.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// A page that a line names, and the numbers of the sections that follow the name.
#[derive(Debug, PartialEq)]
struct Citation {
    line: usize,
    page: String,
    sections: Vec<String>,
}

const ENDING: &str = ".md";

/// Every page named in a text. A name that ends its line has its section at the start of the next one.
fn citations(text: &str) -> Vec<Citation> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (index, line) in lines.iter().enumerate() {
        for (at, _) in line.match_indices(ENDING) {
            let in_a_name = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
            let start = line[..at]
                .rfind(|c| !in_a_name(c))
                .map_or(0, |before| before + line[before..].chars().next().map_or(1, char::len_utf8));
            let rest = &line[at + ENDING.len()..];
            // A longer word, or a name that a program puts together.
            if start == at || rest.starts_with(|c: char| c.is_ascii_alphanumeric()) {
                continue;
            }
            let rest = rest.trim_start_matches(['`', ')', '"']);
            let rest = match lines.get(index + 1) {
                Some(next) if rest.trim().is_empty() => {
                    format!(" {}", next.trim_start_matches([' ', '/', '!', '#', '*']))
                }
                _ => rest.to_owned(),
            };
            found.push(Citation {
                line: index + 1,
                page: line[start..at + ENDING.len()].to_owned(),
                sections: sections(&rest),
            });
        }
    }
    found
}

/// The numbers at the start of a text: ` 2.6`, ` section 6`, ` sections 2.2, 2.4 and 6`.
fn sections(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let Some(mut rest) = text.strip_prefix(' ') else { return found };
    for word in ["sections ", "section "] {
        rest = rest.strip_prefix(word).unwrap_or(rest);
    }
    loop {
        let end = rest.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(rest.len());
        let number = rest[..end].trim_end_matches('.');
        // A number with a unit or a word behind it is no section.
        if number.is_empty() || rest[end..].starts_with(|c: char| c.is_alphanumeric()) {
            return found;
        }
        found.push(number.to_owned());
        let after = &rest[number.len()..];
        match [", ", " and ", " to "].iter().find_map(|joint| after.strip_prefix(joint)) {
            Some(more) => rest = more,
            None => return found,
        }
    }
}

/// Whether a page has a heading with this number.
fn has_section(page: &str, number: &str) -> bool {
    page.lines().filter_map(|line| line.strip_prefix('#')).any(|heading| {
        heading
            .trim_start_matches('#')
            .split_whitespace()
            .next()
            .is_some_and(|first| first.trim_end_matches('.') == number)
    })
}

/// What is wrong with the citations of a text; `file` is for the message.
fn wrong(file: &str, text: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    for Citation { line, page, sections } in citations(text) {
        let places = [root().join("docs").join(&page), root().join(&page)];
        let Some(text) = places.iter().find_map(|place| std::fs::read_to_string(place).ok()) else {
            wrong.push(format!("{file}:{line}: {page} is neither in docs/ nor at the root"));
            continue;
        };
        for number in sections.iter().filter(|number| !has_section(&text, number)) {
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
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') {
                files(&path, found);
            }
        } else if ending == "rs" || ending == "toml" || ending == "md" && (folder == root() || folder.ends_with("docs"))
        {
            found.push(path);
        }
    }
}

#[test]
fn every_cited_section_exists() {
    let mut paths = Vec::new();
    files(&root(), &mut paths);
    paths.sort();
    let (mut cited, mut problems) = (0, Vec::new());
    for path in paths {
        let name = path.strip_prefix(root()).unwrap().display().to_string();
        // The fuzzers' corpus may hold anything.
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        cited += citations(&text).iter().map(|c| c.sections.len()).sum::<usize>();
        problems.extend(wrong(&name, &text));
    }
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
    // A walk that finds nothing proves nothing.
    assert!(cited > 50, "{cited} sections cited");
}

#[test]
fn citations_are_read_as_people_write_them() {
    let read = |text: &str| {
        // Put together here, so that the other test does not read these lines as citations.
        citations(&text.replace("PAGE", &format!("page{ENDING}")))
            .into_iter()
            .map(|c| (c.line, c.sections))
            .collect::<Vec<_>>()
    };
    let sections = |numbers: &[&str]| numbers.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
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
        assert_eq!(read(text), [(1, sections(numbers))], "{text}");
    }
    assert_eq!(read(&format!("*{ENDING} {{}}{ENDING} PAGEx")), []);
    assert_eq!(read("one\nPAGE 1, PAGE 2"), [(2, sections(&["1"])), (2, sections(&["2"]))]);
}

#[test]
fn what_does_not_exist_is_named_with_file_and_line() {
    let named = |page: &str| format!("nothing\n// {page}{ENDING} 0.5 and 99");
    assert_eq!(
        wrong("a.rs", &named("nowhere")),
        [format!("a.rs:2: nowhere{ENDING} is neither in docs/ nor at the root")]
    );
    let expected = ["0.5", "99"].map(|number| format!("a.rs:2: faults{ENDING} has no section {number}"));
    assert_eq!(wrong("a.rs", &named("faults")), expected);
    assert!(has_section("text\n### 2.6 Name\n", "2.6") && !has_section("### 2.61 Name\n2.6\n", "2.6"));
}
