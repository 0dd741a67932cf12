//! A planar two-link arm: its parameters, checked once, and the model built from them.
//!
//! The arm moves in the vertical plane along the belt. The axes are those of the belt: t along it, n away from
//! it, origin at the first joint; the belt is the line z_n = −H. The link angles θ1, θ2 are absolute, measured
//! from the belt's inward normal −n towards t. For a level belt this is the downward vertical, as in the paper.
//! A tilted belt tilts gravity in these axes and changes nothing else. The joint angles are q' = (θ1, θ2 − θ1).

use core::f64::consts::PI;

use crate::range::{self, OutOfRange};
use crate::real::Real;
use crate::settings::Settings;
use crate::{check_setting, settings};

settings! {
    /// Parameters of an arm in SI units; a pair belongs to links 1 and 2, or to joints 1 and 2. The default is
    /// the paper's arm: two equal uniform rods (Table I), with g = 9.81 m/s².
    #[derive(Copy)]
    pub struct ArmParameters<T: Real> {
        /// Length l of each link, from its joint to the next one or to the tip.
        link_length_m: [T; 2] = [T::literal(0.21); 2], 1e-2..=10.0, "m";
        /// Mass m of each link.
        link_mass_kg: [T; 2] = [T::literal(0.12); 2], 1e-3..=1e3, "kg";
        /// Distance of each link's centre of mass from its joint, along the link; half the length
        /// if absent.
        link_centre_of_mass_m: Option<[T; 2]> = None, -10.0..=10.0, "m";
        /// Moment of inertia of each link about its centre of mass; that of a uniform rod,
        /// m l²/12, if absent.
        link_inertia_kg_m2: Option<[T; 2]> = None, 0.0..=1e4, "kg·m²";
        /// Point mass at the tip.
        tip_mass_kg: T = T::zero(), 0.0..=1e3, "kg";
        /// Damping σ of each joint.
        damping_nms_rad: [T; 2] = [T::literal(0.005); 2], 0.0..=1e3, "N·m·s/rad";
        /// Stiffness k of the spring in each joint.
        stiffness_nm_rad: [T; 2] = [T::zero(), T::literal(1.3)], 0.0..=1e5, "N·m/rad";
        /// Joint angle at which each spring is relaxed; −α0 of the paper for joint 2.
        spring_rest_rad: [T; 2] = [T::zero(), T::literal(-13.72 * PI / 180.0)],
            -PI..=PI, "rad";
        /// Coulomb friction of each joint. The equations of motion do not contain it: it depends on how the
        /// joint has moved before.
        coulomb_friction_nm: [T; 2] = [T::zero(); 2], 0.0..=10.0, "N·m";
        /// Inertia of each joint's rotor, reflected to the joint.
        rotor_inertia_kg_m2: [T; 2] = [T::zero(); 2], 0.0..=1e4, "kg·m²";
        /// Distance H of the first joint from the belt: 0.01 to 0.999 of l1 + l2, and at least 1.001 of the
        /// difference of l1 and l2.
        height_m: T = T::literal(0.3775), 1e-4..=20.0, "m";
        /// Angle by which the belt rises in its direction t.
        belt_tilt_rad: T = T::zero(), -PI..=PI, "rad";
        /// Gravity g.
        gravity_m_s2: T = T::literal(9.81), 0.0..=100.0, "m/s²";
    }
    check Self::relations;
}

impl<T: Real> ArmParameters<T> {
    /// Returns the same arm in another precision.
    pub fn cast<U: Real>(&self) -> ArmParameters<U> {
        let cast = |value: T| U::literal(value.to_f64());
        let pair = |values: [T; 2]| values.map(cast);
        ArmParameters {
            link_length_m: pair(self.link_length_m),
            link_mass_kg: pair(self.link_mass_kg),
            link_centre_of_mass_m: self.link_centre_of_mass_m.map(pair),
            link_inertia_kg_m2: self.link_inertia_kg_m2.map(pair),
            tip_mass_kg: cast(self.tip_mass_kg),
            damping_nms_rad: pair(self.damping_nms_rad),
            stiffness_nm_rad: pair(self.stiffness_nm_rad),
            spring_rest_rad: pair(self.spring_rest_rad),
            coulomb_friction_nm: pair(self.coulomb_friction_nm),
            rotor_inertia_kg_m2: pair(self.rotor_inertia_kg_m2),
            height_m: cast(self.height_m),
            belt_tilt_rad: cast(self.belt_tilt_rad),
            gravity_m_s2: cast(self.gravity_m_s2),
        }
    }

