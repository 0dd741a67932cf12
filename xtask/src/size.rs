//! `cargo xtask size`: memory use of the images, and its limits.

use object::{Object, ObjectSection, ObjectSegment, ObjectSymbol};

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::boards;
use crate::build_fw;
use crate::command::{ChoreError, say};
use crate::under_test::{build_program, printed_json};

/// All limits; the end-to-end tests check those of the ticks and of the stack as well.
const BUDGET: &str = include_str!("../../tests/budget.json");

/// Number of largest symbols to print.
const LARGEST: usize = 12;

/// Builds the images and the program, checks the images, and runs one to measure its stack.
///
/// # Errors
/// If a build or the measurement fails, or an image exceeds a limit.
pub fn run() -> Result<(), ChoreError> {
    build_fw::run()?;
    build_program()?;
    check_images()?;
    say("painleve-f405 under QEMU, maximum over all built-in scenarios")?;
    let limit = Budget::read()?.limit(&["stack_bytes"])?;
    let stack = stack_bytes()?;
    let over = check("painleve-f405", "stack", stack, limit)?;
    none(over.as_slice())
}

/// Prints the sizes of images that are built, and checks them.
///
/// # Errors
/// If an image cannot be read or exceeds a limit.
pub fn check_images() -> Result<(), ChoreError> {
    let mut over = Vec::new();
    let boards = boards::all()?;
    for name in boards.iter().flat_map(|board| &board.images) {
        let path = build_fw::image(name);
        over.extend(beyond(name, &path)?);
        print_largest_symbols(&path)?;
    }
    none(&over)
}

fn none(complaints: &[String]) -> Result<(), ChoreError> {
    match complaints {
        [] => Ok(()),
        complaints => Err(ChoreError(complaints.join("; "))),
    }
}

/// Prints flash and RAM of an image in a file, and checks them.
///
/// # Errors
/// If the file is no image, or the image exceeds a limit.
pub fn check_image(name: &str, path: &Path) -> Result<(), ChoreError> {
    none(&beyond(name, path)?)
}

/// Prints flash and RAM of an image; returns a message for each that exceeds its limit.
fn beyond(name: &str, path: &Path) -> Result<Vec<String>, ChoreError> {
    say(name)?;
    let budget = Budget::read()?;
    let bytes = read(path)?;
    let image = parse(path, &bytes)?;
    let flash = budget.image(name, "flash_bytes")?;
    let ram = budget.image(name, "ram_bytes")?;
    let over = [
        check(name, "flash", flash_bytes(&image), flash)?,
        check(name, "static RAM", ram_bytes(&image), ram)?,
    ];
    Ok(over.into_iter().flatten().collect())
}

fn print_largest_symbols(path: &Path) -> Result<(), ChoreError> {
    say("  largest symbols")?;
    let bytes = read(path)?;
    let image = parse(path, &bytes)?;
    let mut symbols: Vec<_> = image.symbols().collect();
    symbols.sort_by_key(|symbol| std::cmp::Reverse(symbol.size()));
    for symbol in symbols.iter().take(LARGEST) {
        let name = rustc_demangle::demangle(symbol.name().unwrap_or("?"));
        say(&format!("  {:>7}  {name:#}", symbol.size()))?;
    }
    Ok(())
}

fn read(path: &Path) -> Result<Vec<u8>, ChoreError> {
    fs::read(path).map_err(|cause| ChoreError(format!("{}: {cause}", path.display())))
}

fn parse<'a>(path: &Path, bytes: &'a [u8]) -> Result<object::File<'a>, ChoreError> {
    let image = object::File::parse(bytes);
    image.map_err(|cause| ChoreError(format!("{}: {cause}", path.display())))
}

/// The limits of `tests/budget.json`.
struct Budget(Value);

impl Budget {
    fn read() -> Result<Self, ChoreError> {
        serde_json::from_str(BUDGET)
            .map(Self)
            .map_err(|cause| ChoreError(format!("tests/budget.json: {cause}")))
    }

    /// Returns a limit of an image, in bytes.
    fn image(&self, name: &str, what: &str) -> Result<u64, ChoreError> {
        self.limit(&["images", name, what])
    }

    /// Returns the limit under these nested keys.
    fn limit(&self, keys: &[&str]) -> Result<u64, ChoreError> {
        let value = keys.iter().fold(&self.0, |value, key| &value[key]);
        value.as_u64().ok_or_else(|| {
            let keys = keys.join(".");
            ChoreError(format!("tests/budget.json has no limit {keys}"))
        })
    }
}

/// Prints a size and its limit; returns a message if it exceeds the limit.
fn check(name: &str, what: &str, size: u64, limit: u64) -> Result<Option<String>, ChoreError> {
    let share = 100.0 * size as f64 / limit as f64;
    say(&format!(
        "  {what:<10} {size:>7} of {limit:>6} bytes ({share:.0} %)"
    ))?;
    Ok((size > limit).then(|| format!("{name} takes {size} of {limit} bytes of {what}")))
}

/// Returns a number with commas between its thousands.
pub fn thousands(number: u64) -> String {
    match number {
        0..1000 => number.to_string(),
        _ => format!("{},{:03}", thousands(number / 1000), number % 1000),
    }
}

/// Returns the largest stack use of any scenario, measured on the emulated board. It occurs while
/// the configuration is decoded and in the first ticks.
fn stack_bytes() -> Result<u64, ChoreError> {
    let arguments = ["timing", "--json", "--set", "run.duration_s=0.1"];
    let reports = printed_json(&arguments)?;
    let reports = reports.as_array().map(Vec::as_slice).unwrap_or_default();
    let stacks = reports.iter().map(|report| report["stack_bytes"].as_u64());
    stacks
        .collect::<Option<Vec<_>>>()
        .and_then(|stacks| stacks.into_iter().max())
        .ok_or_else(|| ChoreError("`painleve timing` does not report the stack".into()))
}

/// Returns the programmed bytes: code, constants, and initial values.
fn flash_bytes(image: &object::File<'_>) -> u64 {
    image.segments().map(|segment| segment.file_range().1).sum()
}

/// Returns the bytes of variables with and without initial values.
fn ram_bytes(image: &object::File<'_>) -> u64 {
    let names = [".data", ".bss", ".uninit"];
    names
        .iter()
        .filter_map(|name| image.section_by_name(name))
        .map(|section| section.size())
        .sum()
}
