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
pub mod disturbance;
pub mod encoder_correction;
pub mod friction;
pub mod joint_friction;
pub mod joints;
pub mod model;
pub mod response;

use nalgebra::Vector2;
use painleve_shared::counts::LinearConverter;
use painleve_shared::frame::SensorFrame;
use painleve_shared::{Arm, JointTorque, Pose, Slip};

use self::belt::{BOUND_ERROR_M_S, BeltEstimator};
use self::calibration::LengthCalibrator;
use self::contact::{ContactDetector, Evidence};
use self::disturbance::DisturbanceEstimator;
use self::friction::{FrictionEstimate, FrictionEstimator};
use self::joint_friction::JointFriction;
use self::joints::{JointEstimator, Restart};
use self::model::Model;
use self::response::{ContactResponse, ResponseEstimator};
use crate::last_command::LastCommand;
use crate::schedule::Turn;

/// Smallest distance that matters, m. Averages of the encoders' readings do not resolve less, because successive roundings are not
/// independent; a reference that near has been caught up with.
pub(crate) const RESOLVED_M: f32 = 2e-5;

/// The contact estimate at a tick, for the posture predicted for it: contact and force from its readings, and in contact
/// friction and p.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContactEstimate {
    /// Whether the tip touches.
    pub touches: bool,
    /// Whether the tip touches now but did not at the previous tick.
    pub lands: bool,
    /// Whether the tip touched at the previous tick but does not now.
    pub leaves: bool,
    /// Measured contact force (f_t, f_n), N.
    pub force_n: Vector2<f32>,
    /// Estimated friction.
    pub friction: FrictionEstimate,
    /// p with that friction, 1/kg.
    pub p_per_kg: f32,
    /// What the contact's response to torque allows, from the readings before.
    pub response: ContactResponse,
}

/// What the update after a tick needs of it besides the estimates.
#[derive(Clone, Copy, Debug, Default)]
pub struct Observed {
    /// Ticks since the previous readings: 1 unless frames were lost.
    pub elapsed_ticks: u32,
    /// Whether torque was applied until the tick.
    pub drove: bool,
    /// Torque until the tick, N·m.
    pub torque_nm: JointTorque<f32>,
    /// Torque that rounding withheld from it, N·m.
    pub rounding_nm: JointTorque<f32>,
    /// Whether that torque was limited.
    pub saturated: bool,
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
    pub(crate) joints: JointEstimator,
    /// The contact decision.
    pub detector: ContactDetector,
    pub(crate) friction_filter: FrictionEstimator,
    pub(crate) belt: BeltEstimator,
    pub(crate) force_cell: LinearConverter<f32>,
    /// Largest reading of the force cell, N.
    pub(crate) force_range_n: f32,
    pub(crate) response: ResponseEstimator,
    pub(crate) disturbance: DisturbanceEstimator,
    pub(crate) calibrator: LengthCalibrator,
    pub(crate) joint_friction: JointFriction,
}

impl Estimators {
    /// Returns whether the encoders, and whether the force cell, can give a frame's readings.
    #[inline]
    pub fn can_read(&self, frame: &SensorFrame) -> (bool, bool) {
        let forces = [frame.normal_force, frame.tangential_force];
        let forces = forces.iter().all(|it| self.force_cell.contains(it.0));
        (self.joints.can_read(frame.joints), forces)
    }

    /// Corrects the predicted state of the arm with a frame's readings, `elapsed_ticks` after the previous ones, decides
    /// about contact, and corrects friction, and p with it, of a tip that touches.
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
                let (theta, theta_dot) = (self.joints.theta_rad(), self.joints.theta_dot_rad_s());
                self.model.move_to(&self.arm, theta, theta_dot);
                if !self.joint_friction.is_zero {
                    // It follows the travel between readings, which the prediction does not show.
                    self.model.bias_nm += self.joint_friction.tick(&self.joints.angles_rad);
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
        let touches = match self.detector.settings.evidence {
            Evidence::ForceCell => self.detector.update_from_force(force_n.y),
            Evidence::Encoders => self.touches_by_encoders(last),
        };
        let contact = &mut self.contact;
        let touched = core::mem::replace(&mut contact.touches, touches);
        contact.lands = touches && !touched;
        contact.leaves = touched && !touches;
        contact.force_n = force_n;
        if touches {
            if self.is_in_range() {
                let tip_velocity_m_s = self.model.tip_velocity_m_s.x;
                let is_dragged = |slip: Slip| {
                    let lag_m_s = last.reference_velocity_m_s - tip_velocity_m_s;
                    let falls_behind = slip.sign::<f32>() * lag_m_s > 2.0 * BOUND_ERROR_M_S;
                    falls_behind && self.belt.may_stick(tip_velocity_m_s)
                };
                let contact = &mut self.contact;
                self.friction_filter
                    .correct(&mut contact.friction, &contact.force_n, is_dragged);
            }
            self.contact.p_per_kg = self.model.p_per_kg(&self.contact.friction);
        }
        followed
    }

    /// Returns whether the force cell is not at the end of its range, where it reads less than the actual force.
    #[inline]
    fn is_in_range(&self) -> bool {
        let (force_n, range_n) = (&self.contact.force_n, self.force_range_n);
        force_n.x.abs() < range_n && force_n.y.abs() < range_n
    }

