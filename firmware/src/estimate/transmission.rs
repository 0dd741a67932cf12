//! Friction and gears of the joints.
//!
//! The Coulomb friction of a joint follows its travel Δ (Dahl's model): F ← F + (F_c Δ − |Δ| F)/travel.
//! It keeps its value at rest, and changes by little where an angle alternates between two counts.
//!
//! An encoder on the motor side of an elastic gear leads the link by the gear's twist under the torque.

use painleve_shared::{GeneralisedTorque, JointMotion, JointTorque, LinkMotion, Real};

use super::joints::JointEstimatorSettings;

/// Friction and gears of both joints.
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    /// Whether there is neither friction nor twist to correct.
    is_ideal: bool,
    /// Compensated Coulomb friction, N·m.
    coulomb_nm: [f32; 2],
    /// Reciprocal of the travel over which friction reverses, 1/rad.
    per_travel_per_rad: f32,
    compliance_rad_nm: [f32; 2],
}

/// Friction of both joints between ticks; initially zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransmissionState([JointFriction; 2]);

/// Friction of one joint.
#[derive(Clone, Copy, Debug, Default)]
struct JointFriction {
    /// Angle at the last tick, rad; absent before the first.
    angle_rad: Option<f32>,
    /// Friction, positive against a positive rate, N·m.
    torque_nm: f32,
}

/// What the links do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Links {
    /// Link angles θ, rad.
    pub theta_rad: LinkMotion<f32>,
    /// Friction of the joints, positive against a positive rate, as a torque on the links, N·m.
    pub friction_nm: GeneralisedTorque<f32>,
}

impl Transmission {
    /// Makes the correction for joints with this Coulomb friction, N·m.
    pub fn new(settings: &JointEstimatorSettings, coulomb_friction_nm: [f32; 2]) -> Self {
        let coulomb_nm = coulomb_friction_nm.map(|nm| settings.friction_compensation * nm);
        let compliance_rad_nm = settings.gear_compliance_rad_nm;
        Self {
            is_ideal: coulomb_nm == [0.0; 2] && compliance_rad_nm == [0.0; 2],
            coulomb_nm,
            per_travel_per_rad: 1.0 / settings.friction_travel_rad,
            compliance_rad_nm,
        }
    }

    /// Returns whether the joints have neither friction nor gears that twist.
    #[inline]
    pub fn is_ideal(&self) -> bool {
        self.is_ideal
    }

    /// Corrects the measured joint angles q' (rad) of one tick, with the joint torques until now, N·m.
    pub fn tick(
        &self,
        state: &mut TransmissionState,
        measured_rad: &JointMotion<f32>,
        torque_nm: &JointTorque<f32>,
    ) -> Links {
        let measured = [measured_rad.first(), measured_rad.second()];
        let joints = state.0.iter_mut().zip(self.coulomb_nm).zip(measured);
        for ((joint, coulomb_nm), angle_rad) in joints {
            let before_rad = joint.angle_rad.replace(angle_rad).unwrap_or(angle_rad);
            let travel = ((angle_rad - before_rad) * self.per_travel_per_rad).within(1.0);
            joint.torque_nm += travel * coulomb_nm - travel.abs() * joint.torque_nm;
        }
        let [one, two] = &state.0;
        let [soft_1, soft_2] = self.compliance_rad_nm;
        Links {
            theta_rad: JointMotion::new(
                measured[0] - soft_1 * torque_nm.first(),
                measured[1] - soft_2 * torque_nm.second(),
            )
            .to_links(),
            friction_nm: JointTorque::new(one.torque_nm, two.torque_nm).to_links(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coulomb_friction_follows_the_travel() {
        let transmission = Transmission::new(&JointEstimatorSettings::default(), [0.1, 0.0]);
        let mut state = TransmissionState::default();
        let mut friction_nm = |angle_rad: f32| {
            let angles = JointMotion::new(angle_rad, -0.3);
            let links = transmission.tick(&mut state, &angles, &JointTorque::zeros());
            assert_eq!(links.friction_nm.second(), 0.0);
            assert_eq!(links.theta_rad, angles.to_links());
            links.friction_nm.first()
        };
        assert_eq!(friction_nm(0.5), 0.0);
        for tick in 1..100 {
            friction_nm(0.5 + 2e-4 * tick as f32);
        }
        // It keeps its value at rest, and reverses within the travel.
        let forward = friction_nm(0.5198);
        assert!((forward - 0.085).abs() < 1e-4, "{forward}");
        assert_eq!(friction_nm(0.5198), forward);
        let reversed = friction_nm(0.5188);
        assert!((reversed + 0.085).abs() < 1e-4, "{reversed}");
    }

    #[test]
    fn the_twist_of_a_gear_is_taken_off_a_motor_side_angle() {
        let settings = JointEstimatorSettings {
            gear_compliance_rad_nm: [1e-3, 2e-3],
            ..Default::default()
        };
        let geared = Transmission::new(&settings, [0.0; 2]);
        let torque = JointTorque::new(2.0, -1.0);
        let angles = JointMotion::new(0.2, 0.1);
        let links = geared.tick(&mut TransmissionState::default(), &angles, &torque);
        let twist = angles.to_links() - links.theta_rad;
        assert!(
            (twist - LinkMotion::new(2e-3, 0.0)).amax() < 1e-6,
            "{twist:?}"
        );
    }

    #[test]
    fn joints_without_friction_and_twist_are_ideal() {
        let settings = JointEstimatorSettings::default();
        assert!(Transmission::new(&settings, [0.0; 2]).is_ideal());
        assert!(!Transmission::new(&settings, [0.0, 0.1]).is_ideal());
    }
}
