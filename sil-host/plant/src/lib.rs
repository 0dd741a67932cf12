//! The simulated plant, and the closed loop of plant and controller in one process.
//!
//! - [`plant`]: the interface of a plant
//! - [`mechanics`]: the arm on its belt, as a hybrid rigid-body model
//! - [`belt_line`]: the postures on the belt, and how far a tip is from the edges p = 0
//! - [`converters`]: encoders, force cell, torque stages and the link's losses
//! - [`decimal`]: settings in single precision as they were written
//! - [`law_choice`]: the control law as a setting, from the program's set of laws
//! - [`scenario`]: the complete definition of a run, as a TOML file
//! - [`simulation`]: the plant with its converters, tick by tick
//! - `tick_clock`: the instants of the control ticks
//! - [`controller_host`]: the host of the controller
//! - [`closed_loop`]: sample, exchange, record, advance
//! - [`sample`]: both frames of a tick and the plant's true state, for records
//! - [`statistics`]: counts and extremes of a run
//! - [`telemetry`]: the controller's internal state at its last tick

pub mod belt_line;
pub mod closed_loop;
pub mod contact_probe;
pub mod controller_host;
pub mod converters;
pub mod decimal;
pub mod law_choice;
pub mod mechanics;
pub mod plant;
pub mod sample;
pub mod scenario;
pub mod simulation;
pub mod smoothness;
pub mod statistics;
pub mod telemetry;
mod tick_clock;

use law_choice::LawChoice;

/// The controller with any of the program's laws.
pub type Controller = painleve_firmware::Controller<LawChoice>;

/// Its configuration.
pub type Configuration = painleve_firmware::Configuration<LawChoice>;

/// Re-exported for the vectors in the plant's interface.
pub use nalgebra;
pub use plant::{ContactMode, Event, Plant, PlantError, Probe, Snapshot, State, Step};
