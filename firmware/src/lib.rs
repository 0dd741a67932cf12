//! The arm's controller: a pure function from configuration, state and a sensor
//! frame to an actuator frame, called once per control tick.
//!
//! It does not know where it runs. The same source is flashed to the
//! microcontroller, linked into the simulation and run under an emulator, and
//! gives the same bits everywhere: single precision, no fused multiply-add, sine and
//! cosine from `painleve-shared`. Nothing here allocates, panics or loops without bound.
//!
//! The folders are in the order of one tick: [`controller`] checks the frame; [`estimate`]
//! turns counts into angles, rates, contact and friction; [`supervise`] decides what may be
//! done; [`refer`] says where the tip should be; [`law`] computes torques, or [`recover`]
//! brings a thrown tip back; [`guard`] keeps the tip pressed to the belt. [`telemetry`]
//! shows what went on inside.

#![no_std]

#[cfg(test)]
extern crate std;

pub mod configuration;
pub mod controller;
pub mod drive;
pub mod estimate;
pub mod guard;
pub mod law;
pub mod recover;
pub mod refer;
pub mod supervise;
pub mod telemetry;

/// Tells a build of controller and messages from another: a hash of the sources of both. The host and the
/// board compare it before a configuration is taken.
pub const BUILD: u64 = match u64::from_str_radix(env!("PAINLEVE_BUILD"), 16) {
    Ok(build) => build,
    Err(_) => panic!("the build script writes sixteen hexadecimal digits"),
};

pub use configuration::Configuration;
pub use controller::Controller;
pub use telemetry::Telemetry;
