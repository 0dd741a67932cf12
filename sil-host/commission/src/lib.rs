//! Commissioning of an arm: measures how sensors and torque stages are mounted, and compares the result
//! with the scenario.
//!
//! The procedure reads raw counts and commands small torques through the trait [`Rig`]. It runs equally
//! against a real arm behind its board and against [`simulated::SimulatedRig`], into which every
//! [`simulated::BuiltInMistake`] can be built. The steps, each of which relies on those before:
//!
//! 1. [`encoders`]: the operator holds the arm in three poses, stages off → directions and zeros of the
//!    encoders, tare of the force cell
//! 2. [`rest`]: the tip rests on the belt, stages off → height of the belt, sign of f_n, from the weight
//! 3. [`stages`]: small torques on the resting arm → polarity and scale of the stages, sign of f_t
//! 4. [`slide`]: the tip slides by a millimetre in both directions → friction
//!
//! [`second_sensors`] repeats it with the second sensors of an arm that has two on each channel.
//!
//! [`identification`] goes on from there: the controller itself slides the tip along the belt, which determines zeros
//! and errors of the encoders, the links' lengths and the belt's height much more closely.
//!
//! [`set_down`] says where the tip of an arm may be set down before the drive is armed.
//!
//! The belt stands still while an arm is commissioned. A deviation that a setting can describe is corrected and reported; any
//! other ends the procedure with one [`Mistake`].

pub mod encoders;
pub mod identification;
mod mistake;
mod readings;
pub mod rest;
pub mod second_sensors;
pub mod set_down;
pub mod simulated;
pub mod slide;
pub mod stages;

use painleve_firmware::configuration::Converters;
use painleve_firmware::estimate::encoder_correction::EncoderCorrection;
use painleve_plant::decimal::as_written;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_shared::counts::{EncoderCounts, ForceCounts, TorqueCounts};
use painleve_shared::mounting::Mounting;
use painleve_shared::{Arm, ArmParameters, LinkMotion, OutOfRange, Posture};

pub use mistake::{Deviation, Mistake};
use readings::Session;
pub use slide::NoSlide;

/// Raw readings of one control tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RawReadings {
    /// Encoders of θ1 and of the elbow; out of range for a missing reading.
    pub joints: [EncoderCounts; 2],
    /// f_t and f_n; out of range for a missing reading.
    pub forces: [ForceCounts; 2],
}

/// A task for the operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OperatorTask {
    /// Hold the arm still, clear of the belt, with both links at these angles from the plumb line, degrees,
    /// positive in the belt's direction +t.
    Hold {
        /// θ1 and θ2, degrees from the downward vertical.
        plumb_deg: [f64; 2],
    },
    /// Set the tip on the standing belt below the first joint, in this posture, and let go.
    SetDown {
        /// The posture.
        posture: Posture,
    },
    /// Keep clear and switch the torque stages on.
    Enable,
}

/// Returns where the elbow of an arm is whose tip is below joint 1, as an operator is told.
pub fn elbow_side(posture: Posture) -> &'static str {
    match posture {
        Posture::ElbowDown => "forwards, towards +t",
        Posture::ElbowUp => "backwards, away from +t",
    }
}

impl core::fmt::Display for OperatorTask {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let direction = |degrees: f64| match degrees {
            0.0 => "straight down".to_owned(),
            90.0 => "level, in the belt's direction +t".to_owned(),
            other => format!("{other}° from straight down, towards +t"),
        };
        match self {
            Self::Hold {
                plumb_deg: [one, two],
            } => write!(
                f,
                "hold link 1 {}, and link 2 {}",
                direction(*one),
                direction(*two)
            ),
            Self::SetDown { posture } => write!(
                f,
                "with the belt standing still, set the tip on it right below joint 1, the elbow {}, and let go",
                elbow_side(*posture)
            ),
            Self::Enable => write!(
                f,
                "keep clear of the arm; open the switch ENABLE, then close it"
            ),
        }
    }
}

