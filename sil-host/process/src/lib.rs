//! A process of the bench among others.
//!
//! - [`free_space`]: the free bytes of a file system
//! - [`interrupt`]: Ctrl-C and requests to end; [`memory_full`]: the end where shared memory is full
//! - [`lifetime`]: child processes that never outlive their parent
//! - [`realtime`]: absolute deadlines, real-time priority, locked memory
//! - [`refusal`]: what to do about a resource that the system refuses
//! - [`terminal`]: standard output and error that may be closed or full

pub mod free_space;
pub mod interrupt;
pub mod lifetime;
pub mod memory_full;
pub mod realtime;
pub mod refusal;
pub mod terminal;
