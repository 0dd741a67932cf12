//! The scenario of one run, drawn at random, with one effect at one level.

use core::ops::Range;

use painleve_plant::scenario::Scenario;
use painleve_shared::{Arm, Posture};
use painleve_study_core::StudyError;
use painleve_study_core::case;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::effect::Drawn;
use super::{Contact, EffectCell, EffectsStudy};
use crate::robustness::Journey;

/// Smallest p at the target as a fraction of Q22 where friction changes.
const TARGET_P_RATIO: f64 = 0.2;
/// Farthest target as a fraction of the reach: 0.183 m of the paper's arm.
const FARTHEST: f64 = 0.994;

impl EffectsStudy {
    /// Returns the scenario of a run of a cell. All cells draw equal values for equal runs.
    ///
    /// # Errors
    /// [`StudyError`] if an override is invalid.
    pub fn scenario(&self, place: EffectCell<'_>, run: usize) -> Result<Scenario, StudyError> {
        let mut generator = ChaCha8Rng::seed_from_u64(self.seed);
        generator.set_stream(run as u64);
        let mut draw = |range: Range<f64>| generator.random_range(range);
        let friction = draw(0.3..0.9);
        let speed_m_s = draw(0.1..1.0) * if draw(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
        let posture = if draw(0.0..1.0) < 0.5 {
            Posture::ElbowDown
        } else {
            Posture::ElbowUp
        };
        let belt = [
            format!("belt.friction={friction:?}"),
            format!("belt.profile={{ kind = 'constant', speed_m_s = {speed_m_s:?} }}"),
        ];
        let converters = place.controller.usual_converters();
        let mut scenario = case::scenario(place.controller, posture, converters, &belt)?;
        let drawn = Drawn {
            arm: scenario.arm,
            friction,
            speed_m_s,
            at_s: draw(0.8..3.0),
            share: draw(0.0..1.0),
            phase_rad: draw(0.0..core::f64::consts::TAU),
            seed: draw(0.0..9e15) as u64,
        };
        let noise_seed = draw(0.0..9e15) as u64;
        let (effect, level) = (place.effect, place.level);
        scenario.name = format!("{}-{level}-{}-{run}", effect.name, self.seed);
        scenario.run.seed = noise_seed;
        let mut overrides = match place.contact {
            Contact::Rigid => Vec::new(),
            Contact::Compliant => vec!["contact.kind=compliant".to_owned()],
        };
        overrides.extend(effect.overrides(level, &drawn));
        // What the effect does not change of the controller's model is this arm's.
        if overrides.iter().any(|text| text.starts_with("arm_model.")) {
            scenario.arm_model.get_or_insert(scenario.arm.cast());
        }
        overrides.extend(self.overrides.iter().cloned());
        let origin = format!("effect {} at level {level}", effect.name);
        let mut scenario = scenario.with_overrides(&origin, &overrides)?;

        let arm = Arm::new(scenario.moving_arm())?;
        let friction = scenario.belt.friction;
        let journey = Journey {
            arm: &arm,
            posture,
            slip: scenario.slip_at_rest(),
            friction: effect
                .largest_friction
                .map_or(friction, |largest| largest(level, friction)),
            target_p_ratio: effect.largest_friction.map_or(0.0, |_| TARGET_P_RATIO),
            farthest_m: FARTHEST * arm.reach_on_belt_m(),
        };
        journey.draw(&mut scenario, &mut draw)?;
        Ok(scenario)
    }
}
