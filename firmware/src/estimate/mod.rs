//! Estimates the state of arm, contact and belt from the sensors.
//!
//! - [`joints`]: angles and rates from encoder counts
//! - [`model`]: the equations of motion at those angles and rates
//! - [`contact`]: contact decision
//! - [`friction`], [`belt`]: friction and direction of slip, bounds of the belt's speed
//! - [`calibration`]: length of the links
//! - [`response`]: how much the contact gives
//! - [`joint_friction`]: Coulomb friction of the joints
//! - [`disturbance`]: torques that the model does not explain

pub mod belt;
pub mod calibration;
pub mod contact;
pub mod disturbance;
pub mod friction;
pub mod joint_friction;
pub mod joints;
pub mod model;
pub mod response;

use nalgebra::Vector2;
use painleve_shared::Arm;
use painleve_shared::counts::{EncoderScale, LinearConverter, LinearScale};
use painleve_shared::frame::SensorFrame;

use self::belt::{BeltEstimator, BeltSpeedSettings, BeltState};
use self::calibration::{CalibrationSettings, CalibrationState, LengthCalibrator};
use self::contact::{ContactDetector, ContactSettings, ContactState, EncoderReading, Evidence};
use self::disturbance::{Balance, DisturbanceEstimator, DisturbanceSettings, DisturbanceState};
use self::friction::{FrictionEstimate, FrictionEstimator, FrictionSettings, FrictionState};
use self::joint_friction::{JointFriction, JointFrictionState};
use self::joints::{EncoderJump, JointEstimator, JointEstimatorSettings, JointState};
use self::model::Model;
use self::response::{
    ContactResponse, ForceReading, Place, ResponseEstimator, ResponseSettings, ResponseState,
};
use crate::last_command::LastCommand;

/// Largest friction above the estimate that may explain a throw.
const THROWN_BY_FRICTION: f32 = 0.4;

/// Disturbance and calibration are updated at every other tick. The search for the edges takes the ticks
/// between, so that no tick is long.
const HEAVY_EVERY_TICKS: f32 = 2.0;

/// Least velocity by which a sticking tip falls behind its reference, m/s.
const DRAGGED_M_S: f32 = 0.02;
/// Speed below which a reference that an edge holds back waits there, m/s.
const WAITING_M_S: f32 = 0.01;

/// The contact estimate after a tick's readings.
#[derive(Clone, Copy, Debug)]
pub struct ContactEstimate {
    /// Whether the tip touches.
    pub touches: bool,
    /// Whether the tip touches now but did not at the previous tick.
    pub lands: bool,
    /// Whether flight is certain.
    pub in_flight: bool,
    /// Certainty of `touches`, 0 … 1.
    pub confidence: f32,
    /// Measured contact force (f_t, f_n), N.
    pub force_n: Vector2<f32>,
    /// Estimated friction.
    pub friction: FrictionEstimate,
    /// p with that friction, 1/kg.
    pub p_per_kg: f32,
    /// What the contact's response to torque allows.
    pub response: ContactResponse,
}

/// What one tick adds to the slow estimates.
#[derive(Clone, Copy, Debug)]
pub struct SlowReadings {
    /// Measured height of the tip above the belt, m.
    gap_m: f32,
    /// p/Q22.
    p_ratio: f32,
    /// Time since the previous readings, s.
    elapsed_s: f32,
    /// Whether the gap shows the links' length: the tip certainly touches, and has moved.
    shows_length: bool,
    /// Whether force and torque show what the model does not explain.
    is_informative: bool,
    /// Whether a block of the response's readings is complete.
    completes_block: bool,
}

/// One frame's readings.
#[derive(Clone, Copy, Debug)]
pub struct Readings<'a> {
    /// The frame.
    pub frame: &'a SensorFrame,
    /// Ticks since the previous readings: 1 unless frames were lost.
    pub elapsed_ticks: u32,
}

