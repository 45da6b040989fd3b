//! The commands, grouped by what one wants to do: for `--help` of both tools and for docs/reference/cli.md.

use clap::Command;
use std::fmt::Write;

/// A title and the commands below it.
pub type Group = (&'static str, &'static [&'static str]);

/// The commands of `rigctl`.
pub const GROUPS: [Group; 7] = [
    ("Begin", &["demo", "doctor", "monitor"]),
    ("Move", &["home", "move", "track", "jog", "stop", "hold", "clear"]),
    ("Read", &["status", "sensors"]),
    ("Set up and calibrate", &["config", "calibrate", "sweep", "response", "identify", "table", "selftest"]),
    ("Scripts and logs", &["play", "sim", "record", "replay", "export"]),
    ("Model", &["solve", "lookup", "published"]),
    ("Other programs", &["serve", "completions"]),
];

/// The first line of a command's help; empty for a command that is not there.
fn about(tool: &Command, name: &str) -> String {
    tool.find_subcommand(name).and_then(Command::get_about).map(ToString::to_string).unwrap_or_default()
}

/// The tool with its commands listed by groups, which clap cannot do by itself.
#[must_use]
pub fn grouped(tool: Command, groups: &[Group]) -> Command {
    let mut list = String::new();
    for (title, names) in groups {
        // Writing into a string does not fail.
        let _ = writeln!(list, "{title}:");
        for name in *names {
            let _ = writeln!(list, "  {name:<12} {}", about(&tool, name));
        }
        list.push('\n');
    }
    let usage = format!("{} [OPTIONS] <COMMAND>", tool.get_name());
    let template = format!("{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}{{all-args}}{{after-help}}");
    let names = groups.iter().flat_map(|(_, names)| *names);
    // Hidden in clap's own list only.
    let hidden = names.fold(tool, |tool, name| tool.mut_subcommand(name, |command| command.hide(true)));
    hidden.override_usage(usage).subcommand_help_heading("Help").help_template(template)
}

/// The commands as a table in Markdown.
#[must_use]
pub fn table(tool: &Command, groups: &[Group]) -> String {
    let mut table = format!("| | command of `{}` | what it does |\n|---|---|---|\n", tool.get_name());
    for (title, names) in groups {
        for (k, name) in names.iter().enumerate() {
            let title = if k == 0 { title } else { "" };
            let _ = writeln!(table, "| {title} | `{name}` | {} |", about(tool, name).replace('|', "\\|"));
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::{GROUPS, about, table};
    use clap::CommandFactory;

    #[test]
    fn every_command_is_in_one_group_and_its_help_fits_into_a_line() {
        let tool = crate::cli::Cli::command();
        let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        let mut known: Vec<&str> = tool.get_subcommands().map(clap::Command::get_name).collect();
        listed.sort_unstable();
        known.sort_unstable();
        assert_eq!(listed, known);
        for name in known {
            let about = about(&tool, name);
            assert!((10..=80).contains(&about.chars().count()), "{name}: {about}");
        }
    }

    #[test]
    fn the_page_about_commands_has_their_table() {
        let table = table(&crate::cli::Cli::command(), &GROUPS);
        assert!(
            include_str!("../../../docs/reference/cli.md").contains(&table),
            "docs/reference/cli.md lacks:\n{table}"
        );
    }
}
