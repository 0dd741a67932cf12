//! The arm's controller: a pure function from configuration, state and sensor frame to an actuator
//! frame, called once per control tick.
//!
//! The controller does not depend on its host. The same source is flashed to the microcontroller,
//! linked into the simulation and run under an emulator, and gives the same bits everywhere: single
//! precision, no fused multiply-add, sine and cosine from `painleve-shared`. Nothing here
//! allocates, panics or loops without bound. Why functions are out of line and structures in the order of C stands in
//! docs/controller.md, *Generated code*.
//!
//! The modules follow the order of one tick: [`controller`] checks the frame; [`estimate`] converts
//! counts to angles, rates, contact and friction; [`supervise`] decides which actions are allowed;
//! [`refer`] gives the target position of the tip; [`demand`] computes torques, with the [`law`] or,
//! to return a thrown tip to the belt, with [`recover`]; [`torque_output`] limits
//! them. [`drive`] runs the
//! ticks on the hardware.

#![no_std]

#[cfg(test)]
extern crate std;

pub mod configuration;
pub mod controller;
pub mod demand;
pub mod drive;
pub mod estimate;
pub mod last_command;
pub mod law;
pub mod recover;
pub mod refer;
pub mod schedule;
pub mod supervise;
#[cfg(test)]
mod test_readings;
pub mod torque_output;

/// Hash of the sources of the controller and of what it shares with the plant. It is displayed, and tells an image of
/// these sources from one that may behave differently.
pub const SOURCES: u64 = match u64::from_str_radix(env!("PAINLEVE_SOURCES"), 16) {
    Ok(hash) => hash.rotate_left(1) ^ painleve_shared::SOURCES,
    Err(_) => panic!("the build script writes sixteen hexadecimal digits"),
};

pub use configuration::Configuration;
pub use controller::Controller;
pub use painleve_shared::{OutOfRange, counts, frame, status};
