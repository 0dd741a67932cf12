//! Estimates the state of arm, contact and belt from the sensors.
//!
//! - [`joints`]: angles and rates from encoder counts; [`encoder_correction`]: known errors of the encoders
//! - [`model`]: the equations of motion at those angles and rates
//! - [`contact`]: contact decision; [`ContactEstimate`]: what is known of the contact
//! - [`friction`], [`belt`]: friction and direction of slip, bounds of the belt's speed
//! - [`calibration`]: length of the links
//! - [`response`]: how compliant the contact is
//! - [`joint_friction`]: Coulomb friction of the joints
//! - [`disturbance`]: torques that the model does not explain

pub mod belt;
pub mod calibration;
pub mod contact;
mod contact_estimate;
pub mod disturbance;
pub mod encoder_correction;
pub mod friction;
mod gap;
pub mod joint_friction;
pub mod joints;
pub mod model;
pub mod response;

use nalgebra::Vector2;
use painleve_shared::counts::LinearConverter;
use painleve_shared::frame::SensorFrame;
use painleve_shared::{Arm, Pose, Slip};

use self::belt::{BeltEstimator, BeltState};
use self::calibration::{CalibrationState, LengthCalibrator};
use self::contact::{ContactDetector, ContactState, Evidence};
pub use self::contact_estimate::ContactEstimate;
use self::disturbance::{DisturbanceEstimator, DisturbanceState};
use self::friction::{FrictionEstimator, FrictionState};
use self::joint_friction::{JointFriction, JointFrictionState};
use self::joints::{JointEstimator, JointEstimatorSettings, JointState, Restart};
use self::model::Model;
use self::response::{ForceReading, ResponseEstimator, ResponseState};
use crate::configuration::Configuration;
use crate::last_command::LastCommand;
use crate::law::Law;
use crate::schedule::Turn;

/// Least velocity by which a sticking tip falls behind its reference, m/s.
const DRAGGED_M_S: f32 = 0.02;

/// What a tick in contact offers to the slow estimates.
#[derive(Clone, Copy, Debug)]
pub struct SlowReadings {
    /// Whether the gap shows the links' length: the tip certainly touches, and has moved.
    pub shows_length: bool,
    /// Whether a block of the response's readings is complete.
    pub completes_block: bool,
}

/// What the update after a tick needs of it besides the estimates.
#[derive(Clone, Copy, Debug, Default)]
pub struct Observed {
    /// Ticks since the previous readings: 1 unless frames were lost.
    pub elapsed_ticks: u32,
    /// Whether torque was applied before the tick.
    pub drove: bool,
    /// The command until the tick.
    pub last: LastCommand,
}

/// All estimators of one arm.
#[derive(Clone, Debug)]
pub struct Estimators {
    force_cell: LinearConverter<f32>,
    /// Largest reading of the force cell, N.
    force_range_n: f32,
    tick_s: f32,
    joints: JointEstimator,
    contact: ContactDetector,
    friction: FrictionEstimator,
    belt: BeltEstimator,
    response: ResponseEstimator,
    disturbance: DisturbanceEstimator,
    calibrator: LengthCalibrator,
    joint_friction: JointFriction,
}

/// State of the [`Estimators`] between ticks.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct EstimatesState {
    /// The contact estimate of the last tick and, after the update, for the next one.
    pub contact: ContactEstimate,
    /// The arm's model at the estimated angles and rates, with the joints' friction.
    pub model: Model,
    /// The arm with its calibrated length.
    pub arm: Arm<f32>,
    joints: JointState,
    decision: ContactState,
    friction: FrictionState,
    belt: BeltState,
    response: ResponseState,
    disturbance: DisturbanceState,
    calibration: CalibrationState,
    joint_friction: JointFrictionState,
}

impl EstimatesState {
    /// Returns the certainty of the decision about contact, 0 … 1.
    pub fn contact_confidence(&self) -> f32 {
        self.decision.confidence()
    }
}

impl Estimators {
    /// Makes the estimators of this configuration, with tracking loops that are faster than their settings by a factor.
    pub fn new<L: Law>(configuration: &Configuration<L>, tracking_speed: f32) -> Self {
        let Configuration {
            arm,
            converters,
            settings,
            ..
        } = configuration;
        let tick_s = configuration.tick_s();
        let slow_period_s = Turn::COUNT * tick_s;
        let force_cell = converters.force.converter();
        let joints = JointEstimatorSettings {
            bandwidth_rad_s: tracking_speed * settings.estimator.bandwidth_rad_s,
            ..settings.estimator
        };
        let [link_length_m, _] = arm.link_length_m;
        Self {
            force_cell,
            force_range_n: force_cell.value(force_cell.maximum_counts),
            tick_s,
            joints: JointEstimator::new(&joints, converters.encoders, configuration.tick_hz),
            contact: ContactDetector::new(&settings.contact),
            friction: FrictionEstimator::new(&settings.friction, &settings.contact, tick_s),
            belt: BeltEstimator::new(&settings.belt, tick_s),
            response: ResponseEstimator::new(&settings.response, tick_s),
            disturbance: DisturbanceEstimator::new(
                &settings.disturbance,
                settings.torque_limit_nm,
                slow_period_s,
            ),
            calibrator: LengthCalibrator::new(&settings.calibration, link_length_m, slow_period_s),
            joint_friction: JointFriction::new(arm.coulomb_friction_nm),
        }
    }

