//! What defines the plant's equations, and how accurately they are solved.

use painleve_shared::ArmParameters;
use painleve_shared::range::{self, OutOfRange};
use serde::{Deserialize, Serialize};

use super::belt::BeltProfile;
use super::impact::ImpactLaw;
use super::transition::Indeterminate;

/// Everything that defines the plant's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantParameters {
    /// The arm.
    pub arm: ArmParameters<f64>,
    /// Friction coefficient μ between tip and belt.
    pub friction: f64,
    /// The belt's speed.
    pub belt: BeltProfile,
    /// How the tip bounces.
    pub impact: ImpactLaw,
    /// Accuracy and conventions.
    pub solver: SolverSettings,
}

impl Default for PlantParameters {
    /// The paper's section III: Table I, μ = 0.6, v_belt = −0.4 m/s.
    fn default() -> Self {
        Self {
            arm: ArmParameters::default(),
            friction: 0.6,
            belt: BeltProfile::default(),
            impact: ImpactLaw::default(),
            solver: SolverSettings::default(),
        }
    }
}

/// Accuracy of the solution and conventions where the model leaves a choice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SolverSettings {
    /// Error of one step relative to the state.
    pub relative_tolerance: f64,
    /// Error of one step, rad and rad/s.
    pub absolute_tolerance: f64,
    /// Largest step, s.
    pub maximum_step_s: f64,
    /// A rebound slower than this ends a series of bounces, m/s.
    pub chatter_speed_m_s: f64,
    /// What follows where both sliding and flight are solutions.
    pub indeterminate: Indeterminate,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-9,
            absolute_tolerance: 1e-10,
            maximum_step_s: 0.05,
            // The last bounces lower than 1e-13 m, below rounding of the gap.
            chatter_speed_m_s: 1e-6,
            indeterminate: Indeterminate::Flight,
        }
    }
}

impl SolverSettings {
    pub(super) fn validate(&self) -> Result<(), OutOfRange> {
        range::check(
            "solver.relative_tolerance",
            self.relative_tolerance,
            1e-13,
            1e-3,
        )?;
        range::check(
            "solver.absolute_tolerance",
            self.absolute_tolerance,
            1e-14,
            1e-3,
        )?;
        range::check("solver.maximum_step_s", self.maximum_step_s, 1e-5, 1.0)?;
        range::check(
            "solver.chatter_speed_m_s",
            self.chatter_speed_m_s,
            1e-8,
            1e-2,
        )
    }
}
