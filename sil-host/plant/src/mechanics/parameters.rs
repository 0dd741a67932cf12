//! Parameters of the plant's equations, and the accuracy of their solution.

use painleve_shared::kinematics::Posture;
use painleve_shared::settings::Settings;
use painleve_shared::{Arm, ArmParameters, OutOfRange, settings};

use super::belt::{BeltProfile, BeltSettings};
use super::impact::ImpactLaw;
use super::transition::Indeterminate;
use crate::plant::State;

/// All parameters of the plant's equations.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantParameters {
    /// The arm.
    pub arm: ArmParameters<f64>,
    /// Friction coefficient μ between tip and belt.
    pub friction: f64,
    /// The belt's speed.
    pub belt: BeltProfile,
    /// Restitution of impacts.
    pub impact: ImpactLaw,
    /// Accuracy and conventions.
    pub solver: SolverSettings,
}

impl Default for PlantParameters {
    /// Returns the parameters of the paper's section III: Table I, μ = 0.6, v_belt = −0.4 m/s.
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

impl PlantParameters {
    /// Checks everything except the arm, which [`Arm::new`](painleve_shared::Arm::new) checks.
    ///
    /// # Errors
    /// [`OutOfRange`] with the key that the parameter has in a scenario.
    pub(super) fn validate(&self) -> Result<(), OutOfRange> {
        let belt = BeltSettings {
            friction: self.friction,
            profile: self.belt.clone(),
        };
        belt.validate().map_err(|error| error.inside("belt"))?;
        let impact = self.impact.validate();
        impact.map_err(|error| error.inside("impact"))?;
        let solver = self.solver.validate();
        solver.map_err(|error| error.inside("solver"))
    }
}

settings! {
    /// Accuracy of the solution, and conventions for ambiguities of the model.
    #[derive(Copy)]
    pub struct SolverSettings {
        /// Error of one step relative to the state. Rigid contact only.
        relative_tolerance: f64 = 1e-9, 1e-13..=1e-3;
        /// Error of one step, rad and rad/s. Rigid contact only.
        absolute_tolerance: f64 = 1e-10, 1e-14..=1e-3;
        /// Largest step. Rigid contact only.
        maximum_step_s: f64 = 0.05, 1e-5..=1.0, "s";
        // With the default, the last bounces are lower than the rounding error of the gap.
        /// A rebound slower than this ends a series of bounces. Rigid contact only.
        chatter_speed_m_s: f64 = 1e-6, 1e-7..=1e-2, "m/s";
        /// What follows if both sliding and flight are solutions. Rigid contact only.
        indeterminate: Indeterminate = Indeterminate::Flight;
    }
}

settings! {
    /// Initial state of the arm: two angles, or the tip's place on the belt; the default is the paper's x0,d.
    #[derive(Copy)]
    pub struct InitialState {
        /// θ1, measured from the belt's inward normal; −11.4° if absent.
        theta1_deg: Option<f64> = None, -180.0..=180.0, "°";
        /// θ2, measured from the belt's inward normal; −35.1° if absent.
        theta2_deg: Option<f64> = None, -180.0..=180.0, "°";
        /// Place z_t of a tip on the belt, instead of both angles.
        tip_m: Option<f64> = None, -20.0..=20.0, "m";
        /// Side of the elbow, with `tip_m`; down if absent.
        elbow: Option<Elbow> = None;
        /// θ̇1.
        theta1_dot_rad_s: f64 = 0.0, -314.0..=314.0, "rad/s";
        /// θ̇2.
        theta2_dot_rad_s: f64 = 0.0, -314.0..=314.0, "rad/s";
    }
}

settings! {
    /// The side to which the elbow bends.
    #[derive(Copy, Eq)]
    pub enum Elbow = Down {
        /// θ2 < θ1.
        "down" => Down,
        /// θ2 > θ1.
        "up" => Up,
    }
}

impl From<Elbow> for Posture {
    fn from(elbow: Elbow) -> Self {
        match elbow {
            Elbow::Down => Self::ElbowDown,
            Elbow::Up => Self::ElbowUp,
        }
    }
}

/// Returns how far along the belt an arm reaches in whole micrometres, as messages give it, m.
pub fn printed_reach_m(arm: &Arm<f64>) -> f64 {
    (1e6 * arm.reach_on_belt_m()).floor() / 1e6
}

impl InitialState {
    /// θ1 and θ2 of the paper's x0,d, degrees.
    pub const X0_D_DEG: [f64; 2] = [-11.4, -35.1];

    /// Returns an arm at rest with these angles from the belt's inward normal, degrees.
    pub fn at_rest(theta1_deg: f64, theta2_deg: f64) -> Self {
        Self {
            theta1_deg: Some(theta1_deg),
            theta2_deg: Some(theta2_deg),
            ..Self::default()
        }
    }

    /// Returns the state of an arm with these parameters.
    ///
    /// # Errors
    /// [`OutOfRange`] if the arm does not reach [`tip_m`](Self::tip_m), or cannot be built.
    pub fn state(&self, arm: &ArmParameters<f64>) -> Result<State, OutOfRange> {
        let [theta_1, theta_2] = match self.tip_m {
            Some(tip_m) => {
                let arm = Arm::new(*arm)?;
                let reach_m = printed_reach_m(&arm);
                let unreachable = OutOfRange {
                    value: tip_m,
                    minimum: -reach_m,
                    maximum: reach_m,
                    ..OutOfRange::default()
                };
                let theta =
                    arm.link_angles_on_belt_rad(tip_m, self.elbow.unwrap_or_default().into());
                theta
                    .ok_or_else(|| unreachable.inside("tip_m").inside("initial"))?
                    .to_array()
            }
            None => {
                let [theta_1, theta_2] = Self::X0_D_DEG;
                let given = [
                    self.theta1_deg.unwrap_or(theta_1),
                    self.theta2_deg.unwrap_or(theta_2),
                ];
                given.map(f64::to_radians)
            }
        };
        Ok(State::new(
            theta_1,
            theta_2,
            self.theta1_dot_rad_s,
            self.theta2_dot_rad_s,
        ))
    }
}

impl From<&State> for InitialState {
    fn from(state: &State) -> Self {
        Self {
            theta1_dot_rad_s: state[2],
            theta2_dot_rad_s: state[3],
            ..Self::at_rest(state[0].to_degrees(), state[1].to_degrees())
        }
    }
}
