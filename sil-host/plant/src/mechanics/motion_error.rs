//! Reasons why a plant cannot continue.

use super::impact::EndlessImpact;
use crate::plant::ContactMode;

/// Why the plant cannot continue.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The integrator would need steps below the rounding error of the time.
    #[error("the plant's step size vanished at t = {time_s} s in mode {mode:?}")]
    StepVanished {
        /// Time, s.
        time_s: f64,
        /// Contact mode.
        mode: ContactMode,
    },
    /// The integrator needs so many steps that the run would take hours.
    #[error(
        "the plant is too stiff: far more than 500,000 integration steps a second by t = {time_s} s; give its arm less damping or stiffness for its masses, its contact less stiffness or damping, or its integration a larger tolerance (`contact.local_error`, `solver.relative_tolerance`)"
    )]
    TooStiff {
        /// Time, s.
        time_s: f64,
    },
    /// Events follow one another without time passing.
    #[error("endless contact events at t = {time_s} s")]
    EventsWithoutEnd {
        /// Time, s.
        time_s: f64,
    },
    /// A collision has no solution.
    #[error("at t = {time_s} s: {source}")]
    EndlessImpact {
        /// Time, s.
        time_s: f64,
        /// The unsolvable collision.
        source: EndlessImpact,
    },
}
