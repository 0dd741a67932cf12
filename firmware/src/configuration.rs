//! The controller's configuration, checked before the controller runs.
//!
//! The configuration is separate from the state: it is a value that can be stored, sent over a link
//! (serde) and compared, and from which the controller is built.

use painleve_shared::counts::{EncoderScale, LinearScale};
use painleve_shared::mounting::Mounting;
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::schema::SchemaHash;
use painleve_shared::settings::{SettingValue, Settings};
use painleve_shared::stages::StageSettings;
use painleve_shared::winding::WindingSettings;
use painleve_shared::{Arm, ArmParameters, LinkMotion, Pose, Real, check_setting, settings};
use serde::{Deserialize, Serialize};

use crate::estimate::belt::BeltSpeedSettings;
use crate::estimate::calibration::CalibrationSettings;
use crate::estimate::contact::ContactSettings;
use crate::estimate::disturbance::DisturbanceSettings;
use crate::estimate::friction::FrictionSettings;
use crate::estimate::joints::JointEstimatorSettings;
use crate::estimate::response::ResponseSettings;
use crate::law::{Law, LawSettings};
use crate::recover::RecoverySettings;
use crate::refer::governor::GovernorSettings;
use crate::refer::reference::Program;
use crate::supervise::lapses::LapseLimits;
use crate::supervise::supervisor::SupervisorSettings;

/// Standard deviation of the tip's place for each count of an encoder by which rounding moves it. With a third of it, 44
/// instead of 37 of 9,000 runs on rigid contact failed (lab book, *Contact that gives*).
const ROUNDING: f32 = 1.5;
/// The same for each N·m of the joints' known friction, m/(N·m).
const FRICTION_M_NM: f32 = 0.03;
/// Control period for which the distance from the edge is set, s.
const PERIOD_S: f32 = 1e-3;

settings! {
    /// Scalings of the converters, as configured in the controller.
    #[derive(Copy)]
    pub struct Converters {
        /// Encoders of θ1 and of θ2 − θ1.
        encoders: [EncoderScale; 2] = [EncoderScale::default(); 2];
        /// Force cell, N.
        force: LinearScale<f32> = LinearScale { bits: 12, range: 20.0 };
        /// Torque stages, N·m.
        torque: LinearScale<f32> = LinearScale { bits: 12, range: 5.0 };
        /// Directions and zeros of the parts of a real arm.
        mounting: Mounting = Mounting::default();
        /// Motors and gears of the torque stages.
        stages: StageSettings = StageSettings::default();
        /// Protection of the torque stages' windings.
        winding: WindingSettings = WindingSettings::default();
    }
    check Self::relations;
}

impl Converters {
    /// The boards' drivers and checks take both encoders for parts of one type.
    fn relations(&self) -> Result<(), OutOfRange> {
        let [one, two] = self.encoders.map(|encoder| f64::from(encoder.bits));
        range::check("bits", two, one, one).map_err(|error| error.at(1).inside("encoders"))
    }
}

settings! {
    /// Settings of the controller, group by group.
    pub struct ControllerSettings<L: Law = LawSettings> {
        /// Largest torque on either joint; at most the torque stages' range, and what motor and
        /// gear can give at the joint.
        torque_limit_nm: f32 = 5.0, 0.0..=1e6, "N·m";
        /// Estimation of joint angles and rates from encoder counts.
        estimator: JointEstimatorSettings = JointEstimatorSettings::default();
        /// Detection of contact between tip and belt.
        contact: ContactSettings = ContactSettings::default();
        /// Estimation of friction.
        friction: FrictionSettings = FrictionSettings::default();
        /// Estimation of the belt's speed.
        belt: BeltSpeedSettings = BeltSpeedSettings::default();
        /// Estimation of unknown torques.
        disturbance: DisturbanceSettings = DisturbanceSettings::default();
        /// Estimation of the contact's compliance.
        response: ResponseSettings = ResponseSettings::default();
        /// Calibration of the links' length.
        calibration: CalibrationSettings = CalibrationSettings::default();
        /// Arming, recovery and shutdown of the drive.
        supervisor: SupervisorSettings = SupervisorSettings::default();
        /// Number of lapses tolerated.
        lapses: LapseLimits = LapseLimits::default();
        /// The control law.
        law: L = L::default();
        /// Edge governor, which keeps the reference away from the paradox.
        governor: GovernorSettings = GovernorSettings::default();
        /// Recovery of a tip that has left the belt.
        recovery: RecoverySettings = RecoverySettings::default();
        /// Reference of the tip, segment by segment.
        reference: Program = Program::to_the_papers_limit();
    }
}