/// Settings of all estimators, and the scalings of their readings.
#[derive(Clone, Copy, Debug)]
pub struct EstimateSettings<'a> {
    /// Control rate, Hz.
    pub tick_hz: f32,
    /// Factor by which the tracking loops are faster than their settings.
    pub tracking_speed: f32,
    /// Scalings of the encoders of θ1 and of θ2 − θ1.
    pub encoders: [EncoderScale; 2],
    /// Scaling of the force cell.
    pub force: LinearScale<f32>,
    /// Length of the first link before calibration, m.
    pub link_length_m: f32,
    /// Tracking loops of the joints.
    pub joints: &'a JointEstimatorSettings,
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

/// All estimators of one arm.
#[derive(Clone, Debug)]
pub struct Estimators {
    force_cell: LinearConverter<f32>,
    tick_s: f32,
    joints: JointEstimator,
    contact: ContactDetector,
    friction: FrictionEstimator,
    belt: BeltEstimator,
    response: ResponseEstimator,
    disturbance: DisturbanceEstimator,
    calibrator: LengthCalibrator,
}

/// State of the [`Estimators`] between ticks.
#[derive(Clone, Copy, Debug)]
pub struct EstimatesState {
    /// The arm with its calibrated length.
    pub arm: Arm<f32>,
    joints: JointState,
    contact: ContactState,
    friction: FrictionState,
    belt: BeltState,
    response: ResponseState,
    disturbance: DisturbanceState,
    calibration: CalibrationState,
}

impl EstimatesState {
    /// Returns the arm's model at the estimated angles and rates, with the joints' friction.
    #[inline]
    pub fn model(&self, friction: &JointFriction, state: &mut JointFrictionState) -> Model {
        // Friction of the joints enters as an unknown torque does.
        let mut disturbance_nm = self.disturbance.torque_nm;
        if !friction.is_zero() {
            disturbance_nm = disturbance_nm - friction.tick(state, &self.joints.angles_rad());
        }
        Model::new(
            &self.arm,
            self.joints.theta_rad(),
            self.joints.theta_dot_rad_s(),
            &disturbance_nm,
        )
    }
}

impl Estimators {
    /// Makes the estimators with these settings.
    pub fn new(settings: &EstimateSettings<'_>) -> Self {
        let tick_s = 1.0 / settings.tick_hz;
        Self {
            force_cell: settings.force.converter(),
            tick_s,
            joints: JointEstimator::new(
                &JointEstimatorSettings {
                    bandwidth_rad_s: settings.tracking_speed * settings.joints.bandwidth_rad_s,
                    ..*settings.joints
                },
                settings.encoders,
                settings.tick_hz,
            ),
            contact: ContactDetector::new(settings.contact),
            friction: FrictionEstimator::new(
                settings.friction,
                settings.contact.force_noise_n,
                tick_s,
            ),
            belt: BeltEstimator::new(settings.belt, tick_s),
            response: ResponseEstimator::new(settings.response, tick_s),
            disturbance: DisturbanceEstimator::new(
                settings.disturbance,
                HEAVY_EVERY_TICKS * tick_s,
            ),
            calibrator: LengthCalibrator::new(
                settings.calibration,
                settings.link_length_m,
                HEAVY_EVERY_TICKS * tick_s,
            ),
        }
    }

    /// Starts without readings of this arm.
    pub fn start(&self, arm: Arm<f32>) -> EstimatesState {
        EstimatesState {
            arm,
            joints: JointState::default(),
            contact: ContactState::default(),
            friction: self.friction.start(),
            belt: BeltState::default(),
            response: self.response.start(),
            disturbance: DisturbanceState::default(),
            calibration: CalibrationState::default(),
        }
    }

    /// Updates the joint estimate with the encoders' readings and the expected effects of the last
    /// command.
    ///
    /// # Errors
    /// [`EncoderJump`] if a joint seems to have moved faster than it can; the estimate restarts
    /// from these readings.
    #[inline]
    pub fn follow_joints(
        &self,
        state: &mut EstimatesState,
        readings: &Readings<'_>,
        last: &LastCommand,
    ) -> Result<(), EncoderJump> {
        self.joints.update(
            &mut state.joints,
            &readings.frame.joints,
            readings.elapsed_ticks,
            &last.expected_acceleration_rad_s2,
        )?;
        self.joints.untwist(&mut state.joints, &last.torque_nm);
        Ok(())
    }

