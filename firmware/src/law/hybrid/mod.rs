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
//! [`FrictionFeedForward::Observed`]).

mod settings;

use nalgebra::Vector2;
use painleve_shared::{JointTorque, Real, Slip};

pub use self::settings::{FrictionFeedForward, HybridSettings};
use super::{Law, LawInput, LawOutput};

/// Largest share of the loop through the contact per sample: its pole is 1 − ½ p̂/p.
const OBSERVER_SHARE: f32 = 0.5;
/// The same for the integral of the force.
const FORCE_INTEGRAL_SHARE: f32 = 0.165;
/// Part of the friction observer's rate that a contact that gives takes away.
const CALMER_OBSERVER: f32 = 0.7;

/// Slowing of the rate at which the law learns the acceleration by other contact forces, for each unit of p, kg.
const SLOWER_KG: f32 = 1.0;

/// Rate limit of the friction feed-forward, as a fraction of f_n, 1/s: at a reversal of slip it
/// passes through stick without a jerk.
const FRICTION_SLEW_PER_S: f32 = 1000.0;

/// Fraction of the torque limit available for pressing the tip on the belt; the rest is for motion.
const TORQUE_USED: f32 = 0.95;
/// Least desired force by which the present one is divided, N.
const LEAST_FORCE_N: f32 = 1e-3;
/// Least fraction of the wanted contact force.
const LEAST_PRESSING: f32 = 0.1;

/// Returns the fraction of `pressing_nm` that keeps both joints within ±`limit_nm` together with
/// `motion_nm`.
#[inline]
fn affordable(motion_nm: &JointTorque<f32>, pressing_nm: &JointTorque<f32>, limit_nm: f32) -> f32 {
    if (*motion_nm + *pressing_nm).amax() <= limit_nm {
        1.0
    } else {
        affordable_part(motion_nm, pressing_nm, limit_nm)
    }
}

/// Kept out of line because it is rarely needed: when inlined, the compiler computes the divisions
/// every time instead of branching.
#[cold]
#[inline(never)]
fn affordable_part(
    motion_nm: &JointTorque<f32>,
    pressing_nm: &JointTorque<f32>,
    limit_nm: f32,
) -> f32 {
    let of_joint = |motion: f32, pressing: f32| {
        if (motion + pressing).abs() <= limit_nm {
            1.0
        } else {
            // Not finite without a pressing torque; the motion alone is then beyond the limit.
            (limit_nm.copysign(pressing) - motion) / pressing
        }
    };
    of_joint(motion_nm.first(), pressing_nm.first())
        .at_most(of_joint(motion_nm.second(), pressing_nm.second()))
        .limited(LEAST_PRESSING, 1.0)
}

/// Wanted acceleration above which the law makes a sticking tip break away, m/s².
const BREAKING_AWAY_M_S2: f32 = 1.0;

/// The hybrid law's state.
#[derive(Clone, Copy, Debug)]
pub struct HybridState {
    /// K'_I ∫ (f_n* − f_n) dt, N.
    force_integral_n: f32,
    /// Gain times ∫ (z_t* − z_t) dt, m/s².
    position_integral_m_s2: f32,
    /// Low-passed f_t, or its difference to the estimated friction, N.
    filtered_friction_n: f32,
    /// Slip direction of the last friction feed-forward.
    slip: Option<Slip>,
    /// Last friction feed-forward as a ratio f_t/f_n.
    fed_ratio: f32,
    /// Present fraction of the wanted contact force: at most that for which torque is available.
    pressing: f32,
    /// Low-passed normal force, N.
    slow_force_n: f32,
    /// Contact force (f_t, f_n) fed forward at the last tick, N.
    fed_force_n: Vector2<f32>,
    /// Low-passed acceleration along the belt by the rest of the contact force, m/s².
    force_drift_m_s2: f32,
}

