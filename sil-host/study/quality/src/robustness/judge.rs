//! Execution of one run of a campaign, and its ending.

use core::ops::Range;

use painleve_plant::Plant;
use painleve_plant::belt_line::{BeltLine, admissible_m, p_ratio};
use painleve_plant::contact_probe::{CAPTURE_S, ContactProbe};
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::Scenario;
use painleve_plant::smoothness::Smoothness;
use painleve_shared::frame::StatusFlags;
use painleve_shared::{Arm, Posture, Slip};
use painleve_study_core::StudyError;
use painleve_study_core::trial::Trial;

use super::{Ending, FalseAlarms, Row};

/// Latest completion of the capture, s after enabling.
pub const CAPTURE_LIMIT_S: f64 = 0.5;
/// Final interval of a run in which the tip must be at its target or governed edge, s.
const WATCHED_S: f64 = 0.1;
/// Largest final distance from target or governed edge, beyond the encoders' resolution, m.
const WITHIN_M: f64 = 1e-3;
/// Largest distance before the true edge, or before the end of the usable reach, at which a governed reference may be held, m.
const SHORT_M: f64 = 0.01;
/// Largest p, as a fraction of Q22, at which a governed reference may be held farther from the
/// edge: where p hardly changes along the belt, a small change of friction moves
/// the edge far.
const SHORT_P_RATIO: f64 = 0.1;

/// How lift-offs after the capture are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiftOffRule {
    /// A single lift-off fails the run.
    Fail,
    /// Lift-offs are only counted, because the effect throws the tip off, not the controller; the tip must be back at
    /// the end.
    Counted,
}

