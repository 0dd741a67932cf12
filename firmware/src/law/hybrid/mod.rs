//! The paper's hybrid force/motion law (section III-B, eq. 7 to 9):
//!
//! ```text
//! u   = w + c + M J⁻¹ (−J̇ q̇ + i_x α_v) + Jᵀ (−i_x f_t − i_y α_f)
//! α_v = z̈_t* + K'_P (z_t* − z_t) + K'_D (ż_t* − ż_t)
//! α_f = f_n* + K'_I ∫ (f_n* − f_n) dt
//! ```
//!
//! In the paper f_t is continuous. In a sampled controller, feeding forward the friction of the last
//! sample closes a loop with gain −μ Q12/p per sample, which diverges where |μ Q12| > p. A
//! first-order low-pass on the measured f_t moves the pole to −Q22/(p τ): stable wherever p > 0,
//! without knowledge of μ. Near the edge, p → 0, even that pole is too fast for the sampling. By
//! default the law therefore feeds the estimated friction −μ̂ s α_f forward, which closes no loop,
//! and low-passes only the difference to the measured f_t, with a gain that falls with p (see
//! [`FrictionFeedForward::Observed`]). In stick it feeds the measured f_t itself forward.

mod allocation;

use nalgebra::Vector2;
use painleve_shared::{Real, Slip, settings};

use self::allocation::Allocation;
use super::{Law, LawInput, LawOutput};

/// Part of the friction observer's rate that a compliant contact takes away. With 0.7, more belts that hang on 10⁴ N/m
/// ring (lab book, *Torque*).
const CALMER_OBSERVER: f32 = 0.85;

/// Rate of change of the force above which the law damps a compliant contact, rad/s. With half of it the force ripples by a twelfth
/// more, with twice of it by as much less, and two of 200 runs were lost (lab book, *Factors on constants*).
const DAMPING_RAD_S: f32 = 1000.0;

/// Slowing of the rate at which the law learns the acceleration by other contact forces, for each unit of p, kg. Without it the
/// torque was noisier by a quarter, with three times of it more runs were lost (lab book, *Factors on constants*).
const SLOWER_KG: f32 = 1.0;

settings! {
    /// Source of the friction f_t that the hybrid law compensates.
    #[derive(Copy)]
    pub enum FrictionFeedForward {
        /// The last reading of the force cell, as in the paper.
        "measured" => Measured,
        /// The estimated friction −μ̂ s α_f, corrected by the low-passed reading: d̂ += k (f_t + μ̂
        /// s α_f − d̂) with k = min(T/(τ + T), ⅓ p̂/Q22). The pole of the loop through the contact, 1 − k
        /// Q22/p, then stays at ⅔ or above even close to the edge.
        "observed" => Observed {
            /// Time constant τ far from the edge.
            time_constant_s: f32, 0.0..=10.0, "s";
        },
        /// Coulomb friction −μ sign(ż_r) α_f of a known belt.
        "model" => Model {
            /// Friction coefficient μ.
            friction: f32, 0.0..=10.0;
            /// Belt speed.
            belt_speed_m_s: f32, -100.0..=100.0, "m/s";
        },
    }
}

settings! {
    /// Settings of the hybrid law. The default gains are stable with one sample of delay at 1 kHz
    /// and 14-bit encoders.
    #[derive(Copy)]
    pub struct HybridSettings {
        /// Desired normal force f_n*; nothing is learnt of friction and contact from readings at the end of the force
        /// cell's range.
        normal_force_n: f32 = 10.0, 0.0..=1e3, "N";
        /// Position gain K'_P.
        position_gain_per_s2: f32 = 5800.0, 0.0..=1e6, "1/s²";
        /// Velocity gain K'_D.
        velocity_gain_per_s: f32 = 128.0, 0.0..=1e4, "1/s";
        /// Gain of ∫ (z_t* − z_t) dt, added to α_v; not in the paper.
        position_integral_gain_per_s3: f32 = 10_000.0, 0.0..=1e9, "1/s³";
        /// Rate at which the law learns, and cancels, the tip's acceleration along the belt by contact forces that are not
        /// fed forward; 0 for never. Not in the paper.
        force_drift_rad_s: f32 = 1500.0, 0.0..=1e4, "rad/s";
        /// Rate at which the normal force rises to f_n*, as a fraction of it: after landing, and after a motion that left
        /// too little torque for it.
        pressing_rate_per_s: f32 = 20.0, 0.1..=1e6, "1/s";
        /// Least fraction of f_n* to which the normal force is reduced where the torque limits do not allow f_n*, and from
        /// which it rises; 1 for always f_n*, as in the paper.
        least_pressing: f32 = 0.1, 0.0..=1.0;
        /// Integral gain K'_I of the force; 0 for none. The paper's is 650 1/s elbow down and 0 elbow up. The integral
        /// corrects by f_n* at most.
        force_integral_gain_per_s: f32 = 0.0, 0.0..=1e4, "1/s";
        /// Damping of a compliant contact, as a fraction of the change of force.
        contact_damping: f32 = 4.0, 0.0..=10.0;
        /// Friction feed-forward.
        friction: FrictionFeedForward = FrictionFeedForward::Observed { time_constant_s: 0.015 };
    }
}