    /// Checks that the belt is within reach everywhere between the two points of full stretch.
    fn relations(&self) -> Result<(), OutOfRange> {
        // The Jacobian is singular at full stretch, and where links of different lengths fold over the hole
        // around the first joint: the belt keeps clear of both.
        let [first, second] = self.link_length_m.map(T::to_f64);
        let (reach, hole) = (first + second, (first - second).abs());
        let least = (0.01 * reach).max(1.001 * hole);
        check_setting!(self.height_m, least, 0.999 * reach)
    }
}

/// Least determinant of the mass matrix over all postures, as a fraction of the product of its diagonal. Two
/// equal uniform rods have 0.44; below this limit, single precision loses M⁻¹.
const LEAST_DETERMINANT: f64 = 1e-3;

/// The arm's model: the coefficients of the equations of motion, computed from checked parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm<T: Real> {
    /// l1 and l2, m.
    pub(crate) length_1_m: T,
    pub(crate) length_2_m: T,
    /// l2/l1.
    pub(crate) length_ratio: T,
    /// H, m.
    pub(crate) height_m: T,
    /// M11 and M22, kg·m².
    pub(crate) inertia_1_kg_m2: T,
    pub(crate) inertia_2_kg_m2: T,
    /// A in M12 = A cos δ − J2, kg·m², with δ = θ2 − θ1 and J2 the second rotor's inertia.
    pub(crate) inertia_coupling_kg_m2: T,
    /// A/4 for links of unit length, kg.
    pub(crate) quarter_coupled_mass_kg: T,
    pub(crate) rotor_1_kg_m2: T,
    pub(crate) rotor_2_kg_m2: T,
    /// Torques of gravity across and along the belt on each link, N·m.
    pub(crate) gravity_1_normal_nm: T,
    pub(crate) gravity_1_tangential_nm: T,
    pub(crate) gravity_2_normal_nm: T,
    pub(crate) gravity_2_tangential_nm: T,
    pub(crate) damping_2_nms_rad: T,
    /// Damping of joint 1 in excess of joint 2, N·m·s/rad.
    pub(crate) damping_1_excess_nms_rad: T,
    pub(crate) stiffness_1_nm_rad: T,
    pub(crate) stiffness_2_nm_rad: T,
    pub(crate) spring_rest_1_rad: T,
    pub(crate) spring_rest_2_rad: T,
}

