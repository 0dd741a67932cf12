//! The control laws' common ground: what they are given and what they answer.

use nalgebra::Vector2;
use painleve_shared::{Arm, JointTorque, Posture};

use crate::estimate::friction::FrictionEstimate;
use crate::estimate::model::Model;
use crate::refer::reference::TipReference;

/// What a law knows at one tick.
#[derive(Clone, Copy, Debug)]
pub struct LawInput<'a> {
    /// The arm's model.
    pub arm: &'a Arm<f32>,
    /// The same at the estimated state.
    pub model: &'a Model,
    /// Posture in which the drive was armed.
    pub posture: Posture,
    /// Measured contact force (f_t, f_n), N.
    pub force_n: Vector2<f32>,
    /// What is known about friction.
    pub friction: FrictionEstimate,
    /// p with it, 1/kg.
    pub p_per_kg: f32,
    /// Whether the tip touches the belt.
    pub contact: bool,
    /// Whether the torque of the tick before was limited.
    pub saturated: bool,
    /// Where the tip shall be.
    pub reference: TipReference,
    /// Largest torque on either joint, N·m.
    pub torque_limit_nm: f32,
    /// Time between two ticks, s.
    pub tick_s: f32,
}

/// A law's answer; the default is no torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LawOutput {
    /// Wanted joint torques, N·m, before limits.
    pub torque_nm: JointTorque<f32>,
    /// Contact force (f_t, f_n) that the law expects with them, N.
    pub contact_force_n: Vector2<f32>,
}
