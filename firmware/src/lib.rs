//! The arm's controller: a pure function from configuration, state and a sensor
//! frame to an actuator frame, called once per control tick.
//!
//! It does not know where it runs. The same source is flashed to the
//! microcontroller, linked into the simulation and run under an emulator, and
//! gives the same bits everywhere: single precision, no fused multiply-add, sine and
//! cosine from `painleve-shared`. Nothing here allocates, panics or loops without bound.
//!
//! One tick, in order: [`controller`] checks the frame; [`estimator`] turns counts into
//! angles and rates; [`contact_detector`] decides whether the tip touches;
//! [`supervisor`] decides what may be done; [`reference`](mod@reference) says where the tip
//! should be; [`law`] computes torques; the torques are limited and turned into
//! counts. [`deadline_monitor`] watches over what is around the tick; [`telemetry`]
//! shows what went on inside.

#![no_std]

#[cfg(test)]
extern crate std;

pub mod belt_observer;
pub mod configuration;
pub mod contact_guard;
pub mod contact_observer;
pub mod controller;
pub mod deadline_monitor;
pub mod disturbance_observer;
pub mod edge_governor;
pub mod estimator;
pub mod friction_estimator;
pub mod law;
pub mod length_calibration;
pub mod model;
pub mod recovery;
pub mod reference;
pub mod supervisor;
pub mod telemetry;

pub use configuration::Configuration;
pub use controller::Controller;
pub use telemetry::Telemetry;