/// Runs a scenario with one reference to its end, on a plant in its initial state, and judges it.
///
/// # Errors
/// [`StudyError`] if the scenario is invalid.
pub fn run<P: Plant>(
    plant: P,
    scenario: &Scenario,
    index: usize,
    judged: LiftOffRule,
) -> Result<Row, StudyError> {
    let end_s = scenario.run.duration_s;
    let arm = Arm::new(scenario.moving_arm())?;
    let posture = Posture::of(&theta(&scenario.initial.state(&scenario.arm)?));
    let v_belt_m_s = scenario.belt.profile.speed_m_s(0.0);
    let target_m = scenario.target_m();
    let enabled_s = scenario.run.enable_at_s;
    let mut trial = Trial::on(plant, scenario)?;
    let start_m = trial.tip_t_m();
    let mut contact = ContactProbe::new(enabled_s, CAPTURE_S);
    let mut alarms = FalseAlarms::default();
    let mut smoothness = Smoothness::new(f64::from(scenario.run.tick_hz));
    let (mut of_target_m, mut of_governed_m) = (0.0_f64, 0.0_f64);
    let (mut sum_m, mut count, mut governed) = (0.0, 0.0, None);
    let mut stands = true;
    let mut solved = true;
    for _ in 0..scenario.run.ticks() {
        if trial.tick(&mut contact).is_err() {
            solved = false;
            break;
        }
        alarms.tick(&trial, &contact);
        smoothness.add(trial.new_answer(), trial.normal_force_n());
        if trial.time_s() > end_s - WATCHED_S {
            let tip_m = trial.tip_t_m();
            let governed_m = trial.answer().reference_tip.to_metres();
            // Without a target, the tip is where it should be if it is at the reference.
            of_target_m = of_target_m.max((tip_m - target_m.unwrap_or(governed_m)).abs());
            of_governed_m = of_governed_m.max((tip_m - governed_m).abs());
            sum_m += tip_m - governed_m;
            count += 1.0;
            let reference = trial.answer().reference_tip;
            stands &= governed
                .replace(reference)
                .is_none_or(|before| before == reference);
        }
    }
    let bits = i32::from(scenario.converters.encoder.bits);
    let count_rad = libm::ldexp(core::f64::consts::TAU, -bits);
    let tolerance_m =
        WITHIN_M + count_rad * (scenario.arm.height_m + scenario.arm.link_length_m[1]);
    let slip = Slip::of(-v_belt_m_s);
    let friction = scenario.belt.friction;
    let stretch = stretch_around_m(&arm, posture, friction, slip, start_m);
    // Of the arm as it stands, not as it would on the undeformed belt: 10 N press the tip 1 mm into a belt of 1e4 N/m,
    // which near the edge changes p/Q22 by a tenth.
    let p_ratio = p_ratio(&arm, &trial.theta_rad(), friction, slip);
    let tip_t_m = trial.tip_t_m();
    let ahead_m = if target_m.is_some_and(|target_m| target_m > start_m) {
        stretch.end - tip_t_m
    } else {
        tip_t_m - stretch.start
    };
    let at_edge = trial.answer().flags.contains(StatusFlags::AT_EDGE);
    let to_edge_m = target_m.filter(|_| at_edge).and_then(|target_m| {
        let held_m = target_m - trial.answer().reference_tip.to_metres();
        let line = BeltLine::new(&arm, posture);
        line.before_edge_m(tip_t_m, held_m, friction, slip)
    });
    let captured = contact
        .captured_s
        .is_some_and(|start_s| start_s + CAPTURE_S <= enabled_s + CAPTURE_LIMIT_S);
    let ending = if !solved {
        Ending::Unsolved
    } else if trial.fault().is_some() {
        Ending::Fault
    } else if !captured {
        Ending::NotCaptured
    } else if contact.lift_offs > 0 && (judged == LiftOffRule::Fail || !contact.touches()) {
        Ending::LiftOff
    } else if of_target_m <= tolerance_m {
        Ending::Reached
    } else if at_edge && of_governed_m <= tolerance_m {
        if ahead_m > SHORT_M && p_ratio > SHORT_P_RATIO {
            Ending::StoppedEarly
        } else {
            Ending::AtEdge
        }
    } else {
        Ending::NotReached
    };
    let converters = &scenario.converters;
    Ok(Row {
        index,
        ending,
        fault: trial.fault().map(|fault| fault as u8),
        capture_s: contact.captured_s.map(|start_s| start_s - enabled_s),
        lift_offs: contact.lift_offs,
        first_lift_off_s: contact.first_lift_off_s,
        error_m: of_governed_m,
        resting_error_m: (stands && count > 0.0).then(|| f64::abs(sum_m / count)),
        tolerance_m,
        to_edge_m,
        p_ratio,
        false_alarms: alarms.count,
        slid_s: contact
            .captured_s
            .map_or(0.0, |start_s| trial.time_s() - start_s),
        torque_change_moving_nm: smoothness.moving.torque_change_nm(converters),
        torque_change_holding_nm: smoothness.holding.torque_change_nm(converters),
        torque_reversals: smoothness.holding.reversals(),
        force_ripple_n: smoothness.holding.force_ripple_n(),
        tip_t_m,
        target_m,
        posture,
        mu: scenario.belt.friction,
        v_belt_m_s,
        tick_hz: scenario.run.tick_hz,
        encoder_bits: converters.encoder.bits,
        torque_bits: converters.torque.bits,
        torque_lag_s: converters.torque.lag_s,
        delay_ticks: converters.torque.delay_ticks,
        force_noise_n: converters.force.noise_n,
        frame_loss: converters.link.frame_loss,
        link_length_m: scenario.arm.link_length_m[0],
        link_2_length_m: scenario.arm.link_length_m[1],
        link_mass_kg: scenario.arm.link_mass_kg[0],
        link_2_mass_kg: scenario.arm.link_mass_kg[1],
        stiffness_nm_rad: scenario.arm.stiffness_nm_rad[1],
        height_m: scenario.arm.height_m,
        belt_tilt_rad: scenario.arm.belt_tilt_rad,
    })
}

/// Returns the stretch with p > 0 around a tip position, m; empty if p is not positive there.
fn stretch_around_m(
    arm: &Arm<f64>,
    posture: Posture,
    friction: f64,
    slip: Slip,
    tip_t_m: f64,
) -> Range<f64> {
    let stretches = admissible_m(arm, posture, friction, slip, 0.0);
    let mut around = stretches
        .into_iter()
        .filter(|stretch| stretch.contains(&tip_t_m));
    around.next_back().unwrap_or(tip_t_m..tip_t_m)
}
