//! `cargo xtask size`: memory use of the images, and its limits.

use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, elf};

use std::path::Path;
use std::{fs, io};

use serde_json::Value;

use crate::boards;
use crate::build_fw;
use crate::command::{ChoreError, say, workspace};
use crate::under_test::{build_program, printed_json};

/// All limits; the end-to-end tests check those of the ticks and of the stack as well.
const BUDGET: &str = include_str!("../../tests/budget.json");

/// The page that prints these figures.
const PAGE: &str = include_str!("../../docs/flashing.md");

/// The images whose flash and RAM it prints, and the names of their chips there.
const PRINTED_IMAGES: [(&str, &str); 2] = [
    ("painleve-f405", "STM32F405"),
    ("painleve-g474", "STM32G474"),
];

/// Largest difference of a printed size from the measured one, relative to the measured one.
const TOLERANCE: f64 = 0.03;

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
    let mut over = Vec::from_iter(check("painleve-f405", "stack", stack, limit)?);
    over.extend(misprinted("stack", "", stack, limit));
    none(&over)
}

/// Prints the sizes of images that are built, and checks them.
///
/// # Errors
/// If an image cannot be read, exceeds a limit, or is not as the documentation says.
pub fn check_images() -> Result<(), ChoreError> {
    let mut over = Vec::new();
    let boards = boards::all()?;
    for name in boards.iter().flat_map(|board| &board.images) {
        let path = build_fw::image(name);
        for Section { what, size, limit } in sections(name, &path)? {
            over.extend(check(name, what, size, limit)?);
            for (_, chip) in PRINTED_IMAGES.iter().filter(|(image, _)| name == image) {
                over.extend(misprinted(what, chip, size, limit));
            }
        }
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
    let mut over = Vec::new();
    for Section { what, size, limit } in sections(name, path)? {
        over.extend(check(name, what, size, limit)?);
    }
    none(&over)
}

/// A part of a chip's memory, bytes.
struct Section {
    what: &'static str,
    size: u64,
    limit: u64,
}

/// Returns flash and RAM of an image.
fn sections(name: &str, path: &Path) -> Result<[Section; 2], ChoreError> {
    say(name)?;
    let budget = Budget::read()?;
    let bytes = read(path)?;
    let image = parse(path, &bytes)?;
    Ok([
        Section {
            what: "flash",
            size: flash_bytes(&image),
            limit: budget.image(name, "flash_bytes")?,
        },
        Section {
            what: "static RAM",
            size: ram_bytes(&image),
            limit: budget.image(name, "ram_bytes")?,
        },
    ])
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

/// Returns a message if the row of the documentation that begins with `what` and names the chip prints another
/// limit, or a size that differs by more than [`TOLERANCE`].
fn misprinted(what: &str, chip: &str, size: u64, limit: u64) -> Option<String> {
    let Some(row) = PAGE
        .lines()
        .find(|line| line.starts_with(&format!("| {what}")) && line.contains(chip))
    else {
        return Some(format!("docs/flashing.md has no row for {what} {chip}"));
    };
    let figures: Vec<u64> = row
        .split('|')
        .skip(2)
        .filter_map(|cell| {
            let digits: String = cell.chars().filter(char::is_ascii_digit).collect();
            digits.parse().ok()
        })
        .collect();
    let agrees = matches!(figures[..], [printed, printed_limit]
        if printed_limit == limit
            && printed.abs_diff(size) as f64 <= TOLERANCE * size as f64);
    if !agrees && std::env::var_os("UPDATE_DOCUMENTATION").is_some() {
        return reprint(row, size, limit).err();
    }
    (!agrees).then(|| {
        format!(
            "docs/flashing.md prints '{row}': {what} takes {size} of {limit} bytes; update it with \
             UPDATE_DOCUMENTATION=1 cargo xtask size"
        )
    })
}

/// Writes a size and its limit into a row of the documentation.
fn reprint(row: &str, size: u64, limit: u64) -> Result<(), String> {
    let path = workspace().join("docs/flashing.md");
    let fail = |cause: io::Error| format!("docs/flashing.md: {cause}");
    let label = row.split('|').nth(1).unwrap_or_default();
    let [size, limit] = [size, limit].map(thousands);
    let page = fs::read_to_string(&path).map_err(fail)?;
    let page = page.replace(row, &format!("|{label}| {size} | {limit} |"));
    fs::write(&path, page).map_err(fail)
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

/// Returns the bytes of variables with and without initial values.
fn ram_bytes(image: &object::File<'_>) -> u64 {
    let names = [".data", ".bss", ".uninit"];
    names
        .iter()
        .filter_map(|name| image.section_by_name(name))
        .map(|section| section.size())
        .sum()
}