/// The hybrid law's state.
#[derive(Clone, Copy, Debug, Default)]
pub struct HybridState {
    /// K'_I ∫ (f_n* − f_n) dt, N.
    force_integral_n: f32,
    /// Gain times ∫ (z_t* − z_t) dt, m/s².
    position_integral_m_s2: f32,
    /// Low-passed difference of f_t to the estimated friction, N.
    filtered_friction_n: f32,
    /// Slip direction of the last friction feed-forward.
    slip: Option<Slip>,
    /// Present fraction of the desired contact force: at most that for which torque is available.
    pressing: f32,
    /// Whether the torque did not suffice for the motion.
    slows: bool,
    /// Low-passed normal force, N.
    slow_force_n: f32,
    /// Contact force (f_t, f_n) fed forward at the last tick, N.
    fed_force_n: Vector2<f32>,
    /// Low-passed acceleration along the belt by the rest of the contact force, m/s².
    force_drift_m_s2: f32,
}

impl Law for HybridSettings {
    type State = HybridState;

    fn at_speed(&self, factor: f32) -> Self {
        let square = factor * factor;
        Self {
            position_gain_per_s2: square * self.position_gain_per_s2,
            velocity_gain_per_s: factor * self.velocity_gain_per_s,
            position_integral_gain_per_s3: factor * square * self.position_integral_gain_per_s3,
            force_drift_rad_s: factor * self.force_drift_rad_s,
            ..*self
        }
    }

    /// Resets the integrals and starts from the present contact force, at most f_n*: an arm that fell on the
    /// belt may press with more than the torque can hold.
    fn reset(&self, state: &mut HybridState, input: &LawInput<'_>) {
        let force_n = input.contact.force_n.y.limited(0.0, self.normal_force_n);
        *state = HybridState {
            // Without a desired force there is no part of it.
            pressing: self.least_pressing.at_least(force_n / self.normal_force_n),
            slow_force_n: input.contact.force_n.y,
            fed_force_n: input.contact.force_n,
            ..HybridState::default()
        };
    }

    #[inline]
    fn tick(&self, state: &mut HybridState, input: &LawInput<'_>) -> LawOutput {
        let tangential_acceleration = self.commanded_acceleration_m_s2(state, input);
        let normal_force = self.commanded_force_n(state, input);
        let friction_force = self.compensated_friction_n(state, input, normal_force);
        let force_drift = self.force_drift_m_s2(state, input);
        let model = input.model;
        let along = Vector2::new(tangential_acceleration - force_drift, 0.0);
        let acceleration = model.link_acceleration_rad_s2(&along);
        let wanted = Vector2::new(friction_force, normal_force);
        let motion_nm = model.inverse_dynamics_in_air_nm(&acceleration);
        let pressing_nm = model.torque_against_nm(&wanted);
        let (limit_nm, least) = (input.torque_limit_nm, self.least_pressing);
        let given = Allocation::new(model, motion_nm, &pressing_nm, limit_nm, least);
        state.slows = given.slows;
        // A force that rose at once would make a contact with little damping ring: after landing, and where it
        // followed the torque that the motion leaves.
        let rise = self.pressing_rate_per_s * input.tick_s;
        let risen = (state.pressing + rise * given.pressing) / (1.0 + rise);
        state.pressing = given.pressing.at_most(risen);
        state.fed_force_n = wanted * state.pressing;
        LawOutput {
            torque_nm: given.motion_nm + pressing_nm * state.pressing,
            contact_force_n: state.fed_force_n,
        }
    }
}

impl HybridSettings {
    /// α_v, m/s².
    fn commanded_acceleration_m_s2(&self, state: &mut HybridState, input: &LawInput<'_>) -> f32 {
        let error = input.reference.position_m - input.model.tip_m.x;
        let error_rate = input.reference.velocity_m_s - input.model.tip_velocity_m_s.x;
        // Held in the air and while the torque is limited, it needs no limit of its own.
        if input.contact.touches && !input.saturated && !state.slows {
            state.position_integral_m_s2 +=
                self.position_integral_gain_per_s3 * error * input.tick_s;
        }
        input.reference.acceleration_m_s2
            + self.position_gain_per_s2 * error
            + self.velocity_gain_per_s * error_rate
            + state.position_integral_m_s2
    }

