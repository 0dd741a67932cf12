//! Files that the bench reads and writes.
//!
//! - [`input_file`]: regular files of limited size
//! - [`atomic_file`]: output files that appear whole or not at all

pub mod atomic_file;
pub mod input_file;
mod output_place;
