//! `cargo xtask flash`: builds the image for a board and flashes it.

use clap::Args;

use crate::boards::{self, BoardPackage};
use crate::build_fw;
use crate::command::{ChoreError, run_with, starts};

/// The board to flash.
#[derive(Debug, Args)]
pub struct FlashArguments {
    /// Name of the board's image, such as painleve-f405.
    image: String,
}

/// Builds, flashes and starts the image, and shows its log.
///
/// # Errors
/// If no board has this image, the build fails, probe-rs is missing or no board is connected.
pub fn run(arguments: &FlashArguments) -> Result<(), ChoreError> {
    let boards = boards::all()?;
    let chip = chip(&boards, &arguments.image)?;
    if !starts("probe-rs") {
        return Err(ChoreError(
            "probe-rs is not installed: `cargo install probe-rs-tools --locked`, then allow \
             your user to use the debug probe (https://probe.rs/docs/getting-started/probe-setup)"
                .into(),
        ));
    }
    build_fw::run()?;
    let image = build_fw::image(&arguments.image);
    run_with(
        "probe-rs",
        &["run", "--chip", chip, &image.to_string_lossy()],
        &[],
    )
}

/// Returns the chip for an image.
fn chip<'a>(boards: &'a [BoardPackage], image: &str) -> Result<&'a str, ChoreError> {
    let flashable = |board: &'a BoardPackage| Some((board.chip.as_deref()?, &board.images));
    let mut flashable = boards.iter().filter_map(flashable);
    let found = flashable
        .clone()
        .find(|(_, images)| images.iter().any(|it| it == image));
    found.map(|(chip, _)| chip).ok_or_else(|| {
        let names = flashable.by_ref().flat_map(|(_, images)| images);
        let names: Vec<_> = names.map(String::as_str).collect();
        ChoreError(format!(
            "no board has an image {image}: choose {}",
            names.join(" or ")
        ))
    })
}
