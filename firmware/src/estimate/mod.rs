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
use painleve_shared::counts::{EncoderScale, LinearConverter, LinearScale};
use painleve_shared::frame::SensorFrame;
use painleve_shared::{Arm, JointTorque, Pose, Slip};

use self::belt::{BeltEstimator, BeltSpeedSettings};
use self::calibration::{CalibrationSettings, LengthCalibrator};
use self::contact::{ContactDetector, ContactSettings, Evidence};
pub use self::contact_estimate::ContactEstimate;
use self::disturbance::{DisturbanceEstimator, DisturbanceSettings};
use self::friction::{FrictionEstimator, FrictionSettings};
use self::joint_friction::JointFriction;
use self::joints::{JointEstimator, JointEstimatorSettings, Restart};
use self::model::Model;
use self::response::{ForceReading, ResponseEstimator, ResponseSettings};
use crate::last_command::LastCommand;
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
    /// Torque until the tick, N·m.
    pub torque_nm: JointTorque<f32>,
    /// Torque that rounding withheld from it, N·m.
    pub rounding_nm: JointTorque<f32>,
    /// Whether that torque was limited.
    pub saturated: bool,
}

/// Settings of all estimators, and the scalings of their readings.
#[derive(Clone, Copy, Debug)]
pub struct EstimateSettings<'a> {
    /// Control rate, Hz.
    pub tick_hz: f32,
    /// Scalings of the encoders of θ1 and of θ2 − θ1.
    pub encoders: [EncoderScale; 2],
    /// Scaling of the force cell.
    pub force: LinearScale<f32>,
    /// Largest torque on either joint, N·m.
    pub torque_limit_nm: f32,
    /// Coulomb friction of the joints, N·m.
    pub coulomb_friction_nm: [f32; 2],
    /// Tracking loops of the joints.
    pub joints: JointEstimatorSettings,
    /// Contact decision.
    pub contact: &'a ContactSettings,
    /// Friction.
    pub friction: &'a FrictionSettings,
    /// Bounds of the belt's speed.
    pub belt: &'a BeltSpeedSettings,
    /// Response of the contact.
    pub response: &'a ResponseSettings,
    /// Unknown torques.
    pub disturbance: &'a DisturbanceSettings,
    /// Calibration of the links' length.
    pub calibration: &'a CalibrationSettings,
}

/// All estimators of one arm, and what they know of it.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Estimators {
    /// The contact estimate of the last tick and, after the update, for the next one.
    pub contact: ContactEstimate,
    /// The arm's model at the estimated angles and rates, with the joints' friction.
    pub model: Model,
    /// The arm with its calibrated length.
    pub arm: Arm<f32>,
    joints: JointEstimator,
    decision: ContactDetector,
    friction: FrictionEstimator,
    belt: BeltEstimator,
    response: ResponseEstimator,
    disturbance: DisturbanceEstimator,
    calibrator: LengthCalibrator,
    joint_friction: JointFriction,
    force_cell: LinearConverter<f32>,
    /// Largest reading of the force cell, N.
    force_range_n: f32,
    tick_s: f32,
}

impl Estimators {
    /// Makes the estimators with these settings, without readings of this arm.
    pub fn new(settings: &EstimateSettings<'_>, arm: Arm<f32>) -> Self {
        let tick_s = 1.0 / settings.tick_hz;
        let slow_period_s = Turn::COUNT * tick_s;
        let force_cell = settings.force.converter();
        let [link_length_m, _] = arm.link_length_m();
        let friction = FrictionEstimator::new(settings.friction, settings.contact, tick_s);
        let response = ResponseEstimator::new(settings.response, tick_s);
        let contact = ContactEstimate {
            friction: *friction.estimate(),
            response: response.response(0.0, 0.0),
            ..Default::default()
        };
        Self {
            contact,
            model: Model::default(),
            arm,
            force_cell,
            force_range_n: force_cell.value(force_cell.maximum_counts),
            tick_s,
            joints: JointEstimator::new(&settings.joints, settings.encoders, settings.tick_hz),
            decision: ContactDetector::new(settings.contact),
            friction,
            belt: BeltEstimator::new(settings.belt, tick_s),
            response,
            disturbance: DisturbanceEstimator::new(
                settings.disturbance,
                settings.torque_limit_nm,
                slow_period_s,
            ),
            calibrator: LengthCalibrator::new(settings.calibration, link_length_m, slow_period_s),
            joint_friction: JointFriction::new(settings.coulomb_friction_nm),
        }
    }

