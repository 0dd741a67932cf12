//! Operating-system services of the bench.
//!
//! - [`atomic_file`]: output files that appear whole or not at all
//! - [`input_file`]: regular files of limited size
//! - [`realtime`]: absolute deadlines, real-time priority, locked memory
//! - [`lifetime`]: child processes that never outlive their parent
//! - [`memory_full`]: the end of a process that finds shared memory full
//! - [`interrupt`]: Ctrl-C and requests to end
//! - [`picture`]: figures as SVG, PNG or PDF
//! - [`terminal`]: standard output and error that may be closed or full

pub mod atomic_file;
pub mod input_file;
pub mod interrupt;
pub mod lifetime;
pub mod memory_full;
mod output_place;
pub mod picture;
pub mod realtime;
pub mod terminal;
