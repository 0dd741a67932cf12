//! Builds the library and packages it as `target/fmu/painleve.fmu`: `cargo xtask fmu`.
//!
//! `cargo-fmi` reads the variables from the library through Rust's own calling convention, so both
//! must come from the same compiler and lock file. For this reason it is a dependency of this crate
//! and not an installed command.

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    // The package to bundle is the one in the present folder.
    std::env::set_current_dir(env!("CARGO_MANIFEST_DIR"))?;
    cargo_fmi::entrypoint_from(["cargo-fmi", "bundle", "--release"])?;
    Ok(())
}