    /// Updates contact, friction and belt with the readings, given the arm's model at the estimated state and
    /// the torque until now; `drives` states whether torque was applied.
    #[inline]
    pub fn observe_contact(
        &self,
        state: &mut EstimatesState,
        model: &Model,
        readings: &Readings<'_>,
        last: &LastCommand,
        drives: bool,
    ) -> (ContactEstimate, SlowReadings) {
        let Readings {
            frame,
            elapsed_ticks,
        } = *readings;
        let force_n = Vector2::new(
            self.force_cell.value(frame.tangential_force.0),
            self.force_cell.value(frame.normal_force.0),
        );
        // At the end of its range the force cell reads less than the actual force.
        let range = self.force_cell.maximum_counts;
        let force_in_range = [frame.tangential_force, frame.normal_force]
            .iter()
            .all(|force| force.0.abs() < range);

        let gap_m = self.gap_m(&state.joints, model);
        let touched = state.contact.touches();
        let contact = match self.contact.evidence() {
            Evidence::ForceCell => self
                .contact
                .update_from_force(&mut state.contact, force_n.y),
            Evidence::Encoders => {
                let mut encoders = self.encoder_reading(state, model, gap_m, last);
                self.find_belt(state, &mut encoders);
                self.contact
                    .update_from_encoders(&mut state.contact, &encoders)
            }
        };
        let certain = state.contact.is_certain();
        let tip_velocity_m_s = model.tip_velocity_m_s.x;
        if contact {
            if !touched && let Some(slip) = self.belt.slip(&state.belt, tip_velocity_m_s) {
                state.friction.expect_slip(slip);
            }
            if force_in_range {
                let slip = state.friction.slip().sign::<f32>();
                let lag_m_s = last.reference_velocity_m_s - tip_velocity_m_s;
                let dragged = slip * lag_m_s > DRAGGED_M_S
                    && self.belt.may_stick(&state.belt, tip_velocity_m_s);
                self.friction.update(&mut state.friction, &force_n, dragged);
            }
        } else if touched {
            self.explain_throw(&mut state.friction, model);
        }

        let mut friction = state.friction.estimate();
        let sliding = contact.then_some(&friction);
        self.belt.update(&mut state.belt, tip_velocity_m_s, sliding);
        let p_per_kg = model.p_per_kg(friction.coefficient, friction.slip);
        let p_ratio = p_per_kg / model.q22_per_kg;
        let is_informative = certain && force_in_range && drives;
        let slides = contact && p_per_kg > 0.0 && !friction.sticks;
        let mut completes_block = false;
        if is_informative && slides && !last.is_constrained() && self.response.is_enabled() {
            let (_, slope) = model.free_normal_acceleration();
            let reading = ForceReading {
                normal_force_n: force_n.y,
                withheld_n: last.rounding_nm.vector().dot(&slope) / p_per_kg,
            };
            completes_block = self.response.update(&mut state.response, &reading);
        } else {
            state.response.pause();
        }
        let slow = SlowReadings {
            gap_m,
            p_ratio,
            elapsed_s: elapsed_ticks as f32 * self.tick_s,
            // An unchanged reading would gain weight merely with time.
            shows_length: contact && certain && state.joints.has_moved(),
            is_informative,
            completes_block,
        };
        let response = self.response.response(&state.response, p_per_kg, p_ratio);
        if !response.has_lagged {
            // A rigid contact would follow the excess at once.
            friction.catch_up = 0.0;
        }
        let contact = ContactEstimate {
            touches: contact,
            lands: contact && !touched,
            in_flight: state.contact.is_in_flight(),
            confidence: state.contact.confidence(),
            force_n,
            friction,
            p_per_kg,
            response,
        };
        (contact, slow)
    }