    /// Returns the certainty of the decision about contact, 0 … 1.
    pub fn contact_confidence(&self) -> f32 {
        self.decision.confidence()
    }

    /// Returns whether the encoders, and whether the force cell, can give a frame's readings.
    #[inline]
    pub fn readable(&self, frame: &SensorFrame) -> (bool, bool) {
        let force_cell = &self.force_cell;
        let forces = force_cell.contains(frame.normal_force.0)
            && force_cell.contains(frame.tangential_force.0);
        (self.joints.can_read(frame.joints), forces)
    }

    /// Corrects the predicted state of the arm with a frame's readings, `elapsed_ticks` after the previous ones, and
    /// decides about contact.
    ///
    /// # Errors
    /// [`Restart`] if the estimate of the joints has started from these readings, at rest.
    #[inline]
    pub fn observe(
        &mut self,
        frame: &SensorFrame,
        elapsed_ticks: u32,
        last: &LastCommand,
    ) -> Result<(), Restart> {
        let expected = &last.expected_acceleration_rad_s2;
        let followed = self
            .joints
            .correct(&frame.joints, elapsed_ticks, expected, &last.torque_nm);
        match followed {
            Ok(()) => {
                let (theta_rad, theta_dot_rad_s) =
                    (self.joints.theta_rad(), self.joints.theta_dot_rad_s());
                self.model.move_to(&self.arm, theta_rad, theta_dot_rad_s);
                if !self.joint_friction.is_zero() {
                    // It follows the travel between readings, which the prediction does not show.
                    let angles_rad = self.joints.angles_rad();
                    let change_nm = self.joint_friction.tick(&angles_rad);
                    self.model.add_friction_nm(&change_nm);
                }
            }
            // Nothing has been predicted for these readings.
            Err(Restart::FirstReadings) => self.evaluate(),
            // The drive stops, and the model follows at the next tick.
            Err(Restart::EncoderJump) => {}
        }
        let force_n = Vector2::new(
            self.force_cell.value(frame.tangential_force.0),
            self.force_cell.value(frame.normal_force.0),
        );
        let touched = self.decision.touches();
        let touches = match self.decision.evidence() {
            Evidence::ForceCell => self.decision.update_from_force(force_n.y),
            Evidence::Encoders => {
                let mut encoders = self.encoder_reading(last);
                self.find_belt(&mut encoders);
                self.decision.update_from_encoders(&encoders)
            }
        };
        let contact = &mut self.contact;
        contact.touches = touches;
        contact.lands = touches && !touched;
        contact.leaves = touched && !touches;
        contact.in_flight = self.decision.is_in_flight();
        contact.force_n = force_n;
        self.correct_friction(last.reference_velocity_m_s);
        followed
    }

