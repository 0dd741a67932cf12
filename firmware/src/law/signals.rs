//! Inputs and outputs common to all control laws.

use nalgebra::Vector2;
use painleve_shared::{Arm, JointTorque, Posture};

use crate::estimate::ContactEstimate;
use crate::estimate::model::Model;
use crate::refer::reference::TipReference;

/// Inputs of a law at one tick.
#[derive(Clone, Copy, Debug)]
pub struct LawInput<'a> {
    /// The arm's model.
    pub arm: &'a Arm<f32>,
    /// The model's terms at the estimated state.
    pub model: &'a Model,
    /// Posture in which the drive was armed or the tip landed.
    pub posture: Posture,
    /// The contact's estimate.
    pub contact: &'a ContactEstimate,
    /// Whether the torque of the previous tick was limited.
    pub saturated: bool,
    /// Reference of the tip.
    pub reference: TipReference,
    /// Largest torque on either joint, N·m.
    pub torque_limit_nm: f32,
    /// Control period, s.
    pub tick_s: f32,
}

/// A law's answer; the default is no torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LawOutput {
    /// Desired joint torques, N·m, before limits.
    pub torque_nm: JointTorque<f32>,
    /// Contact force (f_t, f_n) that the law expects with these torques, N.
    pub contact_force_n: Vector2<f32>,
}
