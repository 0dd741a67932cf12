//! Coulomb friction of the joints.
//!
//! It follows the travel Δ of a joint (Dahl's model): F ← F + (F_c Δ − |Δ| F)/travel. It keeps its value at
//! rest, and changes by little where an angle alternates between two counts.

use painleve_shared::{GeneralisedTorque, JointMotion, JointTorque, Real};

/// Travel of a joint over which its Coulomb friction reverses, rad. Half and twice of it kept fewer runs (lab book,
/// *Friction and gears of the joints*).
const TRAVEL_RAD: f32 = 1e-3;
/// Fraction of the known Coulomb friction that is compensated. All of it kept fewer runs (the same).
const COMPENSATED: f32 = 0.85;

/// Model of both joints' Coulomb friction.
#[derive(Clone, Copy, Debug)]
pub struct JointFriction {
    /// Whether there is nothing to compensate.
    pub(super) is_zero: bool,
    /// Compensated Coulomb friction, N·m.
    coulomb_nm: [f32; 2],
    /// Joint angles at the last tick, rad; absent before the first.
    pub(super) angles_rad: Option<JointMotion<f32>>,
    /// Friction, positive against a positive rate, N·m.
    torque_nm: JointTorque<f32>,
}

impl JointFriction {
    /// Makes the model for joints with this Coulomb friction, N·m.
    pub fn new(coulomb_friction_nm: [f32; 2]) -> Self {
        let coulomb_nm = coulomb_friction_nm.map(|nm| COMPENSATED * nm);
        Self {
            is_zero: coulomb_nm == [0.0; 2],
            coulomb_nm,
            angles_rad: None,
            torque_nm: JointTorque::zeros(),
        }
    }

    /// Returns the change of the friction in one tick, as a torque on the links, N·m, given the joint angles q', rad.
    #[inline(never)]
    pub fn tick(&mut self, angles_rad: &JointMotion<f32>) -> GeneralisedTorque<f32> {
        let before_rad = self.angles_rad.replace(*angles_rad).unwrap_or(*angles_rad);
        let travel = ((*angles_rad - before_rad) * (1.0 / TRAVEL_RAD)).map(|it| it.within(1.0));
        let left_nm = travel.map(f32::abs).torque_by(self.torque_nm.to_array());
        let change_nm = travel.torque_by(self.coulomb_nm) - left_nm;
        self.torque_nm += change_nm;
        change_nm.to_links()
    }

    /// Returns the friction, positive against a positive rate, as a torque on the links, N·m.
    #[inline]
    pub fn torque_nm(&self) -> GeneralisedTorque<f32> {
        self.torque_nm.to_links()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coulomb_friction_follows_the_travel() {
        let mut model = JointFriction::new([0.1, 0.0]);
        let mut friction_nm = |angle_rad: f32| {
            let before_nm = model.torque_nm();
            let change_nm = model.tick(&JointMotion::new(angle_rad, -0.3));
            let friction_nm = model.torque_nm();
            assert!((friction_nm - before_nm - change_nm).amax() < 1e-7);
            assert_eq!(friction_nm.second(), 0.0);
            friction_nm.first()
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
        // However far the joint turns in a tick, the friction is never more than that of sliding.
        let far = friction_nm(0.5288);
        assert!((far - 0.085).abs() < 1e-4, "{far}");
    }

    #[test]
    fn joints_without_friction_need_no_compensation() {
        assert!(JointFriction::new([0.0; 2]).is_zero);
        assert!(!JointFriction::new([0.0, 0.1]).is_zero);
    }
}
