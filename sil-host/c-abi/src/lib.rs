//! C interface of controller and plant, `include/painleve.h`.
//!
//! Both are opaque: they are created from a scenario as TOML text, freed by their own function, and
//! used by one thread at a time. Every call that can fail returns a [`PainleveStatus`];
//! [`painleve_last_error`] returns the corresponding message. No panic crosses the C boundary: it
//! is caught and becomes [`PainleveStatus::Panic`], after which the object must only be freed.
//!
//! - [`status`]: return values of calls
//! - [`frames`]: the frames between plant and controller, as plain structs
//! - [`controller`], [`plant`]: the functions

// C pointers require unsafe code; every use states why it is sound.
#![allow(unsafe_code)]

pub mod controller;
pub mod frames;
pub mod plant;
pub mod status;
#[cfg(test)]
mod tests;

pub use controller::PainleveController;
pub use frames::{PainleveActuatorFrame, PainleveSensorFrame, PainleveSnapshot};
pub use plant::PainlevePlant;
pub use status::{PainleveStatus, painleve_last_error};