/// An arm to commission, and its operator.
pub trait Rig {
    /// Failure of the rig, for example of its line.
    type Error: std::error::Error;

    /// Gives the operator a task and returns when it is done.
    ///
    /// # Errors
    /// If the operator gives up or the rig fails.
    fn instruct(&mut self, instruction: OperatorTask) -> Result<(), Self::Error>;

    /// Commands raw torques and returns the readings of a later tick. The torques last until the next call
    /// or, without one, for a short time.
    ///
    /// # Errors
    /// If the rig fails, or its torque stages are off although a torque is commanded.
    fn exchange(&mut self, torques: [TorqueCounts; 2]) -> Result<RawReadings, Self::Error>;
}

/// Reason for the end of a commissioning without a result.
#[derive(Debug, thiserror::Error)]
pub enum CommissionError<E: std::error::Error> {
    /// The rig failed.
    #[error(transparent)]
    Rig(E),
    /// A mistake that no setting can describe.
    #[error("{0}")]
    Refused(#[from] Mistake),
    /// The scenario's arm, or a measured value, is out of range.
    #[error("{0}")]
    Range(#[from] OutOfRange),
}

impl<E: std::error::Error> CommissionError<E> {
    /// Converts a failure of the rig.
    pub fn map_rig<F: std::error::Error>(self, convert: impl FnOnce(E) -> F) -> CommissionError<F> {
        match self {
            Self::Rig(error) => CommissionError::Rig(convert(error)),
            Self::Refused(mistake) => CommissionError::Refused(mistake),
            Self::Range(error) => CommissionError::Range(error),
        }
    }
}

/// What the procedure assumes about the arm.
#[derive(Clone, Debug)]
pub struct Expected {
    /// The arm's model.
    pub arm: Arm<f64>,
    /// Angle by which the belt rises in its direction, rad.
    pub belt_tilt_rad: f64,
    /// Scalings and mounting as in the scenario.
    pub converters: Converters,
    /// Correction of the encoders as in the scenario.
    pub correction: EncoderCorrection,
    /// Whether slides have shown the arm's geometry.
    pub is_identified: bool,
    /// Posture of the scenario's start.
    pub posture: Posture,
    /// Largest torque that the procedure may command, N·m.
    pub torque_limit_nm: f64,
    /// Control rate, Hz.
    pub tick_hz: f64,
}

impl Expected {
    /// Takes the expectations from a scenario. No torque exceeds `torque_limit_nm`.
    ///
    /// # Errors
    /// [`OutOfRange`] if the arm is out of range.
    pub fn new(scenario: &Scenario, torque_limit_nm: f64) -> Result<Self, OutOfRange> {
        let configuration = scenario.controller_configuration();
        let arm = ArmParameters {
            height_m: assumed_height_m(scenario),
            ..configuration.arm.cast()
        };
        let start = theta(&scenario.initial.state(&scenario.arm)?);
        Ok(Self {
            arm: Arm::new(arm)?,
            belt_tilt_rad: f64::from(configuration.arm.belt_tilt_rad),
            converters: configuration.converters,
            correction: configuration.settings.estimator.encoders,
            is_identified: scenario.knowledge.off_line_m > 0.0,
            posture: Posture::of(&start),
            torque_limit_nm,
            tick_hz: f64::from(configuration.tick_hz),
        })
    }
}

/// Returns the belt's height as the controller assumes it, in double precision: unless another is measured, the corrected
/// scenario has this height.
fn assumed_height_m(scenario: &Scenario) -> f64 {
    scenario
        .arm_model
        .map_or(scenario.arm.height_m, |model| as_written(model.height_m))
}

/// Result of a commissioning.
#[derive(Clone, Debug, PartialEq)]
pub struct Commissioned {
    /// Directions and zeros as measured.
    pub mounting: Mounting,
    /// Readings of the encoders at angle zero, in the joints' directions, without a correction, counts.
    pub encoder_offsets: [u32; 2],
    /// Correction of the encoders: that of the scenario where direction and zero are still those of the scenario, none
    /// elsewhere.
    pub correction: EncoderCorrection,
    /// Height of the first joint over the belt, m.
    pub height_m: f64,
    /// Friction coefficient, or why it has not been measured.
    pub friction: Result<f64, NoSlide>,
    /// Link angles of the arm at rest on the belt, rad.
    pub rest_rad: LinkMotion<f64>,
    /// Deviations from the scenario that the result corrects.
    pub deviations: Vec<Deviation>,
}

impl Commissioned {
    /// Returns the scenario with the measured values.
    ///
    /// # Errors
    /// [`OutOfRange`] if the arm does not reach the belt at its measured height.
    pub fn applied_to(&self, scenario: &Scenario) -> Result<Scenario, OutOfRange> {
        let mut corrected = scenario.clone();
        let directions = scenario.converters.mounting.encoder_reversed;
        let is_other = directions != self.mounting.encoder_reversed
            || scenario.converters.encoder.offset_counts != self.encoder_offsets
            || self.height_m != assumed_height_m(scenario);
        corrected.converters.mounting = self.mounting;
        corrected.converters.encoder.offset_counts = self.encoder_offsets;
        corrected.controller.estimator.encoders = self.correction;
        corrected.arm.height_m = self.height_m;
        if let Some(model) = &mut corrected.arm_model {
            model.height_m = self.height_m as f32;
        }
        if let Ok(friction) = self.friction {
            corrected.belt.friction = friction;
            corrected.controller.friction.first_guess = friction.min(2.0) as f32;
        }
        // Whatever was known is that of the arm as it was.
        let was_known = !identification::is_new(scenario) && !scenario.knowledge.is_rehearsed();
        if is_other || !was_known {
            identification::suppose_drawn(&mut corrected);
        }
        // The file's start must lie on the belt at its new height.
        let arm = Arm::new(corrected.arm)?;
        let tip = arm.tip_m(&painleve_shared::kinematics::Pose::new(&self.rest_rad));
        if let Some(start) = arm.link_angles_on_belt_rad(tip.x, Posture::of(&self.rest_rad)) {
            let [theta_1, theta_2] = start.to_array().map(f64::to_degrees);
            corrected.initial = InitialState::at_rest(theta_1, theta_2);
        }
        Ok(corrected)
    }
}

/// Commissions an arm: measures directions, zeros and scales step by step.
///
/// # Errors
/// [`CommissionError::Refused`] for the first mistake that no setting can describe, and
/// [`CommissionError::Rig`] if the rig fails.
pub fn commission<R: Rig>(
    rig: &mut R,
    expected: &Expected,
) -> Result<Commissioned, CommissionError<R::Error>> {
    rest::check(expected)?;
    let mut session = Session::new(rig, expected);
    let encoders = encoders::measure(&mut session)?;
    session.set_encoders(encoders.reversed, encoders.offsets, encoders.correction);
    let rest = rest::measure(&mut session, &encoders)?;
    let stages = stages::measure(&mut session, &rest)?;
    session.set_stages(stages.reversed);
    let friction = slide::measure(&mut session, &rest, stages.force_reversed)?;
    let mut deviations = encoders.deviations;
    deviations.extend(rest.deviations);
    deviations.extend(stages.deviations);
    Ok(Commissioned {
        mounting: Mounting {
            encoder_reversed: encoders.reversed,
            stage_reversed: stages.reversed,
            force_reversed: stages.force_reversed,
            force_tare: encoders.tare,
            ..expected.converters.mounting
        },
        encoder_offsets: encoders.offsets,
        correction: encoders.correction,
        height_m: rest.height_m,
        friction,
        rest_rad: rest.theta_rad,
        deviations,
    })
}
