//! The two-link arm: its parameters, checked once, and the model made from them.
//!
//! Two equal uniform rods in a vertical plane. Angles θ1, θ2 are absolute,
//! measured from the downward vertical. The belt is the horizontal line a
//! height H below the first joint. A torsion spring acts between the links,
//! dashpots act in both joints.

use serde::{Deserialize, Serialize};

use crate::range::{self, OutOfRange};
use crate::real::Real;

/// Parameters of the arm (paper, Table I), in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmParameters<T: Real> {
    /// Mass m of each link, kg.
    pub link_mass_kg: T,
    /// Length l of each link, m.
    pub link_length_m: T,
    /// Damping σ of each joint, N·m·s/rad.
    pub damping_nms_rad: T,
    /// Stiffness k of the spring between the links, N·m/rad.
    pub stiffness_nm_rad: T,
    /// Rest angle α0 of the spring, rad.
    pub spring_rest_rad: T,
    /// Height H of the first joint above the belt, m.
    pub height_m: T,
    /// Gravity g, m/s².
    pub gravity_m_s2: T,
}

impl<T: Real> Default for ArmParameters<T> {
    /// The paper's Table I, with g = 9.81 m/s².
    fn default() -> Self {
        Self {
            link_mass_kg: T::literal(0.12),
            link_length_m: T::literal(0.21),
            damping_nms_rad: T::literal(0.005),
            stiffness_nm_rad: T::literal(1.3),
            spring_rest_rad: T::literal(13.72 * core::f64::consts::PI / 180.0),
            height_m: T::literal(0.3775),
            gravity_m_s2: T::literal(9.81),
        }
    }
}

impl<T: Real> ArmParameters<T> {
    /// The same arm in another precision.
    pub fn cast<U: Real>(&self) -> ArmParameters<U> {
        let cast = |value: T| U::literal(value.to_f64());
        ArmParameters {
            link_mass_kg: cast(self.link_mass_kg),
            link_length_m: cast(self.link_length_m),
            damping_nms_rad: cast(self.damping_nms_rad),
            stiffness_nm_rad: cast(self.stiffness_nm_rad),
            spring_rest_rad: cast(self.spring_rest_rad),
            height_m: cast(self.height_m),
            gravity_m_s2: cast(self.gravity_m_s2),
        }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// [`OutOfRange`] for the first parameter that is not finite, not physical,
    /// or that puts the belt out of reach (H ≥ 2l).
    pub fn validate(&self) -> Result<(), OutOfRange> {
        range::check("arm.link_mass_kg", self.link_mass_kg, 1e-3, 1e3)?;
        range::check("arm.link_length_m", self.link_length_m, 1e-2, 10.0)?;
        range::check("arm.damping_nms_rad", self.damping_nms_rad, 0.0, 1e3)?;
        range::check("arm.stiffness_nm_rad", self.stiffness_nm_rad, 0.0, 1e5)?;
        let pi = core::f64::consts::PI;
        range::check("arm.spring_rest_rad", self.spring_rest_rad, -pi, pi)?;
        range::check("arm.gravity_m_s2", self.gravity_m_s2, 0.0, 100.0)?;
        // Just short of the straight arm the tip could still touch in one
        // point only, where the Jacobian is singular.
        let reach_m = 2.0 * self.link_length_m.to_f64();
        range::check(
            "arm.height_m",
            self.height_m,
            0.01 * reach_m,
            0.999 * reach_m,
        )
    }
}

/// The arm's model: checked parameters and the coefficients that the equations
/// of motion share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm<T: Real> {
    parameters: ArmParameters<T>,
    /// 4/3 m l², kg·m².
    pub(crate) inertia_1: T,
    /// m l²/2, kg·m².
    pub(crate) inertia_coupling: T,
    /// m l²/3, kg·m².
    pub(crate) inertia_2: T,
    /// 3/2 m g l, N·m.
    pub(crate) gravity_1: T,
    /// m g l/2, N·m.
    pub(crate) gravity_2: T,
}

impl<T: Real> Arm<T> {
    /// Makes the model from checked parameters.
    ///
    /// # Errors
    /// As [`ArmParameters::validate`].
    pub fn new(parameters: ArmParameters<T>) -> Result<Self, OutOfRange> {
        parameters.validate()?;
        let ml = parameters.link_mass_kg * parameters.link_length_m;
        let ml2 = ml * parameters.link_length_m;
        let mgl = ml * parameters.gravity_m_s2;
        Ok(Self {
            parameters,
            inertia_1: ml2 * T::literal(4.0 / 3.0),
            inertia_coupling: ml2 * T::literal(0.5),
            inertia_2: ml2 * T::literal(1.0 / 3.0),
            gravity_1: mgl * T::literal(1.5),
            gravity_2: mgl * T::literal(0.5),
        })
    }

    /// The parameters the model was made from.
    pub fn parameters(&self) -> &ArmParameters<T> {
        &self.parameters
    }

    /// The same arm with links of another length (m), equally heavy. The length is not checked.
    #[must_use]
    pub fn with_link_length(&self, link_length_m: T) -> Self {
        let ratio = link_length_m / self.parameters.link_length_m;
        let square = ratio * ratio;
        Self {
            parameters: ArmParameters {
                link_length_m,
                ..self.parameters
            },
            inertia_1: self.inertia_1 * square,
            inertia_coupling: self.inertia_coupling * square,
            inertia_2: self.inertia_2 * square,
            gravity_1: self.gravity_1 * ratio,
            gravity_2: self.gravity_2 * ratio,
        }
    }

    /// Largest |z_t| (m) at which the tip can touch the belt: √(4l² − H²).
    pub fn reach_on_belt_m(&self) -> T {
        let reach = self.parameters.link_length_m * T::literal(2.0);
        let height = self.parameters.height_m;
        ((reach - height) * (reach + height)).square_root()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_arm_reaches_18_cm_to_either_side() {
        let arm = Arm::<f64>::new(ArmParameters::default()).unwrap();
        assert!((arm.reach_on_belt_m() - 0.184_10).abs() < 5e-6);
    }

    #[test]
    fn a_belt_out_of_reach_is_refused_by_name() {
        let parameters = ArmParameters::<f64> {
            height_m: 0.42,
            ..Default::default()
        };
        assert_eq!(Arm::new(parameters).unwrap_err().key, "arm.height_m");
    }

    #[test]
    fn an_arm_with_other_links_is_the_one_made_with_them() {
        let parameters = ArmParameters::<f64>::default();
        let link_length_m = 0.2;
        let made = Arm::new(ArmParameters {
            link_length_m,
            ..parameters
        })
        .unwrap();
        let changed = Arm::new(parameters)
            .unwrap()
            .with_link_length(link_length_m);
        assert_eq!(made.parameters(), changed.parameters());
        for (made, changed) in [
            (made.inertia_1, changed.inertia_1),
            (made.inertia_coupling, changed.inertia_coupling),
            (made.inertia_2, changed.inertia_2),
            (made.gravity_1, changed.gravity_1),
            (made.gravity_2, changed.gravity_2),
        ] {
            assert!((made - changed).abs() < 1e-15);
        }
    }

    #[test]
    fn non_finite_parameters_are_refused() {
        for value in [f32::NAN, f32::INFINITY] {
            let parameters = ArmParameters::<f32> {
                damping_nms_rad: value,
                ..Default::default()
            };
            assert_eq!(Arm::new(parameters).unwrap_err().key, "arm.damping_nms_rad");
        }
    }
}
