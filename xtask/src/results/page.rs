//! `docs/results.md` from the records.

use super::sections::SECTIONS;
use super::{Record, Records};
use std::fmt::Write as _;

/// The whole page.
pub(super) fn page(records: &Records) -> String {
    let mut text = String::from(
        "# Results\n\n\
         `cargo xtask results` measures everything on this page and writes it; `cargo xtask results NAME` measures one \
         section again.\n\
         **Nothing here has met hardware**: \"emulated\" means the firmware's own ELF on the emulated board and rig, or \
         its control code on the emulated rig.\n\
         Emulated numbers and instruction counts are the same on every machine; times are not.\n",
    );
    for section in SECTIONS {
        let Some(record) = records.get(section.name) else { continue };
        let Record { date, commit, machine, measured } = record;
        let _ = write!(
            text,
            "\n## {}\n\n{}\n\n`{}`, section `{}`, measured on {date} at commit {commit} ({machine}).\n\n",
            section.title, section.about, section.command, section.name
        );
        text += &table(&measured.table);
        for note in &measured.notes {
            let _ = write!(text, "\n{note}\n");
        }
        for (file, caption) in section.figures {
            let _ = write!(text, "\n![{caption}]({file})\n");
        }
    }
    text
}

/// A Markdown table of a head and rows.
pub(super) fn table(rows: &[Vec<String>]) -> String {
    let mut text = String::new();
    for (k, row) in rows.iter().enumerate() {
        let _ =
            writeln!(text, "| {} |", row.iter().map(|cell| cell.replace('|', "\\|")).collect::<Vec<_>>().join(" | "));
        if k == 0 {
            let _ = writeln!(text, "|{}", "---|".repeat(row.len()));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_rule_below_its_head_and_keeps_bars_apart() {
        let rows = [["a", "b|c"], ["1", "2"]].map(|row| row.map(str::to_owned).to_vec());
        assert_eq!(table(&rows), "| a | b\\|c |\n|---|---|\n| 1 | 2 |\n");
    }
}
