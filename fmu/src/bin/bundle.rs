//! Builds the library and packages it as `target/fmu/painleve.fmu`: `cargo xtask fmu`.
//!
//! `cargo-fmi` reads the variables from the library through Rust's own calling convention, so both
//! must come from the same compiler and lock file. For this reason it is a dependency of this crate
//! and not an installed command.

use std::error::Error;
use std::fs::{self, File};
use std::path::Path;

use zip::{ZipArchive, ZipWriter};

/// The folder of the sources, of which `cargo-fmi` packages a list, but not the files.
const SOURCES: &str = "sources/";

fn main() -> Result<(), Box<dyn Error>> {
    // The package to bundle is the one in the present folder.
    std::env::set_current_dir(env!("CARGO_MANIFEST_DIR"))?;
    cargo_fmi::entrypoint_from(["cargo-fmi", "bundle", "--release"])?;
    let target = std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    without_sources(&Path::new(&target).join("fmu/painleve.fmu"))
}

/// Removes the sources from an FMU.
fn without_sources(fmu: &Path) -> Result<(), Box<dyn Error>> {
    let mut packaged = ZipArchive::new(File::open(fmu)?)?;
    let kept = fmu.with_extension("kept");
    let mut writer = ZipWriter::new(File::create(&kept)?);
    for index in 0..packaged.len() {
        let file = packaged.by_index_raw(index)?;
        if !file.name().starts_with(SOURCES) {
            writer.raw_copy_file(file)?;
        }
    }
    writer.finish()?;
    Ok(fs::rename(&kept, fmu)?)
}
