//! Mechanics, units and messages that the arm's controller and its simulated plant share.
//!
//! - [`arm`]: the arm's parameters, checked once, and the model built from them
//! - [`kinematics`], [`dynamics`]: tip, Jacobian, inverse kinematics; M, w, c and energy
//! - [`contact`]: Q, b, p and the four solution modes of the tip on the belt
//! - [`coordinates`]: link and joint coordinates as distinct types
//! - [`counts`]: integer readings and commands of the converters, with their scaling
//! - [`frame`], [`status`]: the data that crosses the link at every control tick
//! - [`mounting`], [`stages`], [`winding`]: settings of a real arm's sensors, motors and gears, and windings
//! - [`black_box`], [`stored`]: what a board keeps over a reset, and over a loss of power
//! - [`lapse`]: counted errors of ticks, frames and messages, with limits
//! - [`wire`], [`message`]: frames, requests and responses as bytes, for links other than shared
//!   memory
//! - [`real`], [`range`]: scalars with host-independent functions, and range errors
//! - [`schema`]: hash of what the bytes of messages and settings mean
//! - [`settings`](mod@settings): settings declared once, with default, range, unit and meaning
//!
//! Equations and symbols are those of Marchese, Coraggio, Hogan and di Bernardo,
//! *Control of Painlevé Paradox in a Robotic System* (arXiv:1907.04070), "the
//! paper" throughout. Everything is generic over `f32` (controller) and `f64`
//! (plant), needs no heap and never panics.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(test)]
extern crate std;

// The macro `settings!` needs this crate's name where `$crate` is not allowed.
extern crate self as painleve_shared;

mod arc_cosine;
pub mod arm;
pub mod black_box;
pub mod contact;
pub mod coordinates;
pub mod counts;
pub mod dynamics;
pub mod frame;
pub mod kinematics;
pub mod lapse;
pub mod message;
pub mod mounting;
pub mod range;
pub mod real;
pub mod schema;
pub mod settings;
mod square_root;
pub mod stages;
pub mod status;
pub mod stored;
pub mod winding;
pub mod wire;

/// Hash of this crate's sources.
pub const SOURCES: u64 = match u64::from_str_radix(env!("PAINLEVE_SOURCES"), 16) {
    Ok(hash) => hash,
    Err(_) => panic!("the build script writes sixteen hexadecimal digits"),
};

pub use arm::{Arm, ArmParameters};
pub use contact::{ContactTerms, Slip, SolutionMode};
pub use coordinates::{GeneralisedTorque, JointMotion, JointTorque, LinkMotion};
pub use frame::{ActuatorFrame, SensorFrame};
pub use kinematics::{Pose, Posture};
pub use range::OutOfRange;
pub use real::Real;