    /// Updates the response of the contact if a block of readings is complete; returns whether it was. The
    /// disturbance leaves this tick out.
    #[inline]
    pub fn evaluate_response(
        &self,
        state: &mut EstimatesState,
        contact: &mut ContactEstimate,
        slow: &SlowReadings,
        last: &LastCommand,
    ) -> bool {
        if slow.is_informative {
            let (torque_nm, force_n) = (&last.torque_nm, &contact.force_n);
            state.disturbance.skip(torque_nm, force_n, slow.elapsed_s);
        } else {
            state.disturbance.pause();
        }
        if slow.completes_block {
            let p_ratio = slow.p_ratio;
            let place = Place {
                p_ratio,
                waits_at_edge: last.at_edge && last.reference_velocity_m_s.abs() < WAITING_M_S,
            };
            self.response.evaluate(&mut state.response, &place);
            contact.response = self
                .response
                .response(&state.response, contact.p_per_kg, p_ratio);
        }
        slow.completes_block
    }

    /// Updates the calibration.
    #[inline]
    pub fn calibrate(&self, state: &mut EstimatesState, slow: &SlowReadings) {
        if slow.shows_length {
            self.calibrator
                .update(&mut state.calibration, &mut state.arm, slow.gap_m);
        }
    }

    /// Updates the disturbance.
    #[inline]
    pub fn balance_torques(
        &self,
        state: &mut EstimatesState,
        model: &Model,
        contact: &ContactEstimate,
        slow: &SlowReadings,
        last: &LastCommand,
    ) {
        if slow.is_informative {
            self.disturbance.update(
                &mut state.disturbance,
                model,
                &Balance {
                    torque_nm: last.torque_nm,
                    force_n: contact.force_n,
                    p_ratio: contact.touches.then_some(slow.p_ratio),
                    loop_share: contact.response.loop_share,
                    elapsed_s: slow.elapsed_s,
                },
            );
        } else {
            state.disturbance.pause();
        }
    }

    /// Returns the measured height of the tip above the belt, m.
    #[inline]
    fn gap_m(&self, joints: &JointState, model: &Model) -> f32 {
        let residual = joints.innovation_rad() * self.joints.residual_share();
        let jacobian = &model.jacobian;
        model.gap_m + jacobian.m21 * residual.first() + jacobian.m22 * residual.second()
    }

    /// Returns the contact evidence from the encoders.
    fn encoder_reading(
        &self,
        state: &EstimatesState,
        model: &Model,
        gap_m: f32,
        last: &LastCommand,
    ) -> EncoderReading {
        let count = self.joints.count_rad();
        // Half a count of each encoder; the second encoder affects θ2 alone.
        let rounding_m = 0.5 * (model.tip_m.x.abs() * count.x + model.jacobian.m22.abs() * count.y);
        // Steady innovation after the contact force has vanished.
        let release = -self.joints.lag_counts(&last.contact_acceleration_rad_s2);
        EncoderReading {
            gap_m,
            gap_error_m: self.contact.gap_uncertainty_m()
                + state.calibration.gap_error_m(rounding_m),
            moved: state.joints.has_moved(),
            release: release.dot(&self.joints.innovation_counts(&state.joints)),
            full_release: release.norm_squared(),
        }
    }

    /// Handles the loss of contact. If a little more friction than estimated explains the lift-off,
    /// it is taken as the cause.
    fn explain_throw(&self, state: &mut FrictionState, model: &Model) {
        let friction = state.estimate();
        let coupling = friction.slip.sign::<f32>() * model.q12_per_kg;
        let critical = model.q22_per_kg / coupling;
        if coupling > 0.0 && critical < friction.coefficient + THROWN_BY_FRICTION {
            self.friction.thrown(state, critical);
        }
    }

    /// With contact from the encoders, the belt is assumed at the lowest tip position so far: initially
    /// the start position, then every lower one.
    fn find_belt(&self, state: &mut EstimatesState, encoders: &mut EncoderReading) {
        let starts = self.calibrator.is_open(&state.calibration);
        if starts || encoders.is_below_belt() {
            let gap_m = encoders.gap_m;
            self.calibrator
                .restart(&mut state.calibration, &mut state.arm, gap_m);
        }
        if starts {
            encoders.gap_m = 0.0;
        }
    }
}