/// Configuration of the controller: control rate, arm, converters and settings. The default is the
/// paper's arm at 1 kHz. Another rate is set as follows:
///
/// ```
/// use painleve_firmware::{Configuration, Controller};
///
/// let configuration: Configuration = Configuration { tick_hz: 2000.0, ..Default::default() };
/// let controller = Controller::new(&configuration)?;
/// # Ok::<(), painleve_shared::range::OutOfRange>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Configuration<L: Law = LawSettings> {
    /// Control rate, Hz.
    pub tick_hz: f32,
    /// Parameters of the arm, as configured in the controller.
    pub arm: ArmParameters<f32>,
    /// Scalings of the converters.
    pub converters: Converters,
    /// The settings.
    pub settings: ControllerSettings<L>,
}

impl<L: Law> Default for Configuration<L> {
    /// The paper's arm at 1 kHz with converters of common resolution.
    fn default() -> Self {
        Self {
            tick_hz: 1000.0,
            arm: ArmParameters::default(),
            converters: Converters::default(),
            settings: ControllerSettings::default(),
        }
    }
}

impl<L: Law> Configuration<L> {
    /// Identifies the build: hash of what the bytes of a configuration and of the messages mean. The host and the
    /// board compare it before the board accepts a configuration, because the bytes carry no names.
    pub const BUILD: u64 = SchemaHash::of_messages()
        .value("tick_hz", &f32::SHAPE)
        .value("arm", &ArmParameters::<f32>::SHAPE)
        .value("converters", &Converters::SHAPE)
        .value("settings", &ControllerSettings::<L>::SHAPE)
        .finish();

    /// Returns the control period, s.
    pub fn tick_s(&self) -> f32 {
        1.0 / self.tick_hz
    }

    /// Returns the distance that the governor keeps from the point where p/Q22 has its least value, m: what a disturbance
    /// moves the tip before the controller reacts, and what makes the joints' motion uncertain.
    pub fn kept_distance_m(&self) -> f32 {
        let square = |value: f32| value * value;
        let governor = &self.settings.governor;
        let [encoder, _] = self.converters.encoders;
        let count_m = self.arm.height_m * encoder.rad_per_count::<f32>();
        let [friction_1_nm, friction_2_nm] = self.arm.coulomb_friction_nm;
        let variance_m2 = square(ROUNDING * count_m)
            + square(FRICTION_M_NM * friction_1_nm.at_least(friction_2_nm))
            + square(self.settings.estimator.tip_deviation_m);
        let distance_m2 = square(governor.distance_m * square(self.tick_s() / PERIOD_S))
            + square(governor.deviations) * variance_m2;
        distance_m2.square_root()
    }

    /// Returns the speed of tracking loops and law on this arm, at most 1, as a factor on what their settings say.
    ///
    /// Behind known elastic gears the tracking loops stay below the lower of the natural frequencies of the stretched arm
    /// about either joint, behind motors at rest: 1/√(c J), infinite for stiff gears. The torque moves the encoders there.
    /// The inertia J contains the joint's rotor, as the arm's model does, although it is at rest: loops behind heavy
    /// rotors are slower than they need be.
    pub fn loop_speed(&self, arm: &Arm<f32>) -> f32 {
        let estimator = &self.settings.estimator;
        let inertia_kg_m2 = arm.mass_matrix(&Pose::new(&LinkMotion::zeros()));
        let [soft_1, soft_2] = estimator.gear_compliance_rad_nm;
        // Joint 1 turns both links.
        let one = soft_1 * inertia_kg_m2.sum();
        let two = soft_2 * inertia_kg_m2.m22;
        let natural_rad_s = 1.0 / one.at_least(two).square_root();
        (natural_rad_s / estimator.bandwidth_rad_s).at_most(1.0)
    }

