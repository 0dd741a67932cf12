//! Prints the bounds on the cycles of a flash image's control interrupt and of the update after it, and the paths that
//! attain them.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use painleve_bound::image::Image;
use painleve_bound::report::Bound;
use painleve_bound::{BoundError, built_image};
use painleve_files::input_file;

/// Bounds the cycles of a flash image's control interrupt and of the update after it, from its machine code.
#[derive(Parser)]
struct Arguments {
    /// The image; by default the F405's, as `cargo xtask build-fw` builds it.
    elf: Option<PathBuf>,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let image = arguments.elf.unwrap_or_else(built_image);
    let printed = bound(&image).map(|bound| {
        if arguments.json {
            serde_json::json!(bound).to_string()
        } else {
            bound.text()
        }
    });
    match printed {
        Ok(text) => {
            println!("{}", text.trim_end());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn bound(path: &Path) -> Result<Bound, BoundError> {
    let elf = input_file::bytes(path, input_file::MOST_IMAGE_BYTES);
    let elf = elf.map_err(|error| BoundError::Image {
        path: path.into(),
        source: error.into(),
    })?;
    Bound::of(&Image::of(path, &elf)?)
}
