//! `cargo xtask flash`: builds the image for the STM32F405 and flashes it.

use crate::boards;
use crate::build_fw;
use crate::command::{ChoreError, run_with};
use crate::setup::starts;

/// Builds, flashes and starts the image, and shows its log.
///
/// # Errors
/// If the build fails, probe-rs is missing or no board is connected.
pub fn run() -> Result<(), ChoreError> {
    if !starts("probe-rs") {
        return Err(ChoreError(
            "probe-rs is not installed: `cargo install probe-rs-tools --locked`, then allow \
             your user to use the debug probe (https://probe.rs/docs/getting-started/probe-setup)"
                .into(),
        ));
    }
    let boards = boards::all()?;
    let flashable = boards
        .iter()
        .find_map(|board| Some((board.chip.as_ref()?, board.images.first()?)));
    let (chip, image) =
        flashable.ok_or_else(|| ChoreError("no board in firmware/boards has a chip".into()))?;
    build_fw::run()?;
    let image = build_fw::image(image);
    run_with(
        "probe-rs",
        &["run", "--chip", chip, &image.to_string_lossy()],
        &[],
    )
}