    /// Returns the acceleration of the tip along the belt by contact forces other than those fed forward,
    /// m/s².
    fn force_drift_m_s2(&self, state: &mut HybridState, input: &LawInput<'_>) -> f32 {
        // On a rigid contact the friction observer is fast enough to do this.
        if input.contact.response.lags <= 0.0 {
            state.force_drift_m_s2 = 0.0;
            return 0.0;
        }
        if input.contact.touches && !input.saturated {
            let rest_n = input.contact.force_n - state.fed_force_n;
            let model = input.model;
            let drift = model.q11_per_kg * rest_n.x + model.q12_per_kg * rest_n.y;
            // Far from the edge noise of the force moves the tip little, and where the arm is almost straight it costs
            // much torque.
            let rate = self.force_drift_rad_s * input.tick_s;
            let weight = rate / (1.0 + rate + SLOWER_KG * input.contact.p_per_kg.at_least(0.0));
            let drift = input.contact.response.lags * drift;
            state.force_drift_m_s2 += weight * (drift - state.force_drift_m_s2);
        }
        state.force_drift_m_s2
    }

    /// α_f, N.
    fn commanded_force_n(&self, state: &mut HybridState, input: &LawInput<'_>) -> f32 {
        let wanted_n = self.normal_force_n;
        // Anti-windup: no integration in the air, where there is no force to control, nor while the
        // torque is limited.
        if input.contact.touches && !input.saturated {
            let weight = (self.force_integral_gain_per_s * input.tick_s)
                .at_most(input.contact.response.loop_share);
            let step = weight * (state.pressing * wanted_n - input.contact.force_n.y);
            state.force_integral_n = (state.force_integral_n + step).within(wanted_n);
        }
        let (response, force_n) = (&input.contact.response, input.contact.force_n.y);
        if response.give > 0.0 {
            let rate = input.tick_s * DAMPING_RAD_S;
            state.slow_force_n += rate / (1.0 + rate) * (force_n - state.slow_force_n);
        } else {
            state.slow_force_n = force_n;
        }
        // Press less while the force rises: this damps a compliant contact.
        let damping_n = self.contact_damping * response.give * (force_n - state.slow_force_n);
        wanted_n + state.force_integral_n - damping_n + response.probe_n
    }

    /// Returns the f_t to feed forward, N, for α_f (N).
    fn compensated_friction_n(
        &self,
        state: &mut HybridState,
        input: &LawInput<'_>,
        normal_force_n: f32,
    ) -> f32 {
        match self.friction {
            FrictionFeedForward::Measured => input.contact.force_n.x,
            // A reading in stick closes no loop through p: fed forward, it follows the wanted motion to the edge of the cone,
            // where the tip breaks away without a jerk.
            FrictionFeedForward::Observed { .. } if input.contact.friction.sticks => {
                input.contact.force_n.x
            }
            FrictionFeedForward::Observed { time_constant_s } => {
                let friction = &input.contact.friction;
                let slip = friction.slip_seen.then_some(friction.slip);
                // A rigid contact would follow the excess at once.
                let lags = input.contact.response.lags > 0.0;
                let catch_up = if lags { friction.catch_up } else { 0.0 };
                let coefficient = (friction.coefficient + catch_up).at_least(0.0);
                let ratio = slip.map_or(0.0, |slip| -coefficient * slip.sign::<f32>());
                if slip != state.slip {
                    state.filtered_friction_n = 0.0;
                    state.slip = slip;
                }
                let expected = ratio * normal_force_n;
                // On a compliant contact, the difference is mostly noise of the force cell.
                let calm = 1.0 - CALMER_OBSERVER * input.contact.response.lags;
                let weight = (calm * input.tick_s / (time_constant_s + input.tick_s))
                    .at_most(input.contact.response.loop_share);
                let rest = input.contact.force_n.x - state.pressing * expected;
                state.filtered_friction_n += weight * (rest - state.filtered_friction_n);
                expected + state.filtered_friction_n
            }
            FrictionFeedForward::Model {
                friction,
                belt_speed_m_s,
            } => {
                let slip = Slip::of(input.model.tip_velocity_m_s.x - belt_speed_m_s);
                -friction * slip.sign::<f32>() * normal_force_n
            }
        }
    }
}

#[cfg(test)]
mod tests;
