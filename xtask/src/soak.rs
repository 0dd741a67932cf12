//! `cargo xtask soak`: a simulated day on this PC and a simulated hour under QEMU, with a fault on
//! the link in every minute, after which every counter must be exact. Takes about a quarter of an
//! hour; CI runs a few minutes of it.

use clap::Args;

use crate::command::ChoreError;
use crate::options::number;
use crate::under_test::run_tests;

/// Options of the soak.
#[derive(Debug, Args)]
pub struct SoakArguments {
    /// Simulated hours with the controller in this process.
    #[arg(long, default_value_t = 24.0, allow_negative_numbers = true, value_parser = hours)]
    hours: f64,
    /// Simulated hours with the image under QEMU.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true, value_parser = hours)]
    qemu_hours: f64,
}

/// Simulated hours: at least a minute, and fewer ticks than the board's counter of 32 bits holds.
fn hours(text: &str) -> Result<f64, String> {
    number(text, 0.02..=1000.0, "hours")
}

/// Runs the part that belongs to `cargo xtask test --all`.
///
/// # Errors
/// As [`run`].
pub fn nightly() -> Result<(), ChoreError> {
    run(&SoakArguments {
        hours: 2.0,
        qemu_hours: 0.05,
    })
}

/// Runs the soak.
///
/// # Errors
/// If a counter is wrong or the arm moves wrongly.
pub fn run(arguments: &SoakArguments) -> Result<(), ChoreError> {
    let minutes = |hours: f64| ((60.0 * hours).round() as u32).to_string();
    run_tests(
        &["--workspace", "--test", "it"],
        &["soak"],
        // That of the image is ignored by default.
        &["--nocapture", "--include-ignored"],
        &[
            ("PAINLEVE_SOAK_MINUTES", &minutes(arguments.hours)),
            ("PAINLEVE_SOAK_QEMU_MINUTES", &minutes(arguments.qemu_hours)),
        ],
    )
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Soak {
        #[command(flatten)]
        arguments: SoakArguments,
    }

    #[test]
    fn a_time_in_which_nothing_is_simulated_is_refused() {
        for option in ["--hours", "--qemu-hours"] {
            for hours in ["nan", "inf", "0", "-1", "0.001", "1001"] {
                let refusal = Soak::try_parse_from(["soak", option, hours]).unwrap_err();
                let message = refusal.to_string();
                let expected = format!("'{hours}' for '{option}");
                assert!(message.contains(&expected), "{message}");
                assert!(message.contains("from 0.02 to 1000"), "{message}");
            }
            let soak = Soak::try_parse_from(["soak", option, "0.02"]).unwrap();
            assert!(soak.arguments.hours > 0.0 && soak.arguments.qemu_hours > 0.0);
        }
    }
}
