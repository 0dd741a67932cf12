//! The paper's hybrid force/motion law (section III-B, eq. 7 to 9):
//!
//! ```text
//! u   = w + c + M J⁻¹ (−J̇ q̇ + i_x α_v) + Jᵀ (−i_x f_t − i_y α_f)
//! α_v = z̈_t* + K'_P (z_t* − z_t) + K'_D (ż_t* − ż_t)
//! α_f = f_n* + K'_I ∫ (f_n* − f_n) dt
//! ```
//!
//! The paper's f_t is continuous. Sampled, the friction of the last sample fed forward
//! makes a loop with gain −μ Q12/p per sample, which diverges where |μ Q12| > p.
//! A first-order low-pass on the measured f_t moves the pole to −Q22/(p τ): stable
//! wherever p > 0, and μ is needed nowhere. This is the default.

use nalgebra::Vector2;
use painleve_shared::dynamics::joint_torque_nm;
use painleve_shared::range::{self, OutOfRange};
use painleve_shared::{Real, Slip};
use serde::{Deserialize, Serialize};

use super::signals::{LawInput, LawOutput};

/// Where the friction f_t that the law compensates comes from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum FrictionFeedForward {
    /// The last reading of the force cell, as in the paper.
    Measured,
    /// The reading through a first-order low-pass.
    Filtered {
        /// Time constant τ, s.
        time_constant_s: f32,
    },
    /// Coulomb friction −μ sign(ż_r) α_f with a known belt.
    Model {
        /// Friction coefficient μ.
        friction: f32,
        /// Belt speed, m/s.
        belt_speed_m_s: f32,
    },
}

/// Settings of the hybrid law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HybridSettings {
    /// Wanted normal force f_n*, N.
    pub normal_force_n: f32,
    /// K'_P, 1/s².
    pub position_gain_per_s2: f32,
    /// K'_D, 1/s.
    pub velocity_gain_per_s: f32,
    /// K'_I, 1/s.
    pub force_integral_gain_per_s: f32,
    /// Largest correction by the force integral, N.
    pub force_integral_limit_n: f32,
    /// Friction feed-forward.
    pub friction: FrictionFeedForward,
}

impl Default for HybridSettings {
    /// Gains that survive a sample of delay at 1 kHz and 14-bit encoders.
    fn default() -> Self {
        Self {
            normal_force_n: 10.0,
            position_gain_per_s2: 400.0,
            velocity_gain_per_s: 40.0,
            force_integral_gain_per_s: 5.0,
            force_integral_limit_n: 5.0,
            friction: FrictionFeedForward::Filtered {
                time_constant_s: 0.03,
            },
        }
    }
}

impl HybridSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the first key that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let key = |key, value, maximum| range::check(key, value, 0.0, maximum);
        key(
            "controller.law.hybrid.normal_force_n",
            self.normal_force_n,
            1e3,
        )?;
        key(
            "controller.law.hybrid.position_gain_per_s2",
            self.position_gain_per_s2,
            1e6,
        )?;
        key(
            "controller.law.hybrid.velocity_gain_per_s",
            self.velocity_gain_per_s,
            1e4,
        )?;
        key(
            "controller.law.hybrid.force_integral_gain_per_s",
            self.force_integral_gain_per_s,
            1e4,
        )?;
        key(
            "controller.law.hybrid.force_integral_limit_n",
            self.force_integral_limit_n,
            1e3,
        )?;
        match self.friction {
            FrictionFeedForward::Measured => Ok(()),
            FrictionFeedForward::Filtered { time_constant_s } => key(
                "controller.law.hybrid.friction.filtered.time_constant_s",
                time_constant_s,
                10.0,
            ),
            FrictionFeedForward::Model {
                friction,
                belt_speed_m_s,
            } => {
                key(
                    "controller.law.hybrid.friction.model.friction",
                    friction,
                    10.0,
                )?;
                range::check(
                    "controller.law.hybrid.friction.model.belt_speed_m_s",
                    belt_speed_m_s,
                    -100.0,
                    100.0,
                )
            }
        }
    }
}

/// |sin(θ2 − θ1)| below which J⁻¹ is bounded: the arm is nearly straight and
/// no torque moves the tip along the belt any more.
const STRAIGHT_ARM_SINE: f32 = 0.02;

/// The hybrid law with its state.
#[derive(Clone, Copy, Debug)]
pub struct Hybrid {
    settings: HybridSettings,
    /// K'_I ∫ (f_n* − f_n) dt, N.
    force_integral_n: f32,
    /// Low-passed f_t, N.
    filtered_friction_n: f32,
}

impl Hybrid {
    /// A law that has not run yet.
    pub fn new(settings: HybridSettings) -> Self {
        Self {
            settings,
            force_integral_n: 0.0,
            filtered_friction_n: 0.0,
        }
    }

    /// Forgets the integral and starts the low-pass at the present friction.
    pub fn reset(&mut self, input: &LawInput<'_>) {
        *self = Self::new(self.settings);
        self.filtered_friction_n = input.force_n.x;
    }

