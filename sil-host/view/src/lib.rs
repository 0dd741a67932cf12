//! A run as a browser page: moving arm and belt, strip charts, states, events.
//!
//! - [`row`]: the data of one tick for the page, as bytes
//! - [`thinning`]: limits the number of rows and keeps the extremes of the contact force
//! - [`comparison`]: the page of a run with others beside it
//! - [`events`]: events as the page lists and counts them
//! - [`page`]: the page of a recorded run as one file that needs no network
//! - [`server`]: the viewers of a live run on this machine: the same page, and Foxglove
//! - [`access`]: who may be one; `connection`: a connection until it is
//! - [`hub`], [`request`]: data on their way to the viewers, and their requests
//! - [`parameters`]: the settings of a live run, by name
//! - [`foxglove`]: Foxglove's WebSocket protocol
//!
//! `page/` contains the page itself; its scripts need no build step.

pub mod access;
pub mod comparison;
mod connection;
pub mod events;
pub mod foxglove;
pub mod hub;
pub mod page;
pub mod parameters;
mod receive;
pub mod request;
pub mod row;
pub mod server;
pub mod thinning;

use std::sync::{Mutex, MutexGuard, PoisonError};

pub use page::PageFile;

/// Locks a mutex. A thread that panicked has left nothing half-done here.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
