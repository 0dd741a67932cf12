//! Links the images of a board: memory map, linker arguments and log level, for the microcontroller
//! only. An image in another crate finds the board's memory map as well.
//!
//! The default board's `memory.x` is at the top level; another board has its own beside its `Cargo.toml`.

use std::env;
use std::path::Path;

const DEFAULT_BOARD: &str = "painleve-f405-board";

fn main() {
    println!("cargo:rerun-if-changed=../build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let board = env::var("CARGO_MANIFEST_DIR").unwrap_or_else(|_| ".".into());
    let board = Path::new(&board);
    let folder = if env::var("CARGO_PKG_NAME").as_deref() == Ok(DEFAULT_BOARD) {
        board.join("../../..")
    } else {
        // cargo starts the linker at the top level, where it would find the default board's map first.
        let map = board.join("memory.x");
        println!(
            "cargo:rustc-link-arg-bins=--remap-inputs=memory.x={}",
            map.display()
        );
        board.to_path_buf()
    };
    println!(
        "cargo:rerun-if-changed={}",
        folder.join("memory.x").display()
    );
    println!("cargo:rustc-link-search={}", folder.display());
    // By default, defmt logs only errors.
    println!("cargo:rerun-if-env-changed=DEFMT_LOG");
    if env::var_os("DEFMT_LOG").is_none() {
        println!("cargo:rustc-env=DEFMT_LOG=info");
    }
    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}