    /// Torques for one tick.
    pub fn tick(&mut self, input: &LawInput<'_>) -> LawOutput {
        let settings = &self.settings;
        let arm = input.arm;
        let jacobian = arm.jacobian(&input.pose);
        let tip_velocity =
            jacobian.m11 * input.theta_dot_rad_s.x + jacobian.m12 * input.theta_dot_rad_s.y;
        let tip_position = arm.tip_m(&input.pose).x;

        let tangential_acceleration = input.reference.acceleration_m_s2
            + settings.position_gain_per_s2 * (input.reference.position_m - tip_position)
            + settings.velocity_gain_per_s * (input.reference.velocity_m_s - tip_velocity);

        // Anti-windup: no integration in the air, where there is no force to
        // control, nor while the torque is limited.
        if input.contact && !input.saturated {
            let step = settings.force_integral_gain_per_s
                * (settings.normal_force_n - input.force_n.y)
                * input.tick_s;
            let limit = settings.force_integral_limit_n;
            self.force_integral_n = (self.force_integral_n + step).limited(-limit, limit);
        }
        let normal_force = settings.normal_force_n + self.force_integral_n;

        let friction_force = match settings.friction {
            FrictionFeedForward::Measured => input.force_n.x,
            FrictionFeedForward::Filtered { time_constant_s } => {
                let weight = input.tick_s / (time_constant_s + input.tick_s);
                self.filtered_friction_n += weight * (input.force_n.x - self.filtered_friction_n);
                self.filtered_friction_n
            }
            FrictionFeedForward::Model {
                friction,
                belt_speed_m_s,
            } => {
                let slip = Slip::of(tip_velocity - belt_speed_m_s);
                -friction * slip.sign::<f32>() * normal_force
            }
        };

        let centripetal = arm.centripetal_m_s2(&input.pose, &input.theta_dot_rad_s);
        let tip_acceleration =
            Vector2::new(tangential_acceleration - centripetal.x, -centripetal.y);
        let length = arm.parameters().link_length_m;
        let sine_elbow = input.pose.sine_elbow();
        let bounded = if sine_elbow < 0.0 {
            sine_elbow.min(-STRAIGHT_ARM_SINE)
        } else {
            sine_elbow.max(STRAIGHT_ARM_SINE)
        };
        // J⁻¹ a, with det J = l² sin(θ2 − θ1).
        let scale = 1.0 / (length * length * bounded);
        let acceleration = Vector2::new(
            (jacobian.m22 * tip_acceleration.x - jacobian.m12 * tip_acceleration.y) * scale,
            (jacobian.m11 * tip_acceleration.y - jacobian.m21 * tip_acceleration.x) * scale,
        );

        let load = Vector2::new(-friction_force, -normal_force);
        let generalised =
            arm.passive_torque_nm(&input.theta_rad, &input.theta_dot_rad_s, &input.pose)
                + arm.centrifugal_torque_nm(&input.theta_dot_rad_s, &input.pose)
                + arm.mass_matrix(&input.pose) * acceleration
                + jacobian.transpose() * load;
        LawOutput {
            torque_nm: joint_torque_nm(&generalised),
            acceleration_rad_s2: acceleration,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::TipReference;
    use painleve_shared::dynamics::generalised_torque_nm;
    use painleve_shared::{Arm, ArmParameters, Pose, Posture};
    use proptest::prelude::*;

    proptest! {
        /// With the true friction fed forward, the law gives the tip exactly the
        /// acceleration α_v along the belt and the force f_n* on it.
        #[test]
        fn the_law_linearises_the_arm_on_the_belt(
            tip in -0.16_f32..0.16, speed in -0.5_f32..0.5, friction in 0.0_f32..0.3, up: bool,
        ) {
            let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let theta_rad = arm.joint_angles_on_belt_rad(tip, posture).unwrap();
            let theta_dot_rad_s = arm.joint_rates_on_belt_rad_s(tip, speed, posture);
            let pose = Pose::new(&theta_rad);
            let settings = HybridSettings {
                force_integral_gain_per_s: 0.0,
                friction: FrictionFeedForward::Model { friction, belt_speed_m_s: -1.0 },
                ..Default::default()
            };
            let reference = TipReference { position_m: tip + 0.001, velocity_m_s: speed, acceleration_m_s2: 0.7 };
            let output = Hybrid::new(settings).tick(&LawInput {
                arm: &arm, theta_rad, theta_dot_rad_s, pose, posture,
                force_n: Vector2::zeros(), contact: true, saturated: false,
                reference, tick_s: 1e-3,
            });
            let terms = arm.contact_terms(
                &theta_rad, &theta_dot_rad_s, &pose, &generalised_torque_nm(&output.torque_nm));
            let normal = terms.sliding_normal_force_n(friction, Slip::Positive);
            let force = Vector2::new(-friction * normal, normal);
            let acceleration = terms.free_acceleration_m_s2 + terms.q * force;
            prop_assert!((normal - 10.0).abs() < 0.02, "f_n = {}", normal);
            prop_assert!((acceleration.x - (0.7 + 400.0 * 0.001)).abs() < 0.05, "{}", acceleration);
        }
    }
}
