//! `painleve completions` and `painleve man`: shell completions and manual pages.

use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;
use serde_json::json;

use super::json::JsonOption;
use super::output_error::{OutputError, output};
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
    let refuse = |source| {
        output(OutputError::Folder {
            folder: folder.clone(),
            source,
        })
    };
    std::fs::create_dir_all(folder).map_err(refuse)?;
    clap_mangen::generate_to(Cli::command(), folder).map_err(refuse)?;
    let first = folder.join("painleve.1");
    let result = json!({ "folder": folder, "first": first });
    arguments.json.say(
        &result,
        format_args!(
            "{}: the manual's first page; the others are beside it",
            first.display()
        ),
    )
}
