//! `painleve completions` and `painleve man`: shell completions and manual pages.

use std::path::{Path, PathBuf};

use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use painleve_files::atomic_file::{AtomicFile, commit_all, prepare};
use serde_json::json;

use super::json::JsonOption;
use super::output_error::output;
use super::{Cli, CommandError};

/// Options of `painleve completions`.
#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell.
    shell: Shell,
}

/// Options of `painleve man`.
#[derive(Debug, Args)]
pub struct ManArguments {
    /// Folder for the pages, as in ~/.local/share/man/man1.
    folder: PathBuf,
    #[command(flatten)]
    json: JsonOption,
}

/// Prints a completion script.
///
/// # Errors
/// [`CommandError::Output`] if the standard output cannot be written.
pub fn print(arguments: &CompletionsArguments) -> Result<(), CommandError> {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut Cli::command(),
        "painleve",
        &mut script,
    );
    super::say(String::from_utf8_lossy(&script).trim_end())
}

/// Writes `painleve.1` and one page for each subcommand.
///
/// # Errors
/// [`CommandError::Output`] if a page cannot be written.
pub fn write_manual(arguments: &ManArguments) -> Result<(), CommandError> {
    let folder = &arguments.folder;
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let mut files = Vec::new();
    prepare_pages(&command, folder, &mut files)?;
    commit_all(files).map_err(output)?;
    let first = folder.join("painleve.1");
    let result = json!({
        "folder": folder.display().to_string(),
        "first": first.display().to_string(),
    });
    arguments.json.say(
        &result,
        format_args!(
            "{}: the manual's first page; the others are beside it",
            first.display()
        ),
    )
}

/// Prepares the page of a command and those of its subcommands.
fn prepare_pages(
    command: &Command,
    folder: &Path,
    files: &mut Vec<AtomicFile>,
) -> Result<(), CommandError> {
    let visible = command.get_subcommands().filter(|it| !it.is_hide_set());
    for subcommand in visible {
        prepare_pages(subcommand, folder, files)?;
    }
    let page = Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text).map_err(output)?;
    files.push(prepare(folder.join(page.get_filename()), &text).map_err(output)?);
    Ok(())
}
