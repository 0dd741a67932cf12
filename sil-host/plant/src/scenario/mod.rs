//! A scenario: everything that defines a run, as a TOML file with units in the
//! key names.
//!
//! Every key has a default (the run of `hybrid-elbow-down`), unknown keys are
//! refused, and every number is checked before anything starts.

pub mod built_in;
pub mod describe;
mod load;

use painleve_firmware::configuration::ControllerSettings;
use painleve_shared::{ArmParameters, OutOfRange, settings};

use crate::Configuration;
use crate::converters::ConverterSettings;
use crate::law_choice::LawChoice;
use crate::mechanics::compliant::TipContact;
use crate::mechanics::effects::Effects;
use crate::mechanics::impact::ImpactLaw;
use crate::mechanics::{PlantParameters, SolverSettings};

pub use crate::mechanics::InitialState;
pub use crate::mechanics::belt::BeltSettings;
pub use load::ScenarioError;

settings! {
    /// Everything that defines a run. By default the paper's hybrid law from x0,d at hardware-like
    /// quantisation.
    pub struct Scenario {
        /// Short name, for reports and files.
        name: String = "unnamed".into();
        /// One sentence about the run.
        description: String = String::new();
        /// How long, how fast, which seed.
        run: RunSettings = RunSettings::default();
        /// The arm of the plant.
        arm: ArmParameters<f64> = ArmParameters::default();
        /// The arm in the controller's model; the plant's if absent.
        arm_model: Option<ArmParameters<f32>> = None;
        /// Friction and speed of the belt.
        belt: BeltSettings = BeltSettings::default();
        /// How the tip bounces.
        impact: ImpactLaw = ImpactLaw::default();
        /// Rigid or compliant contact.
        contact: TipContact = TipContact::default();
        /// What a rig has and the paper's arm has not.
        effects: Effects = Effects::default();
        /// Accuracy of the plant.
        solver: SolverSettings = SolverSettings::default();
        /// Where the arm starts.
        initial: InitialState = InitialState::default();
        /// Encoders, force cell and torque stages.
        converters: ConverterSettings = ConverterSettings::default();
        /// The controller.
        controller: ControllerSettings<LawChoice> = ControllerSettings::default();
    }
    check Self::relations;
}

settings! {
    /// How long, how fast, which seed.
    #[derive(Copy)]
    pub struct RunSettings {
        /// Simulated time.
        duration_s: f64 = 6.0, 1e-3..=1e7, "s";
        /// Control rate.
        tick_hz: u32 = 1000, 10..=100_000, "Hz";
        /// When ENABLE rises.
        enable_at_s: f64 = 0.0, 0.0..=1e7, "s";
        /// Seed of all noise.
        seed: u64 = 1;
        /// Tick and sequence number of the first frame: near 2³² the counters wrap early.
        first_tick: u32 = 0;
    }
}

impl RunSettings {
    /// Control ticks of the whole run.
    pub fn ticks(&self) -> u64 {
        (self.duration_s * f64::from(self.tick_hz)).round() as u64
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

    /// Checks what one part allows another.
    fn relations(&self) -> Result<(), OutOfRange> {
        self.controller_configuration()
            .validate()
            .map_err(in_scenario)?;
        Ok(())
    }
}

/// An error of the controller's configuration with the key that the setting has in a scenario.
fn in_scenario(error: OutOfRange) -> OutOfRange {
    match error.key.parts().next() {
        Some("tick_hz") => error.inside("run"),
        // The settings of the arm and of the converters have been checked under their own keys.
        Some("arm" | "converters") => error,
        _ => error.inside("controller"),
    }
}