    /// Corrects friction, and p with it, of a tip that touches and follows a reference with this velocity.
    #[inline(always)]
    fn correct_friction(&mut self, reference_velocity_m_s: f32) {
        if !self.contact.touches {
            return;
        }
        let force_n = self.contact.force_n;
        if self.is_in_range(&force_n) {
            let tip_velocity_m_s = self.model.tip_velocity_m_s.x;
            let is_dragged = |slip: Slip| {
                let lag_m_s = reference_velocity_m_s - tip_velocity_m_s;
                slip.sign::<f32>() * lag_m_s > DRAGGED_M_S && self.belt.may_stick(tip_velocity_m_s)
            };
            self.friction.correct(&force_n, is_dragged);
        }
        let contact = &mut self.contact;
        contact.friction = *self.friction.estimate();
        contact.p_per_kg = self
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
    pub fn learn_in_contact(&mut self, observed: &Observed) -> SlowReadings {
        let is_informative = self.add_to_balance(observed);
        let (model, contact) = (&self.model, &self.contact);
        let force_n = contact.force_n;
        if self.is_in_range(&force_n) {
            self.friction.update(&force_n);
        }
        let friction = self.friction.estimate();
        self.belt.update(model.tip_velocity_m_s.x, Some(friction));
        let p_per_kg = contact.p_per_kg;
        let slides = p_per_kg > 0.0 && !friction.sticks;
        let mut completes_block = false;
        if is_informative && slides && !observed.saturated && self.response.is_enabled() {
            let slope = &model.free_slope_per_kg_m;
            let reading = ForceReading {
                normal_force_n: force_n.y,
                withheld_n: observed.rounding_nm.vector().dot(slope) / p_per_kg,
            };
            completes_block = self.response.update(&reading);
        } else {
            self.response.pause();
        }
        SlowReadings {
            // An unchanged reading would gain weight merely with time.
            shows_length: self.decision.is_certain() && self.joints.has_moved(),
            completes_block,
        }
    }

    /// Updates friction and belt at a tick without contact.
    #[inline]
    pub fn learn_in_the_air(&mut self, observed: &Observed) {
        if self.contact.leaves {
            self.friction.doubt();
        }
        let tip_velocity_m_s = self.model.tip_velocity_m_s.x;
        self.belt.update(tip_velocity_m_s, None);
        self.response.pause();
        self.add_to_balance(observed);
    }

    /// Adds a tick to the next update of the disturbance; returns whether force and torque show what the model does
    /// not explain.
    #[inline]
    fn add_to_balance(&mut self, observed: &Observed) -> bool {
        let force_n = &self.contact.force_n;
        let is_informative =
            self.decision.is_certain() && self.is_in_range(force_n) && observed.drove;
        if is_informative {
            let elapsed_s = observed.elapsed_ticks as f32 * self.tick_s;
            self.disturbance
                .add(&observed.torque_nm, force_n, elapsed_s);
        } else {
            self.disturbance.pause();
        }
        is_informative
    }

    /// Predicts the arm's state at the next tick, given the command until then and whether it drives, and evaluates
    /// model and contact there.
    #[inline]
    pub fn prepare(&mut self, command: &mut LastCommand, drives: bool) {
        if drives {
            let model = &self.model;
            command.contact_acceleration_rad_s2 = model
                .contact_acceleration_rad_s2(&command.contact_force_n)
                .to_joints();
            command.expected_acceleration_rad_s2 = model
                .free_acceleration_rad_s2(&command.torque_nm)
                .to_joints()
                + command.contact_acceleration_rad_s2;
        }
        self.joints.predict(&command.expected_acceleration_rad_s2);
        self.evaluate();
    }

    /// Evaluates model, friction, p and the response of the contact at the estimated angles and rates.
    #[inline(never)]
    fn evaluate(&mut self) {
        // Friction of the joints enters as an unknown torque does.
        let disturbance_nm = self.disturbance.torque_nm - self.joint_friction.torque_nm();
        let (theta_rad, theta_dot_rad_s) = (self.joints.theta_rad(), self.joints.theta_dot_rad_s());
        let pose = Pose::new(&theta_rad);
        self.joints.expect_pose(&pose);
        self.model = Model::in_pose(
            &self.arm,
            &pose,
            theta_rad,
            theta_dot_rad_s,
            &disturbance_nm,
        );
        let (model, contact) = (&self.model, &mut self.contact);
        let friction = self.friction.estimate();
        let p_per_kg = model.p_per_kg(friction.coefficient, friction.slip);
        let p_ratio = p_per_kg / model.q22_per_kg;
        let response = self.response.response(p_per_kg, p_ratio);
        contact.friction = *friction;
        contact.p_per_kg = p_per_kg;
        contact.p_ratio = p_ratio;
        contact.response = response;
    }

    /// Evaluates the response of the contact with a complete block of readings.
    #[inline]
    pub fn evaluate_response(&mut self) {
        self.response.evaluate();
    }

    /// Updates the calibration with a gap that shows the links' length.
    #[inline]
    pub fn calibrate(&mut self) {
        let gap_m = self.gap_m();
        self.calibrator.update(&mut self.arm, gap_m);
    }

    /// Updates the disturbance.
    // Out of line: contact and flight both contain it.
    #[inline(never)]
    pub fn balance_torques(&mut self) {
        let contact = &self.contact;
        let p_ratio = contact.touches.then_some(contact.p_ratio);
        let loop_share = contact.response.loop_share;
        self.disturbance.update(&self.model, p_ratio, loop_share);
    }
}
