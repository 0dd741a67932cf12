//! The workspace's chores, as `cargo xtask …`: one local command equals CI.

mod ci;
mod command;
mod test;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Chores of the painleve workspace.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Debug, Subcommand)]
enum Chore {
    /// Install what the tests need and run every test.
    Test,
    /// What continuous integration does: formatting, clippy, every test.
    Ci,
}

fn main() -> ExitCode {
    let result = match Cli::parse().chore {
        Chore::Test => test::run(),
        Chore::Ci => ci::run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
