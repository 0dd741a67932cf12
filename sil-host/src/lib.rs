//! The host side of the bench: a simulated arm on a moving belt with its
//! converters, and everything around it.

pub mod atomic_file;
pub mod plant;
pub mod plot;
pub mod record;
