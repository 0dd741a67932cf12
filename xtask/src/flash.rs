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
        &probe_arguments(chip, &image.to_string_lossy()),
        &[],
    )
}

/// Returns the arguments of probe-rs, which from 0.28 on else stops the processor at every hard fault, before the handler that
/// takes the torque off, and at every reset, such as those of `painleve accept`.
fn probe_arguments<'a>(chip: &'a str, image: &'a str) -> [&'a str; 6] {
    let [fault, reset] = ["--no-catch-hardfault", "--no-catch-reset"];
    ["run", "--chip", chip, fault, reset, image]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hard_faults_and_resets_are_left_to_the_image() {
        let arguments = probe_arguments("STM32F405RGTx", "image");
        assert!(arguments.contains(&"--no-catch-hardfault"));
        assert!(arguments.contains(&"--no-catch-reset"));
        assert_eq!(arguments[..3], ["run", "--chip", "STM32F405RGTx"]);
        assert_eq!(arguments.last(), Some(&"image"));
    }
}