    /// Updates friction, belt and response of the contact with the readings of the last tick, at which the tip `touches` or
    /// not, and what has this turn.
    #[inline(always)]
    pub(crate) fn learn(&mut self, touches: bool, observed: &Observed, turn: Turn) {
        let is_informative = self.add_to_balance(observed);
        let is_in_range = self.is_in_range();
        let (model, contact) = (&self.model, &mut self.contact);
        let friction = &mut contact.friction;
        if touches && is_in_range {
            self.friction_filter.update(friction, &contact.force_n);
        } else if contact.leaves {
            let at_rest = self.belt.slip_at_rest();
            self.friction_filter.leave(friction, at_rest);
        }
        self.belt.update(
            model.tip_velocity_m_s.x,
            touches.then_some(friction),
            observed.elapsed_ticks,
        );
        let p_per_kg = contact.p_per_kg;
        let slides = touches && p_per_kg > 0.0 && !contact.friction.sticks;
        let responds =
            is_informative && slides && !observed.saturated && self.response.settings.enabled;
        if responds {
            let slope = &model.free_slope_per_kg_m;
            let withheld_n = observed.rounding_nm.vector().dot(slope) / p_per_kg;
            self.response
                .update(contact.force_n.y, withheld_n, observed.elapsed_ticks);
        } else {
            self.response.pause();
        }
        match turn {
            Turn::Balance => {
                self.disturbance.update(&self.model, &self.contact);
                // The gap of a tip that certainly touches shows the links' length. An unchanged reading would gain weight
                // merely with time.
                let is_certain = touches && self.detector.is_certain();
                if is_certain && observed.drove && self.joints.moved {
                    let gap_m = self.gap_m();
                    self.calibrator.update(&mut self.arm, gap_m);
                }
            }
            Turn::Average if responds => self.response.average(),
            Turn::Bound if responds => self.response.bound(),
            Turn::Average | Turn::Bound | Turn::Edges => {}
        }
    }

    /// Adds a tick to the next update of the disturbance; returns whether force and torque show what the model does
    /// not explain.
    #[inline]
    fn add_to_balance(&mut self, observed: &Observed) -> bool {
        let is_informative = self.detector.is_certain() && self.is_in_range() && observed.drove;
        if is_informative {
            let (torque_nm, force_n) = (&observed.torque_nm, &self.contact.force_n);
            self.disturbance
                .add(torque_nm, force_n, observed.elapsed_ticks);
        } else {
            self.disturbance.pause(observed.drove);
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
        } else if self.joints.unwind() {
            // No joint has travelled a whole turn.
            self.joint_friction.angles_rad = None;
        }
        self.joints
            .predict(&command.expected_acceleration_rad_s2, 1);
        self.evaluate();
    }

    /// Evaluates model, friction, p and the response of the contact at the estimated angles and rates.
    #[inline(never)]
    fn evaluate(&mut self) {
        // Friction of the joints enters as an unknown torque does.
        let disturbance_nm = self.disturbance.torque_nm - self.joint_friction.torque_nm();
        let (theta, theta_dot) = (self.joints.theta_rad(), self.joints.theta_dot_rad_s());
        let pose = Pose::new(&theta);
        self.joints.expect_pose(&pose);
        self.model = Model::in_pose(&self.arm, &pose, theta, theta_dot, &disturbance_nm);
        let (model, contact) = (&self.model, &mut self.contact);
        contact.p_per_kg = model.p_per_kg(&contact.friction);
        let p_ratio = contact.p_per_kg / model.q22_per_kg;
        contact.response = self.response.response(contact.p_per_kg, p_ratio);
    }

    /// Returns the measured height of the tip above the belt, m.
    #[inline]
    fn gap_m(&self) -> f32 {
        // Measured minus estimated angles after the correction.
        let residual = self.joints.innovation_rad.to_links() * (1.0 - self.joints.angle_gain);
        let jacobian = &self.model.jacobian;
        self.model.gap_m + jacobian.m21 * residual.first() + jacobian.m22 * residual.second()
    }

    /// Decides about contact from the encoders: returns whether the tip touches. The belt is assumed at the lowest tip
    /// position so far: initially the start position, then every lower one.
    fn touches_by_encoders(&mut self, last: &LastCommand) -> bool {
        let (model, joints) = (&self.model, &self.joints);
        let count_rad = joints.rad_per_count;
        // Half a count of each encoder; the second encoder affects θ2 alone.
        let rounding_m =
            0.5 * (model.tip_m.x.abs() * count_rad + model.jacobian.m22.abs() * count_rad);
        // Steady innovation after the contact force has vanished.
        let release = last.contact_acceleration_rad_s2.vector() * -joints.lag_counts_s2;
        let innovation = joints.innovation_rad.vector() * (1.0 / count_rad);
        let held_counts2 = 0.5 * release.norm_squared() - release.dot(&innovation);
        let moved = joints.moved;
        let mut gap_m = self.gap_m();
        let gap_error_m = RESOLVED_M + self.calibrator.gap_error_m(rounding_m);
        if self.calibrator.is_open() || gap_m < -gap_error_m {
            self.calibrator.restart(&mut self.arm, gap_m);
            gap_m = 0.0;
        }
        self.detector
            .update_from_encoders(gap_m / gap_error_m, held_counts2, moved)
    }
}
