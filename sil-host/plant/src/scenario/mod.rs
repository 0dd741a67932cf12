//! A scenario: everything that defines a run, as a TOML file with units in the
//! key names.
//!
//! Every key has a default (the run of `hybrid-elbow-down`), unknown keys are
//! refused, and every number is checked before anything starts.

pub mod built_in;
mod load;

use painleve_firmware::Configuration;
use painleve_firmware::configuration::ControllerSettings;
use painleve_shared::ArmParameters;
use painleve_shared::range::{self, OutOfRange};
use serde::{Deserialize, Serialize};

use crate::converters::ConverterSettings;
use crate::mechanics::belt::BeltProfile;
use crate::mechanics::impact::ImpactLaw;
use crate::mechanics::{PlantParameters, SolverSettings};
use crate::plant::State;

pub use load::ScenarioError;

/// Everything that defines a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// Short name, for reports and files.
    pub name: String,
    /// One sentence about the run.
    pub description: String,
    /// How long, how fast, which seed.
    pub run: RunSettings,
    /// The arm of the plant.
    pub arm: ArmParameters<f64>,
    /// The arm in the controller's model; the plant's if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm_model: Option<ArmParameters<f32>>,
    /// Friction and speed of the belt.
    pub belt: BeltSettings,
    /// How the tip bounces.
    pub impact: ImpactLaw,
    /// Accuracy of the plant.
    pub solver: SolverSettings,
    /// Where the arm starts.
    pub initial: InitialState,
    /// Encoders, force cell and torque stages.
    pub converters: ConverterSettings,
    /// The controller.
    pub controller: ControllerSettings,
}

/// How long, how fast, which seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunSettings {
    /// Simulated time, s.
    pub duration_s: f64,
    /// Control rate, Hz.
    pub tick_hz: u32,
    /// When ENABLE rises, s.
    pub enable_at_s: f64,
    /// Seed of all noise.
    pub seed: u64,
    /// Tick and sequence number of the first frame: near 2³² the counters wrap early.
    pub first_tick: u32,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            duration_s: 6.0,
            tick_hz: 1000,
            enable_at_s: 0.0,
            seed: 1,
            first_tick: 0,
        }
    }
}

impl RunSettings {
    /// Control ticks of the whole run.
    pub fn ticks(&self) -> u64 {
        (self.duration_s * f64::from(self.tick_hz)).round() as u64
    }
}

/// Friction and speed of the belt.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BeltSettings {
    /// Friction coefficient μ.
    pub friction: f64,
    /// Speed over time.
    pub profile: BeltProfile,
}

impl Default for BeltSettings {
    fn default() -> Self {
        Self {
            friction: 0.6,
            profile: BeltProfile::default(),
        }
    }
}

/// Where the arm starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InitialState {
    /// θ1, degrees from the belt's inward normal.
    pub theta1_deg: f64,
    /// θ2, degrees from the belt's inward normal.
    pub theta2_deg: f64,
    /// θ̇1, rad/s.
    pub theta1_dot_rad_s: f64,
    /// θ̇2, rad/s.
    pub theta2_dot_rad_s: f64,
}

impl Default for InitialState {
    /// The paper's x0,d.
    fn default() -> Self {
        Self::at_rest(-11.4, -35.1)
    }
}

impl InitialState {
    /// An arm at rest with these angles from the belt's inward normal, degrees.
    pub fn at_rest(theta1_deg: f64, theta2_deg: f64) -> Self {
        Self {
            theta1_deg,
            theta2_deg,
            theta1_dot_rad_s: 0.0,
            theta2_dot_rad_s: 0.0,
        }
    }

    /// As the plant's state.
    pub fn state(&self) -> State {
        State::new(
            self.theta1_deg.to_radians(),
            self.theta2_deg.to_radians(),
            self.theta1_dot_rad_s,
            self.theta2_dot_rad_s,
        )
    }
}

impl Default for Scenario {
    /// The paper's hybrid law from x0,d at hardware-like quantisation.
    fn default() -> Self {
        Self {
            name: "unnamed".into(),
            description: String::new(),
            run: RunSettings::default(),
            arm: ArmParameters::default(),
            arm_model: None,
            belt: BeltSettings::default(),
            impact: ImpactLaw::default(),
            solver: SolverSettings::default(),
            initial: InitialState::default(),
            converters: ConverterSettings::default(),
            controller: ControllerSettings::default(),
        }
    }
}

impl Scenario {
    /// The plant's part.
    pub fn plant_parameters(&self) -> PlantParameters {
        PlantParameters {
            arm: self.arm,
            friction: self.belt.friction,
            belt: self.belt.profile,
            impact: self.impact,
            solver: self.solver,
        }
    }

    /// The controller's part, as it is sent to whatever runs the controller.
    pub fn controller_configuration(&self) -> Configuration {
        Configuration {
            tick_hz: self.run.tick_hz as f32,
            arm: self.arm_model.unwrap_or_else(|| self.arm.cast()),
            converters: self.converters.scales(),
            settings: self.controller.clone(),
        }
    }

    /// Checks every number, the plant's initial state excepted (see
    /// [`ArmOnBelt::new`](crate::mechanics::ArmOnBelt::new)).
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        range::check("run.duration_s", self.run.duration_s, 1e-3, 1e7)?;
        range::check("run.tick_hz", f64::from(self.run.tick_hz), 10.0, 1e5)?;
        range::check("run.enable_at_s", self.run.enable_at_s, 0.0, 1e7)?;
        self.arm.validate()?;
        self.converters.validate()?;
        self.controller_configuration()
            .validate()
            .map_err(|error| self.in_scenario(error))?;
        Ok(())
    }

    /// An error of the controller's configuration with the key that the setting has here.
    fn in_scenario(&self, error: OutOfRange) -> OutOfRange {
        match error.key.parts().next() {
            Some("tick_hz") => error.inside("run"),
            Some("converters") => error,
            Some(name) if name.starts_with("arm.") => error,
            _ => error.inside("controller"),
        }
    }
}
