//! `cargo xtask flash`: builds the image for the STM32F405 and flashes it.

use crate::build_fw;
use crate::command::{ChoreError, run_with};
use crate::setup::starts;

/// The chip, as probe-rs names it.
const CHIP: &str = "STM32F405RGTx";

/// Builds, flashes and starts the image, and shows its log.
///
/// # Errors
/// If the build fails, probe-rs is missing or there is no board.
pub fn run() -> Result<(), ChoreError> {
    if !starts("probe-rs") {
        return Err(ChoreError(
            "probe-rs is not installed: `cargo install probe-rs-tools --locked`, then allow \
             your user to use the debug probe (https://probe.rs/docs/getting-started/probe-setup)"
                .into(),
        ));
    }
    build_fw::run()?;
    let image = build_fw::image("painleve-f405");
    run_with(
        "probe-rs",
        &["run", "--chip", CHIP, &image.to_string_lossy()],
        &[],
    )
}
