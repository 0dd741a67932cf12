//! The paper's PID on the joint angles q' = (θ1, θ2 − θ1) (section III-A).
//!
//! u_i = K_P,i e_i + K_I,i ∫ e_i dt + K_D,i ė_i with e = q'* − q', where q'* puts
//! the tip on the belt at z_t* in the posture in which the drive was armed.

use nalgebra::Vector2;
use painleve_shared::{Real, settings};

use super::{Law, LawInput, LawOutput};

settings! {
    /// Gains of the PID, for joint 1 and joint 2: the paper's from x0,d.
    #[derive(Copy)]
    pub struct PidSettings {
        /// K_P of joint 1 and of joint 2.
        proportional_nm_rad: [f32; 2] = [200.0, 0.0], 0.0..=1e5, "N·m/rad";
        /// K_I of joint 1 and of joint 2.
        integral_nm_rad_s: [f32; 2] = [25.0, 0.0], 0.0..=1e5, "N·m/(rad·s)";
        /// K_D of joint 1 and of joint 2.
        derivative_nms_rad: [f32; 2] = [2.0, 0.0], 0.0..=1e5, "N·m·s/rad";
        /// Largest torque of the integral action.
        integral_limit_nm: f32 = 5.0, 0.0..=1e3, "N·m";
    }
}

/// The PID's integrals.
#[derive(Clone, Copy, Debug, Default)]
pub struct PidState {
    /// Torque of the integral action, N·m.
    integral_nm: Vector2<f32>,
    /// Joint angles of the last reference within reach, rad.
    wanted_rad: Option<Vector2<f32>>,
}

impl Law for PidSettings {
    type State = PidState;

    fn tick(&self, state: &mut PidState, input: &LawInput<'_>) -> LawOutput {
        let theta_wanted = input
            .arm
            .joint_angles_on_belt_rad(input.reference.position_m, input.posture)
            .or(state.wanted_rad)
            .unwrap_or(input.model.theta_rad);
        state.wanted_rad = Some(theta_wanted);
        let rate_wanted = input.arm.joint_rates_on_belt_rad_s(
            input.reference.position_m,
            input.reference.velocity_m_s,
            input.posture,
        );
        let error = elbow_relative(&(theta_wanted - input.model.theta_rad));
        let error_rate = elbow_relative(&(rate_wanted - input.model.theta_dot_rad_s));
        let [kp_1, kp_2] = self.proportional_nm_rad;
        let [ki_1, ki_2] = self.integral_nm_rad_s;
        let [kd_1, kd_2] = self.derivative_nms_rad;
        // Anti-windup: the integrals stand still while the torque is limited,
        // and never exceed their own limit.
        if !input.saturated {
            let limit = self.integral_limit_nm;
            let step = Vector2::new(ki_1 * error.x, ki_2 * error.y) * input.tick_s;
            state.integral_nm = (state.integral_nm + step).map(|torque| torque.within(limit));
        }
        LawOutput {
            torque_nm: Vector2::new(
                kp_1 * error.x + state.integral_nm.x + kd_1 * error_rate.x,
                kp_2 * error.y + state.integral_nm.y + kd_2 * error_rate.y,
            ),
            contact_force_n: input.force_n,
        }
    }
}

/// (θ1, θ2) to q' = (θ1, θ2 − θ1).
fn elbow_relative(theta: &Vector2<f32>) -> Vector2<f32> {
    Vector2::new(theta.x, theta.y - theta.x)
}
