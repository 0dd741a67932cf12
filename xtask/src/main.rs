//! The workspace's chores, as `cargo xtask …`: one local command equals CI.

mod boards;
mod build_fw;
mod chaos;
mod ci;
mod command;
mod examples;
mod flash;
mod setup;
mod size;
mod soak;
mod test;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Chores of the painleve workspace.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask")]
struct Xtask {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Debug, Subcommand)]
enum Chore {
    /// Install what the tests need and run every test.
    Test,
    /// Install the microcontroller's Rust target and QEMU.
    Setup,
    /// Build the controller's images for the microcontroller.
    BuildFw,
    /// Flash, RAM and stack of the images, with their limits.
    Size,
    /// Build the image for the STM32F405 and flash it with probe-rs.
    Flash,
    /// Build and run every example.
    Examples,
    /// Disturb plant and controller at every system call, and count what goes wrong.
    Chaos(chaos::ChaosArguments),
    /// A simulated day of lockstep operation with counters that wrap; not part of CI.
    Soak(soak::SoakArguments),
    /// What continuous integration does: formatting, clippy, every test.
    Ci,
}

fn main() -> ExitCode {
    let result = match Xtask::parse().chore {
        Chore::Test => test::run(),
        Chore::Setup => setup::run(),
        Chore::BuildFw => build_fw::run(),
        Chore::Size => size::run(),
        Chore::Flash => flash::run(),
        Chore::Examples => examples::run(),
        Chore::Soak(arguments) => soak::run(&arguments),
        Chore::Chaos(arguments) => chaos::run(&arguments),
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
