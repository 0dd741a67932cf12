//! A scenario: the complete definition of a run, as a TOML file with units in the key names.
//!
//! Every key has a default (the run of `hybrid-elbow-down`), unknown keys are rejected, and every
//! number is checked before a run starts.

pub mod built_in;
pub mod describe;
mod error;
mod initial_key;
mod knowledge;
mod load;
mod override_key;
mod plant;
mod reference_file;
mod table;
mod words;

use painleve_firmware::configuration::ControllerSettings;
use painleve_shared::{ArmParameters, OutOfRange, Slip, settings};
use serde::Deserialize;
use serde_path_to_error::{Deserializer, Path, Track};
use toml::{Table, Value};

use crate::Configuration;
use crate::converters::ConverterSettings;
use crate::decimal::as_written;
use crate::law_choice::LawChoice;
use crate::mechanics::compliant::TipContact;
use crate::mechanics::effects::Effects;
use crate::mechanics::impact::ImpactLaw;
use crate::mechanics::{PlantParameters, SolverSettings};

pub use crate::mechanics::belt::BeltSettings;
pub use crate::mechanics::{Elbow, InitialState};
pub use error::{KeyError, ScenarioError};
pub use knowledge::Knowledge;
pub use override_key::{first_outside, sets};
pub use words::{TomlError, known_names};

settings! {
    /// The complete definition of a run. The default is the paper's hybrid law from x0,d with
    /// quantisation as on hardware.
    pub struct Scenario {
        /// Short name, for reports and files.
        name: String = "unnamed".into();
        /// One sentence about the run.
        description: String = String::new();
        /// Duration, control rate and seed.
        run: RunSettings = RunSettings::default();
        /// The arm of the plant.
        arm: ArmParameters<f64> = ArmParameters::default();
        /// The arm in the controller's model; the plant's if absent.
        arm_model: Option<ArmParameters<f32>> = None;
        /// Friction and speed of the belt.
        belt: BeltSettings = BeltSettings::default();
        /// Restitution of impacts.
        impact: ImpactLaw = ImpactLaw::default();
        /// Rigid or compliant contact.
        contact: TipContact = TipContact::default();
        /// Effects of a real rig that the paper's arm lacks.
        effects: Effects = Effects::default();
        /// Accuracy of the plant's solution.
        solver: SolverSettings = SolverSettings::default();
        /// Initial state of the arm.
        initial: InitialState = InitialState::default();
        /// Encoders, force cell and torque stages.
        converters: ConverterSettings = ConverterSettings::default();
        /// The controller.
        controller: ControllerSettings<LawChoice> = ControllerSettings::default();
        /// How well the geometry of a real arm is known. It stands last: a file that was cut off vouches for nothing.
        knowledge: Knowledge = Knowledge::default();
    }
    check Self::relations;
}

settings! {
    /// Duration, control rate and seed.
    #[derive(Copy)]
    pub struct RunSettings {
        /// Simulated time.
        duration_s: f64 = 6.0, 1e-3..=1e7, "s";
        /// Control rate.
        tick_hz: u32 = 1000, 10..=100_000, "Hz";
        /// Time at which ENABLE rises.
        enable_at_s: f64 = 0.0, 0.0..=1e7, "s";
        /// Seed of all noise.
        seed: u64 = 1;
        /// Tick and sequence number of the first frame; near 2³² the counters wrap early.
        first_tick: u32 = 0;
        /// Largest lateness of a tick, in tick periods; each tick's is drawn uniformly from zero to this.
        tick_jitter: f64 = 0.0, 0.0..=0.9, "ticks";
    }
}

impl RunSettings {
    /// Returns the number of control ticks of the whole run.
    pub fn ticks(&self) -> u64 {
        (self.duration_s * f64::from(self.tick_hz)).round() as u64
    }
}

impl Scenario {
    /// Returns the plant's parameters.
    pub fn plant_parameters(&self) -> PlantParameters {
        PlantParameters {
            arm: self.arm,
            friction: self.belt.friction,
            belt: self.belt.profile.clone(),
            impact: self.impact,
            solver: self.solver,
        }
    }

    /// Returns the direction in which a resting tip slips at the start.
    pub fn slip_at_rest(&self) -> Slip {
        Slip::of(-self.belt.profile.speed_m_s(0.0))
    }

    /// Returns the arm as it moves: with the rotors of its elastic gears, which follow the joints below the gears'
    /// resonance. Their inertia is part of p, and with it of the edge.
    pub fn moving_arm(&self) -> ArmParameters<f64> {
        let mut arm = self.arm;
        let gear = &self.effects.gear;
        if gear.elastic {
            for rotor_kg_m2 in &mut arm.rotor_inertia_kg_m2 {
                *rotor_kg_m2 += gear.rotor_inertia_kg_m2;
            }
        }
        arm
    }

    /// Returns the controller's configuration, as it is sent to the host of the controller.
    pub fn controller_configuration(&self) -> Configuration {
        Configuration {
            tick_hz: self.run.tick_hz as f32,
            arm: self.arm_model.unwrap_or_else(|| self.arm.cast()),
            converters: self.converters.scales(),
            settings: self.controller.clone(),
        }
    }

    /// Returns the target of the last part of the reference that has one, m.
    pub fn target_m(&self) -> Option<f64> {
        let segments = self.controller.reference.segments.iter();
        segments
            .rev()
            .find_map(|segment| segment.target_m())
            .map(as_written)
    }

    /// Reads a scenario from a table; an error has the path of its key. All scenarios are read here, because each type of
    /// setting is compiled once for each type of deserializer.
    fn from_keys(table: Table) -> Result<Self, (Path, Box<toml::de::Error>)> {
        let mut track = Track::new();
        let keys = Deserializer::new(Value::Table(table), &mut track);
        Self::deserialize(keys).map_err(|error| (track.path(), Box::new(error)))
    }

    /// Checks the limits that depend on several parts.
    fn relations(&self) -> Result<(), OutOfRange> {
        let run = &self.run;
        if run.ticks() == 0 {
            let too_short = OutOfRange {
                value: run.duration_s,
                minimum: 0.5 / f64::from(run.tick_hz),
                maximum: 1e7,
                ..OutOfRange::default()
            };
            return Err(too_short.inside("duration_s").inside("run"));
        }
        self.controller_configuration()
            .validate()
            .map_err(in_scenario)?;
        Ok(())
    }
}

/// Returns an error of the controller's configuration with the key that the setting has in a
/// scenario.
fn in_scenario(error: OutOfRange) -> OutOfRange {
    match error.key.parts().next() {
        Some("tick_hz") => error.inside("run"),
        // The settings of the arm and of the converters have been checked under their own keys.
        Some("arm" | "converters") => error,
        _ => error.inside("controller"),
    }
}
