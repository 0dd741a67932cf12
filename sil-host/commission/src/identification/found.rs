//! What slides have shown of an arm, and the scenario that says so.

use painleve_firmware::law::LawSettings;
use painleve_identify::forces::{friction, ripple_m_s2};
use painleve_identify::torques::{Estimate, Joints};
use painleve_identify::{Identified, Parameter, Prior, Refusal, Slide};
use painleve_plant::scenario::{Knowledge, Scenario};
use painleve_shared::{Arm, ArmParameters};

use super::known::{of_geometry, rounded, setting, terms, told_m};
use super::limits;

/// Multiple of the ripple's root mean square that the wanted normal force must exceed in use.
const RIPPLES: f64 = 8.0;

/// Largest deviation of a joint's friction or stiffness, as a part of the larger of its values before and now, with which the
/// new value is better than the old one.
const BETTER: f64 = 0.5;

/// An identified arm.
#[derive(Clone, Debug)]
pub struct Found {
    /// The result.
    pub identified: Identified,
    /// What was known before.
    pub prior: Prior,
    /// What the torques show.
    pub joints: Joints,
    /// Acceleration of the tip off the belt by what the controller does not know, root mean square, m/s²: the ripple of the
    /// normal force times p. Zero without a reading on the belt.
    pub ripple_m_s2: f64,
    /// Friction coefficient of the tip on the belt; not a number if the belt has carried the tip all the time.
    pub friction: f64,
    /// The same by the scenario.
    pub told_friction: f64,
}

impl Found {
    pub(super) fn new(
        identified: Identified,
        prior: Prior,
        slides: &[Slide],
        scenario: &Scenario,
    ) -> Result<Self, Refusal> {
        let geometry = &identified.fit.parameters;
        let known = ArmParameters {
            link_length_m: geometry.link_length_m(),
            height_m: geometry.get(Parameter::Height),
            ..scenario.controller_configuration().arm.cast()
        };
        let limits = limits(scenario);
        let tick_hz = f64::from(scenario.run.tick_hz);
        let joints = Joints::of(slides, geometry, &known, tick_hz, &limits)?;
        joints.check()?;
        let arm = Arm::new(known)?;
        Ok(Self {
            joints,
            friction: friction(slides, geometry, &arm, tick_hz, &limits),
            told_friction: scenario.belt.friction,
            ripple_m_s2: ripple_m_s2(slides, geometry, &arm, tick_hz, &limits),
            identified,
            prior,
        })
    }

    /// Returns the scenario with the values and deviations. `source` says where they come from.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] for a value that the controller does not take.
    pub fn applied_to(&self, scenario: &Scenario, source: &str) -> Result<Scenario, Refusal> {
        let fit = &self.identified.fit;
        let parameters = &fit.parameters;
        let mut corrected = scenario.clone();
        let mut arm = scenario.controller_configuration().arm;
        arm.link_length_m = parameters.link_length_m().map(|it| rounded(it) as f32);
        arm.height_m = rounded(parameters.get(Parameter::Height)) as f32;
        let Knowledge {
            mut coulomb_friction_nm,
            mut stiffness_nm_rad,
            ..
        } = scenario.knowledge;
        // Torques that show nothing leave what was known.
        let has_torques = self.joints.left_over_nm.is_some();
        for (joint, found) in self.joints.joints.iter().enumerate() {
            for (value, deviation, estimate) in [
                (
                    &mut arm.coulomb_friction_nm[joint],
                    &mut coulomb_friction_nm[joint],
                    found.friction_nm,
                ),
                (
                    &mut arm.stiffness_nm_rad[joint],
                    &mut stiffness_nm_rad[joint],
                    found.stiffness_nm_rad,
                ),
            ] {
                if has_torques && is_better(estimate, *value) {
                    *value = rounded(estimate.value).max(0.0) as f32;
                    *deviation = rounded(estimate.deviation);
                }
            }
        }
        corrected.arm_model = Some(arm);
        let estimator = &mut corrected.controller.estimator;
        for (parameter, values_rad) in terms(&mut estimator.encoders) {
            *values_rad = [0, 1].map(|joint| rounded(parameters.get(parameter(joint))) as f32);
        }
        let deviation_m = libm::hypot(self.identified.tip_deviation_m, told_m(scenario));
        estimator.tip_deviation_m = setting(deviation_m);
        let ripple_m_s2 = self.ripple_m_s2;
        if let Some(LawSettings::Hybrid(law)) = corrected.controller.law.of_set() {
            let least = RIPPLES * ripple_m_s2 / f64::from(law.normal_force_n).max(1e-3);
            corrected.controller.governor.p_per_kg = rounded(least) as f32;
        }
        corrected.knowledge = Knowledge {
            source: source.into(),
            tip_m: rounded(self.identified.place_deviation_m),
            told_m: rounded(told_m(scenario)),
            off_line_m: rounded(self.identified.off_line_m[1]),
            ripple_m_s2: rounded(ripple_m_s2),
            coulomb_friction_nm,
            stiffness_nm_rad,
            ..of_geometry(parameters, |parameter| fit.deviation(parameter))
        };
        painleve_shared::settings::Settings::validate(&corrected)?;
        Ok(corrected)
    }
}

/// Returns whether a value found is better than the one before; it may be known so badly that it is not.
fn is_better(found: Estimate, before: f32) -> bool {
    found.deviation <= BETTER * found.value.max(f64::from(before))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_known_badly_does_not_replace_another() {
        let found = |value, deviation| Estimate { value, deviation };
        // No friction to speak of, where there was said to be some; then the other way round, and nothing known.
        assert!(is_better(found(0.001, 0.002), 0.05));
        assert!(is_better(found(0.06, 0.004), 0.0));
        assert!(!is_better(found(0.3, 0.4), 0.05));
        assert!(!is_better(found(-0.01, 0.02), 0.0));
    }
}
