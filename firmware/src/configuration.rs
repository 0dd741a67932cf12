//! Everything that can be set about the controller, checked before it runs.
//!
//! Kept apart from state: a configuration is a value that can be stored, sent
//! over a link (serde) and compared; the controller is made from it.

use painleve_shared::counts::{EncoderScale, LinearScale};
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::settings::Settings;
use painleve_shared::{Arm, ArmParameters, Real, check_setting, settings};
use serde::{Deserialize, Serialize};

use crate::estimate::belt::BeltSettings;
use crate::estimate::calibration::CalibrationSettings;
use crate::estimate::contact::ContactSettings;
use crate::estimate::disturbance::DisturbanceSettings;
use crate::estimate::friction::FrictionSettings;
use crate::estimate::joints::EstimatorSettings;
use crate::guard::GuardSettings;
use crate::law::{Law, LawSettings};
use crate::recover::RecoverySettings;
use crate::refer::governor::GovernorSettings;
use crate::refer::reference::Program;
use crate::supervise::lapses::LapseLimits;
use crate::supervise::supervisor::SupervisorSettings;

settings! {
    /// The converters' scalings as the controller knows them.
    #[derive(Copy)]
    pub struct Converters {
        /// Encoders of θ1 and of θ2 − θ1.
        encoders: [EncoderScale; 2] = [EncoderScale::default(); 2];
        /// Force cell, N.
        force: LinearScale<f32> = LinearScale { bits: 12, range: 20.0 };
        /// Torque stages, N·m.
        torque: LinearScale<f32> = LinearScale { bits: 12, range: 5.0 };
    }
}

settings! {
    /// Settings of the controller, group by group.
    pub struct ControllerSettings<L: Law = LawSettings> {
        /// Largest torque on either joint; at most the torque stages' range.
        torque_limit_nm: f32 = 5.0, 0.0..=1e6, "N·m";
        /// How rates are estimated from counts.
        estimator: EstimatorSettings = EstimatorSettings::default();
        /// When the tip is taken to touch the belt.
        contact: ContactSettings = ContactSettings::default();
        /// How friction is estimated.
        friction: FrictionSettings = FrictionSettings::default();
        /// What is known about the belt.
        belt: BeltSettings = BeltSettings::default();
        /// How unknown torques are estimated.
        disturbance: DisturbanceSettings = DisturbanceSettings::default();
        /// How the links' length is calibrated.
        calibration: CalibrationSettings = CalibrationSettings::default();
        /// When the drive is armed, and when it is shut down.
        supervisor: SupervisorSettings = SupervisorSettings::default();
        /// How many lapses in a row are survived.
        lapses: LapseLimits = LapseLimits::default();
        /// The control law.
        law: L = L::default();
        /// How the tip is kept pressed on the belt.
        guard: GuardSettings = GuardSettings::default();
        /// How the reference is kept off the paradox.
        governor: GovernorSettings = GovernorSettings::default();
        /// How a tip that left the belt is brought back.
        recovery: RecoverySettings = RecoverySettings::default();
        /// Where the tip shall go, segment after segment.
        reference: Program = Program::to_the_papers_limit();
    }
}

/// Configuration of the controller: what it is connected to, and its settings. The default is the
/// paper's arm at 1 kHz; another rate is
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
    /// The arm as the controller knows it.
    pub arm: ArmParameters<f32>,
    /// What a count is worth.
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
    /// Time between two ticks, s.
    pub fn tick_s(&self) -> f32 {
        1.0 / self.tick_hz
    }

    /// How far a count of the coarser encoder moves the tip along the belt, m.
    pub fn tip_count_m(&self) -> f32 {
        let [one, two] = self.converters.encoders;
        let count_rad = one.rad_per_count::<f32>().at_least(two.rad_per_count());
        self.arm.height_m * count_rad
    }

    /// Checks every number, those of the law included, and makes the arm's model.
    ///
    /// # Errors
    /// [`OutOfRange`] for the first setting that is out of range. Its key is relative to
    /// [`settings`](Self::settings), as in `law.hybrid.normal_force_n`, or begins with `tick_hz`,
    /// `arm` or `converters`.
    // Out of line: its errors do not share the stack with the controller that is being made.
    #[inline(never)]
    pub fn validate(&self) -> Result<Arm<f32>, OutOfRange> {
        range::check("tick_hz", self.tick_hz, 10.0, 1e5)?;
        let arm = Arm::new(self.arm)?;
        within("converters", self.converters.validate())?;
        self.settings.validate()?;
        self.relations(&arm)?;
        Ok(arm)
    }

    /// Checks the settings whose range depends on what the controller is connected to.
    fn relations(&self, arm: &Arm<f32>) -> Result<(), OutOfRange> {
        let settings = &self.settings;
        let force_range_n = self.converters.force.range;
        let torque_range_nm = self.converters.torque.range;
        check_setting!(settings.torque_limit_nm, 0.0, torque_range_nm)?;
        check_setting!(settings.estimator.bandwidth_rad_s, 1.0, 3.0 * self.tick_hz)?;
        check_setting!(settings.contact.contact_n, 1e-3, force_range_n)?;
        check_setting!(settings.contact.force_noise_n, 1e-4, force_range_n)?;
        // A governed reference may be out of reach: it is held at the edge.
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
