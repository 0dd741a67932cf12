//! `cargo xtask soak`: a simulated day on this PC and a simulated hour under QEMU, with a fault on
//! the link in every minute, after which every counter must be exact. Takes about a quarter of an
//! hour; CI runs a few minutes of it.

use clap::Args;

use crate::command::ChoreError;
use crate::under_test::run_tests;

/// Options of the soak.
#[derive(Debug, Args)]
pub struct SoakArguments {
    /// Simulated hours with the controller in this process.
    #[arg(long, default_value_t = 24.0)]
    hours: f64,
    /// Simulated hours with the image under QEMU.
    #[arg(long, default_value_t = 1.0)]
    qemu_hours: f64,
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
