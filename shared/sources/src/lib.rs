//! Hash of a crate's own sources, which its build script passes to it by [`pass_to_crate`].
//!
//! The crate reads it from `env!("PAINLEVE_SOURCES")`, 16 hexadecimal digits. It tells people, and an emulator's host,
//! whether an image was built from the sources that they have.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Passes the hash of the files in `src` to the crate that is being built, as `PAINLEVE_SOURCES`.
///
/// # Errors
/// An error of the system if a file cannot be read.
pub fn pass_to_crate() -> io::Result<()> {
    println!("cargo:rerun-if-changed=src");
    let hash = hash(Path::new("src"))?;
    println!("cargo:rustc-env=PAINLEVE_SOURCES={hash:016x}");
    Ok(())
}

/// Returns the FNV-1a hash, 64 bits, of all Rust files in a folder.
fn hash(folder: &Path) -> io::Result<u64> {
    let mut files = Vec::new();
    collect(folder, &mut files)?;
    files.sort();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for file in files {
        // The same with either kind of line end.
        for byte in fs::read(file)?.into_iter().filter(|byte| *byte != b'\r') {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    Ok(hash)
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|it| it == "rs") {
            files.push(path);
        }
    }
    Ok(())
}