    /// Starts without readings of this arm.
    pub fn start(&self, arm: Arm<f32>) -> EstimatesState {
        let (friction, response) = (self.friction.start(), self.response.start());
        let contact = ContactEstimate {
            friction: *friction.estimate(),
            response: self.response.response(&response, 0.0, 0.0),
            ..Default::default()
        };
        EstimatesState {
            contact,
            model: Model::default(),
            arm,
            joints: JointState::default(),
            decision: ContactState::default(),
            friction,
            belt: BeltState::default(),
            response,
            disturbance: DisturbanceState::default(),
            calibration: CalibrationState::default(),
            joint_friction: JointFrictionState::default(),
        }
    }

    /// Corrects the predicted state of the arm with a frame's readings, `elapsed_ticks` after the previous ones, and
    /// decides about contact.
    ///
    /// # Errors
    /// [`Restart`] if the estimate of the joints has started from these readings, at rest.
    #[inline]
    pub fn observe(
        &self,
        state: &mut EstimatesState,
        frame: &SensorFrame,
        elapsed_ticks: u32,
        last: &LastCommand,
    ) -> Result<(), Restart> {
        let expected = &last.expected_acceleration_rad_s2;
        let joints = &mut state.joints;
        let followed = self
            .joints
            .correct(joints, &frame.joints, elapsed_ticks, expected);
        match followed {
            Ok(()) => {
                self.joints.untwist(joints, &last.torque_nm);
                let (theta_rad, theta_dot_rad_s) = (joints.theta_rad(), joints.theta_dot_rad_s());
                state.model.move_to(&state.arm, theta_rad, theta_dot_rad_s);
                if !self.joint_friction.is_zero() {
                    // It follows the travel between readings, which the prediction does not show.
                    let (friction, angles_rad) = (&mut state.joint_friction, joints.angles_rad());
                    let change_nm = self.joint_friction.tick(friction, &angles_rad);
                    state.model.add_friction_nm(&change_nm);
                }
            }
            // Nothing has been predicted for these readings.
            Err(Restart::FirstReadings) => self.evaluate(state),
            // The drive stops, and the model follows at the next tick.
            Err(Restart::EncoderJump) => {}
        }
        let force_n = Vector2::new(
            self.force_cell.value(frame.tangential_force.0),
            self.force_cell.value(frame.normal_force.0),
        );
        let touched = state.decision.touches();
        let touches = match self.contact.evidence() {
            Evidence::ForceCell => self
                .contact
                .update_from_force(&mut state.decision, force_n.y),
            Evidence::Encoders => {
                let mut encoders = self.encoder_reading(state, last);
                self.find_belt(state, &mut encoders);
                self.contact
                    .update_from_encoders(&mut state.decision, &encoders)
            }
        };
        let contact = &mut state.contact;
        contact.touches = touches;
        contact.lands = touches && !touched;
        contact.leaves = touched && !touches;
        contact.in_flight = state.decision.is_in_flight();
        contact.force_n = force_n;
        self.correct_friction(state, last.reference_velocity_m_s);
        followed
    }

    /// Corrects friction, and p with it, of a tip that touches and follows a reference with this velocity.
    #[inline(always)]
    fn correct_friction(&self, state: &mut EstimatesState, reference_velocity_m_s: f32) {
        let contact = &mut state.contact;
        if !contact.touches {
            return;
        }
        if self.is_in_range(&contact.force_n) {
            let tip_velocity_m_s = state.model.tip_velocity_m_s.x;
            let is_dragged = |slip: Slip| {
                let lag_m_s = reference_velocity_m_s - tip_velocity_m_s;
                slip.sign::<f32>() * lag_m_s > DRAGGED_M_S
                    && self.belt.may_stick(&state.belt, tip_velocity_m_s)
            };
            self.friction
                .correct(&mut state.friction, &contact.force_n, is_dragged);
        }
        contact.friction = *state.friction.estimate();
        contact.p_per_kg = state
            .model
            .p_per_kg(contact.friction.coefficient, contact.friction.slip);
    }

    /// Returns whether the force cell is not at the end of its range, where it reads less than the actual force.
    #[inline]
    fn is_in_range(&self, force_n: &Vector2<f32>) -> bool {
        let range_n = self.force_range_n;
        force_n.x.abs() < range_n && force_n.y.abs() < range_n
    }

