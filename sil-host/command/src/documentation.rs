//! Checks that the program accepts the command lines and the scenarios in the README and in `docs/`.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;
use clap::error::ErrorKind;
use painleve_plant::scenario::Scenario;

use crate::Cli;

/// Returns the README and the pages of the documentation.
fn pages() -> Vec<PathBuf> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut pages = vec![workspace.join("README.md")];
    for entry in fs::read_dir(workspace.join("docs")).unwrap() {
        pages.push(entry.unwrap().path());
    }
    pages.retain(|page| page.extension().is_some_and(|it| it == "md"));
    pages
}

/// Returns the `painleve` command lines of a page, from code blocks and inline code.
fn commands(text: &str) -> Vec<String> {
    let mut commands = Vec::new();
    for (number, part) in text.split("```").enumerate() {
        let pieces: Vec<&str> = if number % 2 == 1 {
            part.lines().collect()
        } else {
            part.split('`').skip(1).step_by(2).collect()
        };
        for piece in pieces {
            let line = piece.split(" #").next().unwrap_or_default();
            for command in line.split(" && ") {
                // The shell redirects the output after `>` and removes quotes.
                let command = command.split(" > ").next().unwrap_or_default();
                let words: Vec<String> = command
                    .split_whitespace()
                    .map(|word| word.replace(['"', '\''], ""))
                    .collect();
                if words.len() > 1 && words[0] == "painleve" {
                    commands.push(words.join(" "));
                }
            }
        }
    }
    commands
}

/// Returns whether a command line contains an ellipsis or a placeholder in capitals.
fn is_pattern(command: &str) -> bool {
    command.contains('…')
        || command
            .split(|c: char| !c.is_ascii_alphanumeric())
            .any(|word| word.len() > 1 && word.chars().all(|c| c.is_ascii_uppercase()))
}

#[test]
fn documented_command_lines_are_accepted() {
    let (mut checked, mut refused) = (0, Vec::new());
    for page in pages() {
        for command in commands(&fs::read_to_string(&page).unwrap()) {
            if is_pattern(&command) {
                continue;
            }
            checked += 1;
            let Err(error) = Cli::try_parse_from(command.split(' ')) else {
                continue;
            };
            // Inline code may name a command without its arguments.
            if !matches!(
                error.kind(),
                ErrorKind::MissingRequiredArgument
                    | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
            ) {
                refused.push(format!("{}: {command}: {error}", page.display()));
            }
        }
    }
    assert!(checked > 40, "only {checked} command lines found");
    assert!(refused.is_empty(), "{refused:#?}");
}

/// Returns the parts of scenarios on a page: its TOML, but for campaigns and the manifests of crates.
fn scenarios(text: &str) -> impl Iterator<Item = &str> {
    let blocks = text.split("```toml\n").skip(1);
    let blocks = blocks.filter_map(|it| it.split("```").next());
    blocks.filter(|it| {
        !["study =", "[dependencies]"]
            .iter()
            .any(|head| it.starts_with(head))
    })
}

#[test]
fn documented_scenarios_are_accepted() {
    let mut checked = 0;
    for page in pages() {
        for text in scenarios(&fs::read_to_string(&page).unwrap()) {
            if let Err(error) = Scenario::from_toml(text) {
                panic!("{}: {error}:\n{text}", page.display());
            }
            checked += 1;
        }
    }
    assert!(checked >= 5, "only {checked} scenarios found");
}