    /// Checks every number, including those of the law, and builds the arm's model.
    ///
    /// # Errors
    /// [`OutOfRange`] for the first setting that is out of range. Its key is relative to
    /// [`settings`](Self::settings), as in `law.hybrid.normal_force_n`, or begins with `tick_hz`,
    /// `arm` or `converters`.
    #[inline(never)]
    pub fn validate(&self) -> Result<Arm<f32>, OutOfRange> {
        range::check("tick_hz", self.tick_hz, 10.0, 1e5)?;
        let arm = Arm::new(self.arm)?;
        within("converters", self.converters.validate())?;
        self.settings.validate()?;
        self.relations(&arm)?;
        Ok(arm)
    }

    /// Checks the settings whose range depends on the control rate, the arm or the converters.
    fn relations(&self, arm: &Arm<f32>) -> Result<(), OutOfRange> {
        let settings = &self.settings;
        let force_range_n = self.converters.force.range;
        let torque_range_nm = self.converters.torque.range;
        let [stage_1_nm, stage_2_nm] = self.converters.stages.joint_range_nm(torque_range_nm);
        let torque_limit_nm = torque_range_nm.at_most(stage_1_nm).at_most(stage_2_nm);
        check_setting!(settings.torque_limit_nm, 0.0, torque_limit_nm)?;
        check_setting!(settings.estimator.bandwidth_rad_s, 1.0, 3.0 * self.tick_hz)?;
        check_setting!(settings.contact.contact_n, 1e-3, force_range_n)?;
        check_setting!(settings.contact.force_noise_n, 1e-4, force_range_n)?;
        // A governed reference may be out of reach: the governor holds it at the edge.
        let reach_m = if settings.governor.enabled {
            arm.reach_m()
        } else {
            arm.reach_on_belt_m()
        };
        within("reference", settings.reference.check_reach(reach_m))
    }
}

/// Adds the name of a group to the key of an error.
fn within(group: &'static str, result: Result<(), OutOfRange>) -> Result<(), OutOfRange> {
    result.map_err(|error| error.inside(group))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::pid::PidSettings;

    #[test]
    fn the_build_covers_every_part_of_the_configuration_and_the_laws() {
        let Configuration {
            tick_hz: _,
            arm: _,
            converters: _,
            settings: _,
        } = <Configuration>::default();
        assert_ne!(<Configuration>::BUILD, Configuration::<PidSettings>::BUILD);
    }

    #[test]
    fn encoders_of_different_resolution_are_refused() {
        let mut configuration = Configuration::<LawSettings>::default();
        configuration.converters.encoders[1].bits = 12;
        let error = configuration.validate().unwrap_err();
        assert_eq!(error.key, "converters.encoders.1.bits");
    }

    #[test]
    fn the_loops_stay_below_the_natural_frequency_of_the_arm_on_its_gears() {
        let mut configuration = <Configuration>::default();
        // Both links of 0.12 kg and 0.21 m turn with joint 1: 0.01411 kg·m². Joint 2 turns the second alone, 0.00176.
        for (stiffness_nm_rad, natural_rad_s) in [
            ([2000.0, 2000.0], 376.5_f32),
            ([500.0, 1e9], 188.2),
            ([1e9, 250.0], 376.5),
            ([8000.0, 8000.0], 753.0),
        ] {
            let compliance_rad_nm = stiffness_nm_rad.map(|k: f32| 1.0 / k);
            configuration.settings.estimator.gear_compliance_rad_nm = compliance_rad_nm;
            let expected = (natural_rad_s / 500.0).min(1.0);
            let speed = configuration.loop_speed(&Arm::new(configuration.arm).unwrap());
            assert!((speed - expected).abs() < 1e-3, "{speed} {expected}");
        }
    }
}