impl Default for HybridState {
    fn default() -> Self {
        Self {
            force_integral_n: 0.0,
            position_integral_m_s2: 0.0,
            filtered_friction_n: 0.0,
            slip: None,
            fed_ratio: 0.0,
            pressing: 1.0,
            slow_force_n: 0.0,
            fed_force_n: Vector2::zeros(),
            force_drift_m_s2: 0.0,
        }
    }
}

impl Law for HybridSettings {
    type State = HybridState;

    fn sped_up(&self, factor: f32) -> Self {
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
        let force_n = input.force_n.y.limited(0.0, self.normal_force_n);
        // Limit to the friction cone: a saturated force cell gives any ratio.
        let cone_n = input.friction.coefficient * force_n;
        *state = HybridState {
            pressing: (force_n / self.normal_force_n.at_least(LEAST_FORCE_N))
                .at_least(LEAST_PRESSING),
            filtered_friction_n: input.force_n.x.within(cone_n),
            slow_force_n: input.force_n.y,
            fed_force_n: input.force_n,
            ..HybridState::default()
        };
    }

    #[inline]
    fn tick(&self, state: &mut HybridState, input: &LawInput<'_>) -> LawOutput {
        let tangential_acceleration = self.commanded_acceleration_m_s2(state, input);
        let normal_force = self.commanded_force_n(state, input);
        let friction_force =
            self.compensated_friction_n(state, input, normal_force, tangential_acceleration);
        let force_drift = self.force_drift_m_s2(state, input);
        let acceleration = input
            .model
            .link_acceleration_rad_s2(&Vector2::new(tangential_acceleration - force_drift, 0.0));
        let wanted = Vector2::new(friction_force, normal_force);
        let motion_nm = input.model.inverse_dynamics_in_air_nm(&acceleration);
        let pressing_nm = input.model.torque_against_nm(&wanted);
        let share = if self.reduce_force_when_torque_limited {
            affordable(
                &motion_nm,
                &pressing_nm,
                TORQUE_USED * input.torque_limit_nm,
            )
        } else {
            1.0
        };
        // A force that rose at once would make a contact with little damping ring: after landing, and where it
        // followed the torque that the motion leaves.
        let rise = self.pressing_rate_per_s * input.tick_s;
        let approach = rise / (1.0 + rise);
        state.pressing = share.at_most(state.pressing + approach * (share - state.pressing));
        state.fed_force_n = wanted * state.pressing;
        LawOutput {
            torque_nm: motion_nm + pressing_nm * state.pressing,
            contact_force_n: state.fed_force_n,
        }
    }
}