    /// Updates friction, belt and response of a contact with the force at the last tick.
    #[inline]
    pub fn learn_in_contact(
        &self,
        state: &mut EstimatesState,
        observed: &Observed,
    ) -> SlowReadings {
        let is_informative = self.add_to_balance(state, observed);
        let (model, contact) = (&state.model, &state.contact);
        let force_n = contact.force_n;
        if self.is_in_range(&force_n) {
            self.friction.update(&mut state.friction, &force_n);
        }
        let friction = state.friction.estimate();
        self.belt
            .update(&mut state.belt, model.tip_velocity_m_s.x, Some(friction));
        let (last, p_per_kg) = (&observed.last, contact.p_per_kg);
        let slides = p_per_kg > 0.0 && !friction.sticks;
        let mut completes_block = false;
        if is_informative && slides && !last.saturated && self.response.is_enabled() {
            let slope = &model.free_slope_per_kg_m;
            let reading = ForceReading {
                normal_force_n: force_n.y,
                withheld_n: last.rounding_nm.vector().dot(slope) / p_per_kg,
            };
            completes_block = self.response.update(&mut state.response, &reading);
        } else {
            state.response.pause();
        }
        SlowReadings {
            // An unchanged reading would gain weight merely with time.
            shows_length: state.decision.is_certain() && state.joints.has_moved(),
            completes_block,
        }
    }

    /// Updates friction and belt at a tick without contact.
    #[inline]
    pub fn learn_in_the_air(&self, state: &mut EstimatesState, observed: &Observed) {
        if state.contact.leaves {
            self.friction.doubt(&mut state.friction);
        }
        let tip_velocity_m_s = state.model.tip_velocity_m_s.x;
        self.belt.update(&mut state.belt, tip_velocity_m_s, None);
        state.response.pause();
        self.add_to_balance(state, observed);
    }

    /// Adds a tick to the next update of the disturbance; returns whether force and torque show what the model does
    /// not explain.
    #[inline]
    fn add_to_balance(&self, state: &mut EstimatesState, observed: &Observed) -> bool {
        let force_n = &state.contact.force_n;
        let is_informative =
            state.decision.is_certain() && self.is_in_range(force_n) && observed.drove;
        if is_informative {
            let elapsed_s = observed.elapsed_ticks as f32 * self.tick_s;
            let torque_nm = &observed.last.torque_nm;
            state.disturbance.add(torque_nm, force_n, elapsed_s);
        } else {
            state.disturbance.pause();
        }
        is_informative
    }

    /// Predicts the arm's state at the next tick, given the command until then and whether it drives, and evaluates
    /// model and contact there.
    #[inline]
    pub fn prepare(&self, state: &mut EstimatesState, command: &mut LastCommand, drives: bool) {
        if drives {
            let model = &state.model;
            command.contact_acceleration_rad_s2 = model
                .contact_acceleration_rad_s2(&command.contact_force_n)
                .to_joints();
            command.expected_acceleration_rad_s2 = model
                .free_acceleration_rad_s2(&command.torque_nm)
                .to_joints()
                + command.contact_acceleration_rad_s2;
        }
        self.joints
            .predict(&mut state.joints, &command.expected_acceleration_rad_s2);
        self.evaluate(state);
    }

    /// Evaluates model, friction, p and the response of the contact at the estimated angles and rates.
    #[inline(never)]
    fn evaluate(&self, state: &mut EstimatesState) {
        // Friction of the joints enters as an unknown torque does.
        let disturbance_nm = state.disturbance.torque_nm - state.joint_friction.torque_nm();
        let (theta_rad, theta_dot_rad_s) =
            (state.joints.theta_rad(), state.joints.theta_dot_rad_s());
        let pose = Pose::new(&theta_rad);
        self.joints.expect_pose(&mut state.joints, &pose);
        state.model = Model::in_pose(
            &state.arm,
            &pose,
            theta_rad,
            theta_dot_rad_s,
            &disturbance_nm,
        );
        let (model, contact) = (&state.model, &mut state.contact);
        let friction = state.friction.estimate();
        let p_per_kg = model.p_per_kg(friction.coefficient, friction.slip);
        let p_ratio = p_per_kg / model.q22_per_kg;
        let response = self.response.response(&state.response, p_per_kg, p_ratio);
        contact.friction = *friction;
        contact.p_per_kg = p_per_kg;
        contact.p_ratio = p_ratio;
        contact.response = response;
    }

    /// Evaluates the response of the contact with a complete block of readings.
    #[inline]
    pub fn evaluate_response(&self, state: &mut EstimatesState) {
        self.response.evaluate(&mut state.response);
    }

    /// Updates the calibration with a gap that shows the links' length.
    #[inline]
    pub fn calibrate(&self, state: &mut EstimatesState) {
        let gap_m = self.gap_m(state);
        self.calibrator
            .update(&mut state.calibration, &mut state.arm, gap_m);
    }

    /// Updates the disturbance.
    // Out of line: contact and flight both contain it.
    #[inline(never)]
    pub fn balance_torques(&self, state: &mut EstimatesState) {
        let contact = &state.contact;
        let p_ratio = contact.touches.then_some(contact.p_ratio);
        let loop_share = contact.response.loop_share;
        self.disturbance
            .update(&mut state.disturbance, &state.model, p_ratio, loop_share);
    }
}