impl<T: Real> Arm<T> {
    /// Builds the model from checked parameters.
    ///
    /// # Errors
    /// [`OutOfRange`], with a key in the group `arm`, for the first parameter that is not finite, not physical,
    /// or that puts the belt out of reach; also if the mass matrix of the links is nearly singular, that is, if some
    /// motion of the links has hardly any kinetic energy.
    pub fn new(parameters: ArmParameters<T>) -> Result<Self, OutOfRange> {
        parameters.validate().map_err(|error| error.inside("arm"))?;
        let [length_1, length_2] = parameters.link_length_m;
        let [mass_1, mass_2] = parameters.link_mass_kg;
        let half = T::literal(0.5);
        let [centre_1, centre_2] = parameters
            .link_centre_of_mass_m
            .unwrap_or([length_1 * half, length_2 * half]);
        let rod = |mass: T, length: T| mass * length * length * T::literal(1.0 / 12.0);
        let [own_1, own_2] = parameters
            .link_inertia_kg_m2
            .unwrap_or([rod(mass_1, length_1), rod(mass_2, length_2)]);
        for (own, mass, length) in [(own_1, mass_1, length_1), (own_2, mass_2, length_2)] {
            // Four times that of a link whose mass is at both of its ends: more is in other units.
            let ratio = own / (mass * length * length);
            range::check("link_inertia_kg_m2 / (m l²)", ratio, 0.0, 1.0)
                .map_err(|error| error.inside("arm"))?;
        }
        let [rotor_1_kg_m2, rotor_2_kg_m2] = parameters.rotor_inertia_kg_m2;
        let tip = parameters.tip_mass_kg;
        // Mass at the end of link 1, and the moments of mass about both joints.
        let carried = (mass_2 + tip) * length_1;
        let moment_2 = mass_2 * centre_2 + tip * length_2;
        let gravity = parameters.gravity_m_s2;
        let (gravity_1, gravity_2) = (
            mass_1 * centre_1 * gravity + carried * gravity,
            moment_2 * gravity,
        );
        let (sine, cosine) = parameters.belt_tilt_rad.sine_cosine();
        let [damping_1_nms_rad, damping_2_nms_rad] = parameters.damping_nms_rad;
        let [stiffness_1_nm_rad, stiffness_2_nm_rad] = parameters.stiffness_nm_rad;
        let [spring_rest_1_rad, spring_rest_2_rad] = parameters.spring_rest_rad;
        let arm = Self {
            length_1_m: length_1,
            length_2_m: length_2,
            length_ratio: length_2 / length_1,
            height_m: parameters.height_m,
            inertia_1_kg_m2: own_1
                + mass_1 * centre_1 * centre_1
                + carried * length_1
                + rotor_1_kg_m2
                + rotor_2_kg_m2,
            inertia_2_kg_m2: own_2
                + mass_2 * centre_2 * centre_2
                + tip * length_2 * length_2
                + rotor_2_kg_m2,
            inertia_coupling_kg_m2: moment_2 * length_1,
            quarter_coupled_mass_kg: moment_2 / length_2 * T::literal(0.25),
            rotor_1_kg_m2,
            rotor_2_kg_m2,
            gravity_1_normal_nm: gravity_1 * cosine,
            gravity_1_tangential_nm: gravity_1 * sine,
            gravity_2_normal_nm: gravity_2 * cosine,
            gravity_2_tangential_nm: gravity_2 * sine,
            damping_2_nms_rad,
            damping_1_excess_nms_rad: damping_1_nms_rad - damping_2_nms_rad,
            stiffness_1_nm_rad,
            stiffness_2_nm_rad,
            spring_rest_1_rad,
            spring_rest_2_rad,
        };
        // M12 = A cos δ − J2 has its largest magnitude where both terms add.
        let product = arm.inertia_1_kg_m2 * arm.inertia_2_kg_m2;
        let coupling = arm.inertia_coupling_kg_m2.abs() + rotor_2_kg_m2;
        let determinant = (product - coupling * coupling) / product;
        range::check(
            "link_inertia_kg_m2, link_centre_of_mass_m or rotor_inertia_kg_m2: det M / (M11 M22)",
            determinant,
            LEAST_DETERMINANT,
            1.0,
        )
        .map_err(|error| error.inside("arm"))?;
        Ok(arm)
    }

    /// Lengths l1 and l2 of the links, m.
    #[inline]
    pub fn link_length_m(&self) -> [T; 2] {
        [self.length_1_m, self.length_2_m]
    }

    /// Distance H of the first joint from the belt, m.
    #[inline]
    pub fn height_m(&self) -> T {
        self.height_m
    }