impl HybridSettings {
    /// α_v, m/s².
    fn commanded_acceleration_m_s2(&self, state: &mut HybridState, input: &LawInput<'_>) -> f32 {
        let error = input.reference.position_m - input.model.tip_m.x;
        let error_rate = input.reference.velocity_m_s - input.model.tip_velocity_m_s.x;
        if input.contact && !input.saturated {
            let limit = self.position_integral_limit_m_s2;
            let step = self.position_integral_gain_per_s3 * error * input.tick_s;
            state.position_integral_m_s2 = (state.position_integral_m_s2 + step).within(limit);
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
        if input.response.lags <= 0.0 {
            state.force_drift_m_s2 = 0.0;
            return 0.0;
        }
        if input.contact && !input.saturated {
            let rest_n = input.force_n - state.fed_force_n;
            let model = input.model;
            let drift = model.q11_per_kg * rest_n.x + model.q12_per_kg * rest_n.y;
            // Far from the edge noise of the force moves the tip little, and where the arm is almost straight it costs
            // much torque.
            let rate = self.force_drift_rad_s * input.tick_s;
            let weight = rate / (1.0 + rate + SLOWER_KG * input.p_per_kg.at_least(0.0));
            let drift = input.response.lags * drift;
            state.force_drift_m_s2 += weight * (drift - state.force_drift_m_s2);
        }
        state
            .force_drift_m_s2
            .within(self.position_integral_limit_m_s2)
    }

    /// α_f, N.
    fn commanded_force_n(&self, state: &mut HybridState, input: &LawInput<'_>) -> f32 {
        let wanted_n = self.normal_force_n;
        // Anti-windup: no integration in the air, where there is no force to control, nor while the
        // torque is limited.
        if input.contact && !input.saturated {
            let weight = (self.force_integral_gain_per_s * input.tick_s)
                .at_most(FORCE_INTEGRAL_SHARE * input.response.loop_share);
            let step = weight * (state.pressing * wanted_n - input.force_n.y);
            let limit = self.force_integral_limit_n;
            state.force_integral_n = (state.force_integral_n + step).within(limit);
        }
        let response = input.response;
        let damping_n = if response.give > 0.0 {
            // Press less while the force rises: this damps a contact that gives.
            let rate = input.tick_s * self.contact_damping_rad_s;
            state.slow_force_n += rate / (1.0 + rate) * (input.force_n.y - state.slow_force_n);
            self.contact_damping * response.give * (input.force_n.y - state.slow_force_n)
        } else {
            state.slow_force_n = input.force_n.y;
            0.0
        };
        wanted_n + state.force_integral_n - damping_n + response.probe_n
    }

    /// Returns the f_t to feed forward, N, for α_f (N) and α_v (m/s²).
    fn compensated_friction_n(
        &self,
        state: &mut HybridState,
        input: &LawInput<'_>,
        normal_force_n: f32,
        tangential_acceleration_m_s2: f32,
    ) -> f32 {
        match self.friction {
            FrictionFeedForward::Measured => input.force_n.x,
            FrictionFeedForward::Filtered { time_constant_s } => {
                let weight = input.tick_s / (time_constant_s + input.tick_s);
                state.filtered_friction_n += weight * (input.force_n.x - state.filtered_friction_n);
                state.filtered_friction_n
            }
            FrictionFeedForward::Observed { time_constant_s } => {
                let friction = input.friction;
                // In stick the friction force follows the feed-forward. Feeding forward the friction
                // of the wanted slip brings it to the edge of its cone, where the tip breaks away
                // without a jerk.
                let wants_slip = tangential_acceleration_m_s2.abs() > BREAKING_AWAY_M_S2;
                let slip = if friction.sticks && wants_slip {
                    Slip::of(tangential_acceleration_m_s2)
                } else {
                    friction.slip
                };
                let slip = friction.slip_seen.then_some(slip);
                // A rigid contact would follow the excess at once.
                let lags = input.response.lags > 0.0;
                let catch_up = if lags { friction.catch_up } else { 0.0 };
                let coefficient = (friction.next_coefficient + catch_up).at_least(0.0);
                let ratio = slip.map_or(0.0, |slip| -coefficient * slip.sign::<f32>());
                if slip != state.slip {
                    state.filtered_friction_n = 0.0;
                    if state.slip.is_none() {
                        state.fed_ratio = ratio;
                    }
                    state.slip = slip;
                }
                let step = FRICTION_SLEW_PER_S * input.tick_s;
                state.fed_ratio += (ratio - state.fed_ratio).within(step);
                let expected = state.fed_ratio * normal_force_n;
                // Where the contact gives, the difference is mostly noise of the force cell.
                let calm = 1.0 - CALMER_OBSERVER * input.response.lags;
                let weight = (calm * input.tick_s / (time_constant_s + input.tick_s))
                    .at_most(OBSERVER_SHARE * input.response.loop_share);
                let rest = input.force_n.x - state.pressing * expected;
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
mod tests {
    use super::*;
    use crate::estimate::friction::FrictionEstimate;
    use crate::estimate::model::Model;
    use crate::estimate::response::ContactResponse;
    use crate::refer::reference::TipReference;
    use painleve_shared::{Arm, ArmParameters, GeneralisedTorque, Pose, Posture};
    use proptest::prelude::*;

    proptest! {
        /// With the true friction fed forward, the law gives the tip exactly the acceleration α_v
        /// along the belt and the force f_n* on it.
        #[test]
        fn the_law_linearises_the_arm_on_the_belt(
            tip in -0.16_f32..0.16, speed in -0.5_f32..0.5, friction in 0.0_f32..0.3, up: bool,
        ) {
            let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
            let posture = if up { Posture::ElbowUp } else { Posture::ElbowDown };
            let theta_rad = arm.link_angles_on_belt_rad(tip, posture).unwrap();
            let theta_dot_rad_s = arm.link_rates_on_belt_rad_s(tip, speed, posture);
            let pose = Pose::new(&theta_rad);
            let model = Model::new(&arm, theta_rad, theta_dot_rad_s, &GeneralisedTorque::zeros());
            let settings = HybridSettings {
                force_integral_gain_per_s: 0.0,
                pressing_rate_per_s: 1e6,
                position_integral_gain_per_s3: 0.0,
                friction: FrictionFeedForward::Model { friction, belt_speed_m_s: -1.0 },
                ..Default::default()
            };
            let reference = TipReference { position_m: tip + 0.001, velocity_m_s: speed, acceleration_m_s2: 0.7 };
            let input = LawInput {
                arm: &arm, model: &model, posture,
                friction: &FrictionEstimate {
                    coefficient: friction, next_coefficient: friction, catch_up: 0.0, deviation: 0.0, slip: Slip::Positive, slip_seen: true, sticks: false,
                },
                p_per_kg: model.p_per_kg(friction, Slip::Positive), response: &ContactResponse::rigid(1.0),
                force_n: Vector2::zeros(), contact: true, saturated: false,
                reference, torque_limit_nm: 50.0, tick_s: 1e-3,
            };
            let mut state = HybridState::default();
            settings.reset(&mut state, &input);
            let output = settings.tick(&mut state, &input);
            let terms = arm.contact_terms(
                &theta_rad, &theta_dot_rad_s, &pose, &output.torque_nm.to_links());
            let normal = terms.sliding_normal_force_n(friction, Slip::Positive);
            let force = Vector2::new(-friction * normal, normal);
            let acceleration = terms.free_acceleration_m_s2 + terms.q * force;
            prop_assert!((normal - 10.0).abs() < 0.02, "f_n = {}", normal);
            prop_assert!((acceleration.x - (0.7 + settings.position_gain_per_s2 * 0.001)).abs() < 0.05, "{}", acceleration);
        }
    }

    #[test]
    fn a_law_twice_as_fast_has_poles_twice_as_far_out() {
        let law = HybridSettings::default();
        let faster = law.sped_up(2.0);
        // x³ + K'_D x² + K'_P x + K_I at −s, and at −2 s.
        let polynomial = |law: &HybridSettings, rate: f32| {
            ((law.velocity_gain_per_s - rate) * rate - law.position_gain_per_s2) * rate
                + law.position_integral_gain_per_s3
        };
        for rate in [8.0, 20.0, 55.0] {
            assert_eq!(
                polynomial(&faster, 2.0 * rate),
                8.0 * polynomial(&law, rate)
            );
        }
        assert_eq!(law.sped_up(1.0), law);
    }

    const FRICTION: f32 = 0.6;

    fn at_rest(arm: &Arm<f32>) -> Model {
        let theta_rad = arm
            .link_angles_on_belt_rad(0.1, Posture::ElbowDown)
            .unwrap();
        Model::new(
            arm,
            theta_rad,
            painleve_shared::LinkMotion::zeros(),
            &GeneralisedTorque::zeros(),
        )
    }

    const SLIDES: FrictionEstimate = FrictionEstimate {
        coefficient: FRICTION,
        next_coefficient: FRICTION,
        catch_up: 0.0,
        deviation: 0.0,
        slip: Slip::Positive,
        slip_seen: true,
        sticks: false,
    };

    fn gives() -> ContactResponse {
        ContactResponse {
            lags: 1.0,
            ..ContactResponse::rigid(1.0)
        }
    }

    /// Returns the input of a tip that slides at its reference on a contact that gives.
    fn sliding<'a>(
        arm: &'a Arm<f32>,
        model: &'a Model,
        response: &'a ContactResponse,
    ) -> LawInput<'a> {
        LawInput {
            arm,
            model,
            posture: Posture::ElbowDown,
            friction: &SLIDES,
            p_per_kg: model.p_per_kg(FRICTION, Slip::Positive),
            response,
            force_n: Vector2::new(-FRICTION * 10.0, 10.0),
            contact: true,
            saturated: false,
            reference: TipReference::at_rest(model.tip_m.x),
            torque_limit_nm: 50.0,
            tick_s: 1e-3,
        }
    }

    /// Runs `test` with the default settings, the input of a tip that slides on a contact that gives, and a new state.
    fn while_sliding(test: impl FnOnce(&HybridSettings, &mut LawInput<'_>, &mut HybridState)) {
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let model = at_rest(&arm);
        test(
            &HybridSettings::default(),
            &mut sliding(&arm, &model, &gives()),
            &mut HybridState::default(),
        );
    }

    #[test]
    fn a_contact_force_that_was_not_fed_forward_is_cancelled_along_the_belt() {
        while_sliding(|settings, input, state| {
            settings.reset(state, input);
            let rest_n = Vector2::new(-0.3, 0.5);
            let model = input.model;
            let expected = model.q11_per_kg * rest_n.x + model.q12_per_kg * rest_n.y;
            for _ in 0..200 {
                input.force_n = state.fed_force_n + rest_n;
                settings.force_drift_m_s2(state, input);
            }
            let learnt = settings.force_drift_m_s2(state, input);
            assert!(
                (learnt - expected).abs() < 1e-3 * expected.abs(),
                "{learnt} {expected}"
            );
            // Nothing is learnt from a torque that was limited.
            input.saturated = true;
            input.force_n = Vector2::zeros();
            assert_eq!(settings.force_drift_m_s2(state, input), learnt);
        });
    }

    #[test]
    fn a_reduced_force_is_no_error_of_the_friction() {
        while_sliding(|settings, input, state| {
            settings.reset(state, input);
            state.filtered_friction_n = 0.0;
            input.torque_limit_nm = 1.0;
            for _ in 0..100 {
                settings.tick(state, input);
                // The contact follows the reduced force exactly.
                let normal_n = state.fed_force_n.y;
                input.force_n = Vector2::new(-FRICTION * normal_n, normal_n);
            }
            assert!(state.pressing < 0.9, "{state:?}");
            let fed = -state.fed_force_n.x / state.fed_force_n.y;
            assert!((fed - FRICTION).abs() < 1e-4, "{state:?}");
            assert!(state.force_drift_m_s2.abs() < 1e-2, "{state:?}");
        });
    }

    #[test]
    fn the_force_falls_at_once_but_rises_slowly() {
        while_sliding(|settings, input, state| {
            settings.reset(state, input);
            settings.tick(state, input);
            assert_eq!(state.pressing, 1.0);
            input.torque_limit_nm = 1.0;
            settings.tick(state, input);
            let reduced = state.pressing;
            assert!(reduced < 0.9, "{reduced}");
            input.torque_limit_nm = 50.0;
            for _ in 0..10 {
                settings.tick(state, input);
            }
            let share = (state.pressing - reduced) / (1.0 - reduced);
            let expected = 1.0 - (1.0 + settings.pressing_rate_per_s * input.tick_s).powi(-10);
            assert!((share - expected).abs() < 1e-3, "{share} {expected}");
        });
    }

    #[test]
    fn the_force_begins_with_the_present_one_but_with_no_more_than_desired() {
        while_sliding(|settings, input, state| {
            for (force_n, share) in [(20.0, 1.0), (4.0, 0.4), (-0.2, LEAST_PRESSING)] {
                input.force_n.y = force_n;
                settings.reset(state, input);
                assert_eq!(state.pressing, share);
            }
        });
    }
}
