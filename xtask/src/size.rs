//! `cargo xtask size`: what the images take of the microcontroller, and what they may.

use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, elf};

use crate::build_fw;
use crate::command::ChoreError;

/// Most flash for code and constants, bytes.
const FLASH_LIMIT: u64 = 64 * 1024;

/// Most static RAM, bytes.
const RAM_LIMIT: u64 = 16 * 1024;

/// Most stack, bytes; measured on the emulated board, see `painleve run --timing`.
const STACK_LIMIT: u64 = 4 * 1024;

/// How many of the largest symbols to show.
const LARGEST: usize = 12;

/// The images.
const IMAGES: [&str; 2] = ["painleve-f405", "painleve-qemu"];

/// Builds the images and prints their sizes.
///
/// # Errors
/// If the build fails, or an image is larger than it may be.
pub fn run() -> Result<(), ChoreError> {
    build_fw::run()?;
    let mut over = Vec::new();
    for name in IMAGES {
        let path = build_fw::image(name);
        let error = |reason: String| ChoreError(format!("{}: {reason}", path.display()));
        let bytes = std::fs::read(&path).map_err(|cause| error(cause.to_string()))?;
        let image = object::File::parse(&*bytes).map_err(|cause| error(cause.to_string()))?;
        println!("{name}");
        for (what, size, limit) in [
            ("flash", flash_bytes(&image), FLASH_LIMIT),
            ("static RAM", ram_bytes(&image), RAM_LIMIT),
        ] {
            let share = 100.0 * size as f64 / limit as f64;
            println!("  {what:<10} {size:>7} of {limit:>6} bytes ({share:.0} %)");
            if size > limit {
                over.push(format!("{name} takes {size} of {limit} bytes of {what}"));
            }
        }
        println!(
            "  stack              at most {STACK_LIMIT:>6} bytes, measured by `painleve run --host qemu --timing PATH`"
        );
        println!("  largest symbols");
        let mut symbols: Vec<_> = image.symbols().collect();
        symbols.sort_by_key(|symbol| std::cmp::Reverse(symbol.size()));
        for symbol in symbols.iter().take(LARGEST) {
            let name = rustc_demangle::demangle(symbol.name().unwrap_or("?"));
            println!("  {:>7}  {name:#}", symbol.size());
        }
    }
    if over.is_empty() {
        Ok(())
    } else {
        Err(ChoreError(over.join("; ")))
    }
}

/// Everything that is programmed: code, constants, and initial values.
fn flash_bytes(image: &object::File<'_>) -> u64 {
    image
        .sections()
        .filter(|section| {
            let is_loaded = matches!(
                section.flags(),
                SectionFlags::Elf { sh_flags } if sh_flags & u64::from(elf::SHF_ALLOC) != 0
            );
            is_loaded && section.kind() != SectionKind::UninitializedData
        })
        .map(|section| section.size())
        .sum()
}

/// Variables with and without initial values.
fn ram_bytes(image: &object::File<'_>) -> u64 {
    let names = [".data", ".bss", ".uninit"];
    names
        .iter()
        .filter_map(|name| image.section_by_name(name))
        .map(|section| section.size())
        .sum()
}
