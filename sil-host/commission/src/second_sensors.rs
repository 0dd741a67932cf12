//! Commissioning of the second sensors of an arm: the same procedure, with them in place of the first ones.
//!
//! Only their directions are kept. Their zeros are not needed, since the board measures the difference of the two
//! sensors of a channel while the drive is off.

use painleve_plant::scenario::Scenario;
use painleve_shared::mounting::{Mounting, SensorParts};

use crate::{Commissioned, Deviation, Mistake};

/// Returns a scenario whose first sensors are the second ones of this. The correction is that of the first encoders.
pub fn in_place_of_first(scenario: &Scenario) -> Scenario {
    let mut swapped = scenario.clone();
    let mounting = scenario.converters.mounting;
    swapped.controller.estimator.encoders = Default::default();
    swapped.converters.mounting = Mounting {
        sensors: SensorParts::Second,
        encoder_reversed: mounting.second_encoder_reversed,
        force_reversed: mounting.second_force_reversed,
        ..mounting
    };
    swapped
}

/// Directions of the second sensors as measured.
#[derive(Clone, Debug, PartialEq)]
pub struct SecondSensors {
    encoder_reversed: [bool; 2],
    force_reversed: [bool; 2],
    /// Deviations from the scenario that the result corrects.
    pub deviations: Vec<Deviation>,
}

impl SecondSensors {
    /// Takes what was found with the second sensors [in place of the first](in_place_of_first) ones of `scenario`.
    ///
    /// # Errors
    /// [`Mistake::NotCommissioned`] if a torque stage turns its joint in another direction than the scenario says: the first
    /// sensors' directions are no better.
    pub fn new(found: &Commissioned, scenario: &Scenario) -> Result<Self, Mistake> {
        for deviation in &found.deviations {
            if let Deviation::StageDirection { joint } = *deviation {
                return Err(Mistake::NotCommissioned { joint });
            }
        }
        let Mounting {
            encoder_reversed,
            force_reversed,
            ..
        } = found.mounting;
        let expected = &scenario.converters.mounting;
        let different = |found: [bool; 2], expected: [bool; 2]| {
            (0..2).filter(move |index| found[*index] != expected[*index])
        };
        let encoders = different(encoder_reversed, expected.second_encoder_reversed)
            .map(|joint| Deviation::SecondEncoderDirection { joint });
        let forces = different(force_reversed, expected.second_force_reversed)
            .map(|axis| Deviation::SecondForceDirection { axis });
        let deviations = encoders.chain(forces).collect();
        Ok(Self {
            encoder_reversed,
            force_reversed,
            deviations,
        })
    }

    /// Returns the scenario with the measured directions, and with both sensors of each channel in use.
    pub fn applied_to(&self, scenario: &Scenario) -> Scenario {
        let mut corrected = scenario.clone();
        let mounting = &mut corrected.converters.mounting;
        mounting.sensors = SensorParts::Both;
        mounting.second_encoder_reversed = self.encoder_reversed;
        mounting.second_force_reversed = self.force_reversed;
        corrected
    }
}

#[cfg(test)]
mod tests {
    use painleve_plant::scenario::built_in;

    use super::*;
    use crate::simulated::SimulatedRig;
    use crate::{Expected, commission};

    #[test]
    fn every_direction_of_the_second_sensors_is_found() {
        let scenario = Scenario::load(built_in::DEFAULT, &[]).unwrap();
        for number in 0..16_u8 {
            let bit = |index: u8| number >> index & 1 != 0;
            let mut actual = scenario.clone();
            let mounting = &mut actual.converters.mounting;
            // The first sensors' directions do not matter.
            mounting.encoder_reversed = [true, false];
            mounting.second_encoder_reversed = [bit(0), bit(1)];
            mounting.second_force_reversed = [bit(2), bit(3)];
            let mut rig = SimulatedRig::new(&in_place_of_first(&actual), None, number.into());
            let expected = Expected::new(&in_place_of_first(&scenario), 1.0).unwrap();
            let found = commission(&mut rig, &expected).unwrap();
            let second = SecondSensors::new(&found, &scenario).unwrap();
            assert_eq!(second.deviations.len() as u32, number.count_ones());
            let corrected = second.applied_to(&scenario).converters.mounting;
            let actual = actual.converters.mounting;
            assert_eq!(corrected.sensors, SensorParts::Both);
            assert_eq!(
                (
                    corrected.second_encoder_reversed,
                    corrected.second_force_reversed
                ),
                (actual.second_encoder_reversed, actual.second_force_reversed)
            );
            assert_eq!(corrected.encoder_reversed, [false; 2]);
        }
    }

    #[test]
    fn an_arm_whose_stages_are_not_as_described_is_refused() {
        let scenario = Scenario::load(built_in::DEFAULT, &[]).unwrap();
        let mut actual = in_place_of_first(&scenario);
        actual.converters.mounting.stage_reversed = [false, true];
        let mut rig = SimulatedRig::new(&actual, None, 1);
        let expected = Expected::new(&in_place_of_first(&scenario), 1.0).unwrap();
        let found = commission(&mut rig, &expected).unwrap();
        assert_eq!(
            SecondSensors::new(&found, &scenario),
            Err(Mistake::NotCommissioned { joint: 1 })
        );
    }
}
