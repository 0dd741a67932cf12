//! A run as a page in the browser: arm and belt that move, strip charts, states, events.
//!
//! - [`row`]: what the page shows of a tick, as bytes
//! - [`thinning`]: at most so many rows, with the extremes of the contact force kept
//! - [`page`]: the page of a recorded run as one file that needs no network
//! - [`server`]: the page of a run that goes on, served to this machine
//!
//! `page/` holds the page itself; its scripts are plain, so nothing has to be built.

pub mod page;
pub mod row;
pub mod server;
pub mod thinning;

pub use page::PageFile;
