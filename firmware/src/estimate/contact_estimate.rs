//! What is known of the contact between tip and belt at a tick.

use nalgebra::Vector2;

use super::friction::FrictionEstimate;
use super::response::ContactResponse;

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
