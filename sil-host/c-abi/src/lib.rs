//! Controller and plant behind a C interface, `include/painleve.h`.
//!
//! Both are opaque: made from a scenario as TOML text, freed by their own function, and used by
//! one thread at a time. Every call that can fail returns a [`PainleveStatus`]; the sentence that
//! goes with it is [`painleve_last_error`]. No panic crosses the border: it is caught and becomes
//! [`PainleveStatus::Panic`], after which the object must only be freed.
//!
//! - [`status`]: what a call returns
//! - [`frames`]: what plant and controller exchange, as plain structs
//! - [`controller`], [`plant`]: the functions

// Pointers of C cannot be used without; every use says why it is sound.
#![allow(unsafe_code)]

pub mod controller;
pub mod frames;
pub mod plant;
pub mod status;

pub use controller::PainleveController;
pub use frames::{PainleveActuatorFrame, PainleveSensorFrame, PainleveSnapshot};
pub use plant::PainlevePlant;
pub use status::{PainleveStatus, painleve_last_error};
