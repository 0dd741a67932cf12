//! What the bench asks of the operating system.
//!
//! - [`atomic_file`]: output files that appear whole or not at all
//! - [`input_file`]: text files from outside, read within bounds
//! - [`realtime`]: absolute deadlines, real-time priority, locked memory
//! - [`lifetime`]: child processes that never outlive whoever started them
//! - [`interrupt`]: Ctrl-C and requests to end
//! - [`terminal`]: standard output and error that may be closed or full

pub mod atomic_file;
pub mod input_file;
pub mod interrupt;
pub mod lifetime;
pub mod realtime;
pub mod terminal;
