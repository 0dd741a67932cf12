//! Tests of the hybrid law against the equations of motion, and of its force.

use super::*;
use crate::estimate::ContactEstimate;
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
            least_pressing: 1.0,
            position_integral_gain_per_s3: 0.0,
            friction: FrictionFeedForward::Model { friction, belt_speed_m_s: -1.0 },
            ..Default::default()
        };
        let reference = TipReference { position_m: tip + 0.001, velocity_m_s: speed, acceleration_m_s2: 0.7 };
        let input = LawInput {
            arm: &arm, model: &model, posture, contact: &sliding(friction, &model), saturated: false,
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
    let faster = law.at_speed(2.0);
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
    assert_eq!(law.at_speed(1.0), law);
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

/// Returns the contact of a tip that slides without pressing on a rigid belt, with known friction.
fn sliding(coefficient: f32, model: &Model) -> ContactEstimate {
    let friction = FrictionEstimate {
        coefficient,
        catch_up: 0.0,
        variance: 0.0,
        slip: Slip::Positive,
        slip_seen: true,
        sticks: false,
    };
    ContactEstimate {
        touches: true,
        friction,
        p_per_kg: model.p_per_kg(&friction),
        response: ContactResponse::rigid(1.0),
        ..Default::default()
    }
}

/// The law, and a tip that slides at its reference on a compliant contact.
struct Sliding {
    law: HybridSettings,
    state: HybridState,
    arm: Arm<f32>,
    model: Model,
    contact: ContactEstimate,
    saturated: bool,
    torque_limit_nm: f32,
    /// Distance from the tip to its reference, m.
    ahead_m: f32,
}

impl Sliding {
    /// Returns a tip that presses as desired, with the law reset there.
    fn new() -> Self {
        let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
        let model = at_rest(&arm);
        let mut contact = sliding(FRICTION, &model);
        contact.force_n = Vector2::new(-FRICTION * 10.0, 10.0);
        contact.response.lags = 1.0;
        let mut sliding = Self {
            law: HybridSettings::default(),
            state: HybridState::default(),
            arm,
            model,
            contact,
            saturated: false,
            torque_limit_nm: 50.0,
            ahead_m: 0.0,
        };
        sliding.with(HybridSettings::reset);
        sliding
    }

    /// Calls a method of the law.
    fn with<R>(
        &mut self,
        method: impl FnOnce(&HybridSettings, &mut HybridState, &LawInput<'_>) -> R,
    ) -> R {
        let input = LawInput {
            arm: &self.arm,
            model: &self.model,
            posture: Posture::ElbowDown,
            contact: &self.contact,
            saturated: self.saturated,
            reference: TipReference::at_rest(self.model.tip_m.x + self.ahead_m),
            torque_limit_nm: self.torque_limit_nm,
            tick_s: 1e-3,
        };
        method(&self.law, &mut self.state, &input)
    }

    fn tick(&mut self) {
        self.with(HybridSettings::tick);
    }
}

#[test]
fn the_friction_of_a_tip_that_sticks_is_fed_forward_as_it_is_whatever_motion_is_wanted() {
    for ahead_m in [-0.002, 0.0, 0.002] {
        let mut tip = Sliding::new();
        tip.ahead_m = ahead_m;
        tip.tick();
        tip.contact.friction.sticks = true;
        for friction_n in [4.0, -5.0] {
            tip.contact.force_n.x = friction_n;
            tip.tick();
            assert_eq!(tip.state.fed_force_n.x, friction_n);
        }
        // Once it slides, the edge of the cone is.
        tip.contact.friction.sticks = false;
        tip.contact.force_n = tip.state.fed_force_n;
        tip.contact.force_n.x = -FRICTION * tip.contact.force_n.y;
        tip.tick();
        let [along_n, off_n] = tip.state.fed_force_n.into();
        assert!(
            (along_n + FRICTION * off_n).abs() < 1e-3,
            "{along_n} {off_n}"
        );
    }
}

#[test]
fn a_contact_force_that_was_not_fed_forward_is_cancelled_along_the_belt() {
    let mut tip = Sliding::new();
    let rest_n = Vector2::new(-0.3, 0.5);
    let expected = tip.model.q11_per_kg * rest_n.x + tip.model.q12_per_kg * rest_n.y;
    for _ in 0..200 {
        tip.contact.force_n = tip.state.fed_force_n + rest_n;
        tip.with(HybridSettings::force_drift_m_s2);
    }
    let learnt = tip.with(HybridSettings::force_drift_m_s2);
    assert!(
        (learnt - expected).abs() < 1e-3 * expected.abs(),
        "{learnt} {expected}"
    );
    // Nothing is learnt from a torque that was limited.
    tip.saturated = true;
    tip.contact.force_n = Vector2::zeros();
    assert_eq!(tip.with(HybridSettings::force_drift_m_s2), learnt);
}

#[test]
fn a_reduced_force_is_no_error_of_the_friction() {
    let mut tip = Sliding::new();
    tip.state.filtered_friction_n = 0.0;
    tip.torque_limit_nm = 1.0;
    for _ in 0..100 {
        tip.tick();
        // The contact follows the reduced force exactly.
        let normal_n = tip.state.fed_force_n.y;
        tip.contact.force_n = Vector2::new(-FRICTION * normal_n, normal_n);
    }
    let state = &tip.state;
    assert!(state.pressing < 0.9, "{state:?}");
    let fed = -state.fed_force_n.x / state.fed_force_n.y;
    assert!((fed - FRICTION).abs() < 1e-4, "{state:?}");
    assert!(state.force_drift_m_s2.abs() < 1e-2, "{state:?}");
}

#[test]
fn the_force_falls_at_once_but_rises_slowly() {
    let mut tip = Sliding::new();
    tip.tick();
    assert_eq!(tip.state.pressing, 1.0);
    tip.torque_limit_nm = 1.0;
    tip.tick();
    let reduced = tip.state.pressing;
    assert!(reduced < 0.9, "{reduced}");
    tip.torque_limit_nm = 50.0;
    for _ in 0..10 {
        tip.tick();
    }
    let share = (tip.state.pressing - reduced) / (1.0 - reduced);
    let expected = 1.0 - (1.0 + tip.law.pressing_rate_per_s * 1e-3).powi(-10);
    assert!((share - expected).abs() < 1e-3, "{share} {expected}");
}

#[test]
fn the_force_begins_with_the_present_one_but_with_no_more_than_desired() {
    let mut tip = Sliding::new();
    for (force_n, share) in [(20.0, 1.0), (4.0, 0.4), (-0.2, tip.law.least_pressing)] {
        tip.contact.force_n.y = force_n;
        tip.with(HybridSettings::reset);
        assert_eq!(tip.state.pressing, share);
    }
}

#[test]
fn the_force_integral_removes_the_error_up_to_its_limit() {
    let mut tip = Sliding::new();
    tip.law.force_integral_gain_per_s = 650.0;
    for (force_n, sign) in [(9.0, 1.0), (11.0, -1.0)] {
        tip.contact.force_n.y = force_n;
        tip.with(HybridSettings::reset);
        tip.state.pressing = 1.0;
        tip.with(HybridSettings::commanded_force_n);
        let step = sign * tip.state.force_integral_n;
        assert!(step > 0.0, "{step}");
        for _ in 0..100_000 {
            tip.with(HybridSettings::commanded_force_n);
        }
        assert_eq!(tip.state.force_integral_n, sign * tip.law.normal_force_n);
    }
}

#[test]
fn the_position_integral_waits_while_the_motion_is_slower_than_desired() {
    let mut tip = Sliding::new();
    tip.ahead_m = 0.05;
    tip.torque_limit_nm = 1.0;
    tip.tick();
    assert!(tip.state.slows, "{:?}", tip.state);
    let waiting = tip.state.position_integral_m_s2;
    tip.tick();
    assert_eq!(tip.state.position_integral_m_s2, waiting);
    tip.torque_limit_nm = 50.0;
    tip.tick();
    tip.tick();
    assert!(tip.state.position_integral_m_s2 > waiting);
}