    /// Scales both links to those of the `nominal` arm, at the same masses, but with a link 1 that is `length_1_m` long.
    /// Rotors, springs and the belt, which both arms share, stay as they are. The length is not checked.
    pub fn scale_from(&mut self, nominal: &Self, length_1_m: T) {
        let ratio = length_1_m / nominal.length_1_m;
        let square = ratio * ratio;
        let rotors = nominal.rotor_1_kg_m2 + nominal.rotor_2_kg_m2;
        self.length_1_m = length_1_m;
        self.length_2_m = length_1_m * nominal.length_ratio;
        self.inertia_1_kg_m2 = (nominal.inertia_1_kg_m2 - rotors) * square + rotors;
        self.inertia_2_kg_m2 =
            (nominal.inertia_2_kg_m2 - nominal.rotor_2_kg_m2) * square + nominal.rotor_2_kg_m2;
        self.inertia_coupling_kg_m2 = nominal.inertia_coupling_kg_m2 * square;
        self.gravity_1_normal_nm = nominal.gravity_1_normal_nm * ratio;
        self.gravity_1_tangential_nm = nominal.gravity_1_tangential_nm * ratio;
        self.gravity_2_normal_nm = nominal.gravity_2_normal_nm * ratio;
        self.gravity_2_tangential_nm = nominal.gravity_2_tangential_nm * ratio;
    }

    /// Largest distance of the tip from the first joint, m: l1 + l2.
    #[inline]
    pub fn reach_m(&self) -> T {
        self.length_1_m + self.length_2_m
    }

    /// Smallest distance of the tip from the first joint, m: |l1 − l2|.
    #[inline]
    pub fn hole_m(&self) -> T {
        (self.length_1_m - self.length_2_m).abs()
    }

