//! The plant: a two-link rigid arm whose tip meets a moving belt with Coulomb friction.
//!
//! It is a hybrid system. Between events the state follows the smooth equations of its contact mode
//! ([`motion`]), integrated with adaptive steps ([`dop853`]), or with shorter and cheaper ones
//! where a new torque truncates them anyway ([`cash_karp`]). Events are located inside the step
//! ([`event`]): the tip lands, slip vanishes, the normal force vanishes, the force leaves the
//! friction cone, p reaches zero. At an event the tip collides ([`impact`]) or the next mode is
//! decided ([`transition`]). In contact the state is projected back onto the belt after every step,
//! so that the constraint does not drift.
//!
//! Torque is held between commands ([`torque`]); the belt's speed is a function of time ([`belt`]).
//! Nothing allocates after construction, nothing is random, and elementary functions come from
//! `libm`, so that equal inputs give equal bits on every host.

mod arm_on_belt;
pub mod belt;
mod belt_file;
pub mod built_in;
pub mod cash_karp;
pub mod compliant;
pub mod dop853;
pub mod effects;
pub mod event;
mod from_file;
pub mod impact;
pub mod motion;
mod motion_error;
mod moving_belt;
mod parameters;
mod probe;
pub mod rosenbrock;
pub(crate) mod series;
mod step_budget;
#[cfg(test)]
mod tests;
pub mod torque;
pub mod transition;
pub mod turned_pose;

pub use arm_on_belt::ArmOnBelt;
pub use built_in::BuiltInPlant;
pub(crate) use from_file::{with_paths_only, without_files};
pub use motion_error::MotionError;
pub use parameters::{Elbow, InitialState, PlantParameters, SolverSettings, printed_reach_m};
pub use probe::{ArmProbe, ArmStep};
