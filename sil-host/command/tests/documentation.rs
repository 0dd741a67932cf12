//! Checks that the program accepts the command lines in the README and in `docs/`.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use clap::Parser;
use clap::error::ErrorKind;
use painleve_command::Cli;

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
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut pages = vec![workspace.join("README.md")];
    for entry in fs::read_dir(workspace.join("docs")).unwrap() {
        pages.push(entry.unwrap().path());
    }
    pages.retain(|page| page.extension().is_some_and(|it| it == "md"));
    let (mut checked, mut refused) = (0, Vec::new());
    for page in pages {
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
