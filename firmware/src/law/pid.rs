//! The paper's PID on the joint angles q' = (θ1, θ2 − θ1) (section III-A).
//!
//! u_i = K_P,i e_i + K_I,i ∫ e_i dt + K_D,i ė_i with e = q'* − q', where q'* puts
//! the tip on the belt at z_t* in the posture in which the drive was armed or the tip landed.

use painleve_shared::{JointTorque, LinkMotion, Real, settings};

use super::{Law, LawInput, LawOutput};

settings! {
    /// Gains of the PID for joint 1 and joint 2. The defaults are the paper's gains for a start at
    /// x0,d.
    #[derive(Copy)]
    pub struct PidSettings {
        /// K_P of joint 1 and of joint 2.
        proportional_nm_rad: [f32; 2] = [200.0, 0.0], 0.0..=1e5, "N·m/rad";
        /// K_I of joint 1 and of joint 2.
        integral_nm_rad_s: [f32; 2] = [25.0, 0.0], 0.0..=1e5, "N·m/(rad·s)";
        /// K_D of joint 1 and of joint 2.
        derivative_nms_rad: [f32; 2] = [2.0, 0.0], 0.0..=1e5, "N·m·s/rad";
    }
}

/// The PID's integrals.
#[derive(Clone, Copy, Debug, Default)]
pub struct PidState {
    /// Torque of the integral action, N·m.
    integral_nm: JointTorque<f32>,
    /// Link angles of the last reference within reach, rad.
    wanted_rad: Option<LinkMotion<f32>>,
}

impl Law for PidSettings {
    type State = PidState;

    fn tick(&self, state: &mut PidState, input: &LawInput<'_>) -> LawOutput {
        let theta_wanted = input
            .arm
            .link_angles_on_belt_rad(input.reference.position_m, input.posture)
            .or(state.wanted_rad)
            .unwrap_or(input.model.theta_rad);
        state.wanted_rad = Some(theta_wanted);
        let rate_wanted = input.arm.link_rates_on_belt_rad_s(
            input.reference.position_m,
            input.reference.velocity_m_s,
            input.posture,
        );
        let error = (theta_wanted - input.model.theta_rad).to_joints();
        let error_rate = (rate_wanted - input.model.theta_dot_rad_s).to_joints();
        // Anti-windup: the integrals stop while the torque is limited, and never exceed its limit.
        if !input.saturated {
            let limit = input.torque_limit_nm;
            let step = error.torque_by(self.integral_nm_rad_s) * input.tick_s;
            state.integral_nm = (state.integral_nm + step).map(|torque| torque.within(limit));
        }
        LawOutput {
            torque_nm: error.torque_by(self.proportional_nm_rad)
                + state.integral_nm
                + error_rate.torque_by(self.derivative_nms_rad),
            contact_force_n: input.contact.force_n,
        }
    }
}