    /// Largest |z_t| (m) at which the tip can touch the belt: √((l1 + l2)² − H²).
    pub fn reach_on_belt_m(&self) -> T {
        let (reach, height) = (self.reach_m(), self.height_m);
        ((reach - height) * (reach + height)).square_root()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinates::LinkMotion;
    use crate::kinematics::Pose;
    use std::string::ToString;

    /// An arm that differs from the paper's in every parameter.
    fn general() -> ArmParameters<f64> {
        ArmParameters {
            link_length_m: [0.25, 0.19],
            link_mass_kg: [0.3, 0.11],
            link_centre_of_mass_m: Some([0.1, 0.12]),
            link_inertia_kg_m2: Some([2e-3, 5e-4]),
            tip_mass_kg: 0.04,
            damping_nms_rad: [0.01, 0.004],
            stiffness_nm_rad: [0.4, 0.9],
            spring_rest_rad: [0.2, -0.5],
            coulomb_friction_nm: [0.02, 0.01],
            rotor_inertia_kg_m2: [3e-4, 2e-4],
            belt_tilt_rad: 0.1,
            ..Default::default()
        }
    }

    fn refused(parameters: ArmParameters<f64>) -> OutOfRange {
        Arm::new(parameters).unwrap_err()
    }

    #[test]
    fn the_papers_arm_reaches_18_cm_to_either_side() {
        let arm = Arm::<f64>::new(ArmParameters::default()).unwrap();
        assert!((arm.reach_on_belt_m() - 0.184_10).abs() < 5e-6);
    }

    #[test]
    fn the_papers_arm_has_the_papers_coefficients() {
        let arm = Arm::<f64>::new(ArmParameters::default()).unwrap();
        let (m, l, g) = (0.12, 0.21, 9.81);
        for (ours, paper) in [
            (arm.inertia_1_kg_m2, 4.0 / 3.0 * m * l * l),
            (arm.inertia_coupling_kg_m2, 0.5 * m * l * l),
            (arm.inertia_2_kg_m2, m * l * l / 3.0),
            (arm.gravity_1_normal_nm, 1.5 * m * g * l),
            (arm.gravity_2_normal_nm, 0.5 * m * g * l),
        ] {
            assert!((ours / paper - 1.0).abs() < 1e-15, "{ours} {paper}");
        }
    }

    #[test]
    fn a_belt_out_of_reach_is_refused_and_named() {
        for (link_length_m, height_m) in [
            ([0.21, 0.21], 0.42),
            ([0.25, 0.16], 0.41),
            // In the hole around the first joint.
            ([0.5, 0.2], 0.3),
            ([0.2, 0.5], 0.29),
        ] {
            let parameters = ArmParameters {
                link_length_m,
                height_m,
                ..Default::default()
            };
            assert_eq!(refused(parameters).key, "arm.height_m");
        }
    }

    #[test]
    fn links_without_inertia_are_refused() {
        let parameters = ArmParameters {
            link_centre_of_mass_m: Some([0.1, 0.0]),
            link_inertia_kg_m2: Some([0.0, 0.0]),
            ..Default::default()
        };
        let error = refused(parameters);
        let key = "arm.link_inertia_kg_m2, link_centre_of_mass_m or rotor_inertia_kg_m2: det M / (M11 M22)";
        assert_eq!(error.key, key);
        // A mass at the tip gives both links inertia; a mass on the line through joint 1 alone does not.
        let ideal = ArmParameters {
            tip_mass_kg: 0.1,
            ..parameters
        };
        assert!(Arm::new(ideal).is_ok());
        let negative = ArmParameters {
            link_inertia_kg_m2: Some([1e-3, -1e-3]),
            ..Default::default()
        };
        assert_eq!(
            refused(negative).to_string(),
            "arm.link_inertia_kg_m2.1 = -0.001 is outside the allowed range 0 to 10000"
        );
    }

    #[test]
    fn scaled_links_equal_links_built_at_that_length() {
        let parameters = general();
        let scale = 0.95;
        let scaled = |values: [f64; 2]| values.map(|value| value * scale);
        let made = Arm::new(ArmParameters {
            link_length_m: scaled(parameters.link_length_m),
            link_centre_of_mass_m: parameters.link_centre_of_mass_m.map(scaled),
            link_inertia_kg_m2: parameters
                .link_inertia_kg_m2
                .map(|inertias| inertias.map(|inertia| inertia * scale * scale)),
            ..parameters
        })
        .unwrap();
        let nominal = Arm::new(parameters).unwrap();
        let mut changed = nominal;
        changed.scale_from(&nominal, scale * 0.25);
        let theta = LinkMotion::new(0.4, -0.3);
        let rates = LinkMotion::new(1.5, -2.0);
        let pose = Pose::new(&theta);
        let terms = |arm: &Arm<f64>| {
            (
                arm.mass_matrix(&pose),
                arm.jacobian(&pose),
                arm.passive_torque_nm(&theta, &rates, &pose),
                arm.centrifugal_torque_nm(&rates, &pose),
                arm.reach_on_belt_m(),
            )
        };
        let (one, other) = (terms(&made), terms(&changed));
        assert!((one.0 - other.0).amax() < 1e-15);
        assert!((one.1 - other.1).amax() < 1e-15);
        assert!((one.2 - other.2).amax() < 1e-15);
        assert!((one.3 - other.3).amax() < 1e-15);
        assert!((one.4 - other.4).abs() < 1e-15);
    }

    #[test]
    fn a_uniform_rod_is_the_default_of_centre_and_inertia() {
        let (mass, length) = (0.3_f64, 0.25_f64);
        let rods = ArmParameters {
            link_mass_kg: [mass; 2],
            link_length_m: [length; 2],
            ..Default::default()
        };
        let explicit = ArmParameters {
            link_centre_of_mass_m: Some([0.125; 2]),
            link_inertia_kg_m2: Some([mass * length * length / 12.0; 2]),
            ..rods
        };
        let (one, other) = (
            Arm::<f64>::new(rods).unwrap(),
            Arm::<f64>::new(explicit).unwrap(),
        );
        assert!((one.inertia_1_kg_m2 - other.inertia_1_kg_m2).abs() < 1e-15);
        assert!((one.inertia_2_kg_m2 - other.inertia_2_kg_m2).abs() < 1e-15);
        assert_eq!(one.inertia_coupling_kg_m2, other.inertia_coupling_kg_m2);
        assert_eq!(one.gravity_1_normal_nm, other.gravity_1_normal_nm);
    }

    #[test]
    fn non_finite_parameters_are_refused() {
        for value in [f32::NAN, f32::INFINITY] {
            let parameters = ArmParameters::<f32> {
                damping_nms_rad: [0.0, value],
                ..Default::default()
            };
            assert_eq!(
                Arm::new(parameters).unwrap_err().key,
                "arm.damping_nms_rad.1"
            );
        }
    }
}
