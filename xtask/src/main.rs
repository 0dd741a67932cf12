//! Chores of the workspace, as `cargo xtask …`.

mod bench;
mod boards;
mod build_fw;
mod campaign;
mod chaos;
mod command;
mod dist;
mod examples;
mod files;
mod flash;
mod fmu;
mod fuzz;
mod measure;
mod newcomer;
mod options;
mod policy;
mod python;
mod setup;
mod size;
mod soak;
mod test;
mod under_test;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Chores of the painleve workspace.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Xtask {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Debug, Subcommand)]
enum Chore {
    /// Run the tests of the default tier, or all; install the tools that they require, if missing.
    Test(test::TestArguments),
    /// Install the microcontroller's Rust target, QEMU and Unicorn, if missing.
    Setup(setup::SetupArguments),
    /// Build the controller's images for the microcontroller, and say where they are.
    BuildFw,
    /// Print flash, RAM and stack use of the images, with their limits.
    Size,
    /// Build the image for a board and flash it with probe-rs.
    Flash(flash::FlashArguments),
    /// Build and run every example.
    Examples,
    /// Build the Python package, install its wheel in a virtual environment, and test it.
    Python,
    /// Perform ten tasks of a new user, each one command, with the wheel of `python` and without a compiler.
    Newcomer,
    /// Build the plant as an FMU (FMI 3.0) and check it with FMPy.
    Fmu,
    /// Disturb plant and controller at every system call and count the flaws.
    Chaos(chaos::ChaosArguments),
    /// Send malformed and random input to parsers, controller and state machines.
    Fuzz(fuzz::FuzzArguments),
    /// Simulate a day with a fault in every minute, after which every counter must be exact.
    Soak(soak::SoakArguments),
    /// Make what a maintainer publishes, in target/dist: commands, wheels, images, FMU, list of dependencies, checksums.
    Dist(dist::DistArguments),
    /// Measure the figures of docs/benchmarks.md on this machine, pinned, and write its table.
    Bench(bench::BenchArguments),
    /// Measure the figures that the documentation prints, and write them to docs/measured/*.toml.
    Measure(measure::MeasureArguments),
}

fn main() -> ExitCode {
    let result = match Xtask::parse().chore {
        Chore::Test(arguments) => test::run(&arguments),
        Chore::Setup(arguments) => setup::run(&arguments),
        Chore::BuildFw => build_fw::run_chore(),
        Chore::Size => size::run(),
        Chore::Flash(arguments) => flash::run(&arguments),
        Chore::Examples => examples::run(),
        Chore::Python => python::run_chore(),
        Chore::Newcomer => newcomer::run_chore(),
        Chore::Fmu => fmu::run_chore(),
        Chore::Fuzz(arguments) => fuzz::run(&arguments),
        Chore::Soak(arguments) => soak::run(&arguments),
        Chore::Chaos(arguments) => chaos::run(&arguments),
        Chore::Dist(arguments) => dist::run_chore(&arguments),
        Chore::Bench(arguments) => bench::run(&arguments),
        Chore::Measure(arguments) => measure::run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn usage_is_a_line_that_a_user_can_type() {
        let usage = |line: &[&str]| {
            let mut command = super::Xtask::command();
            let error = command.try_get_matches_from_mut(line).unwrap_err();
            error.to_string()
        };
        let program = "target/verify/painleve-xtask";
        assert!(usage(&[program, "--help"]).contains("Usage: cargo xtask <COMMAND>"));
        let of_chore = usage(&[program, "flash"]);
        assert!(
            of_chore.contains("Usage: cargo xtask flash <IMAGE>"),
            "{of_chore}"
        );
    }
}
