//! The simulated plant and the controller in a closed loop with it, in one process.
//!
//! - [`plant`]: what a plant is to all the rest
//! - [`mechanics`]: the arm on its belt, as a hybrid rigid-body model
//! - [`converters`]: encoders, force cell, torque stages and the link's losses
//! - [`law_choice`]: the control law as data, of the set that the program was built with
//! - [`scenario`]: everything that defines a run, as a TOML file
//! - [`simulation`]: the plant as the controller's wires see it
//! - [`controller_host`]: whatever runs the controller
//! - [`closed_loop`]: sample, exchange, record, advance
//! - [`sample`]: both frames of a tick and the truth behind them, for records
//! - [`statistics`]: counts and extremes of a run

pub mod closed_loop;
pub mod controller_host;
pub mod converters;
pub mod law_choice;
pub mod mechanics;
pub mod plant;
pub mod sample;
pub mod scenario;
pub mod simulation;
pub mod statistics;

use law_choice::LawChoice;

/// The controller with any of the program's laws.
pub type Controller = painleve_firmware::Controller<LawChoice>;

/// Its configuration.
pub type Configuration = painleve_firmware::Configuration<LawChoice>;

/// Vectors of the plant's interface.
pub use nalgebra;
pub use plant::{ContactMode, Event, Plant, PlantError, Probe, Snapshot, State, Step};
