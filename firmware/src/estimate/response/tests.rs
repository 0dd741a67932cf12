//! Tests of the response of the contact on simulated contacts.

use super::*;
use crate::test_readings::noise;

const TICK_S: f32 = 1e-3;
const P_PER_KG: f32 = 2.4;
const P_RATIO: f32 = 0.09;

/// Force that a torque stage of 12 bits withholds by rounding, N.
const ROUNDING_N: f32 = 0.05;

fn estimator() -> ResponseEstimator {
    ResponseEstimator::new(&ResponseSettings::default(), TICK_S)
}

/// Returns the response after `ticks` of a contact that gives the force (N) in
/// answer to the force commanded at the previous tick.
fn observed(ticks: u32, contact: impl FnMut(f32) -> f32) -> ContactResponse {
    observed_by(estimator(), ROUNDING_N, |_| 1, ticks, contact)
}

/// The same by an estimator, with torques rounded by this force and readings that follow the previous ones after these
/// ticks.
fn observed_by(
    mut estimator: ResponseEstimator,
    rounding_n: f32,
    elapsed_ticks: impl Fn(u32) -> u32,
    ticks: u32,
    mut contact: impl FnMut(f32) -> f32,
) -> ContactResponse {
    // The probe of a tick is drawn after the tick before.
    let (mut withheld, mut probe_n, mut commanded) = (0.0, 0.0, 10.0);
    for tick in 0..ticks {
        let force_n = contact(commanded) + 0.03 * noise(3 * tick);
        estimator.update(force_n, withheld, elapsed_ticks(tick));
        match tick % Turn::COUNT as u32 {
            0 => estimator.average(),
            1 => estimator.bound(),
            _ => {}
        }
        let next = rounding_n * noise(3 * tick + 1);
        commanded = 10.0 + next - withheld + probe_n;
        (withheld, probe_n) = (next, estimator.allowed.probe_n);
    }
    estimator.response(P_PER_KG, P_RATIO)
}

/// A spring and damper under an arm of mobility p, in small steps.
fn compliant(stiffness_n_m: f32, damping_ns_m: f32) -> impl FnMut(f32) -> f32 {
    let (mut depth, mut rate) = (10.0 / stiffness_n_m, 0.0);
    move |commanded| {
        let force = |depth: f32, rate: f32| stiffness_n_m * depth + damping_ns_m * rate;
        for _ in 0..100 {
            rate += P_PER_KG * (commanded - force(depth, rate)) * TICK_S / 100.0;
            depth += rate * TICK_S / 100.0;
        }
        force(depth, rate)
    }
}

#[test]
fn a_rigid_contact_is_found_and_costs_nothing() {
    let found = observed(1500, |commanded| commanded);
    assert_eq!(found, ContactResponse::rigid(P_RATIO));
}

#[test]
fn a_rigid_contact_behind_a_slow_torque_stage_is_rigid() {
    let mut force = 10.0;
    let share = 1.0 - libm::expf(-TICK_S / 0.5e-3);
    let found = observed(1500, |commanded| {
        force += share * (commanded - force);
        force
    });
    assert_eq!(found.give, 0.0, "{found:?}");
}

#[test]
fn the_share_of_a_compliant_contact_falls_with_its_damping() {
    let of = |damping| observed(1500, compliant(1e5, damping));
    let (firm, soft) = (of(90.0), of(20.0));
    assert!(soft.loop_share < firm.loop_share && firm.loop_share < EACH_LOOP * P_RATIO);
    assert!(soft.loop_share < 0.5 * EACH_LOOP * P_RATIO, "{soft:?}");
    let softest = observed(1500, compliant(1e4, 5.0));
    assert!(softest.give > 0.0, "{softest:?}");
}

/// Returns the response after `ticks` of a contact whose force swings by `amplitude_n` at 50 Hz during the first second.
fn swinging(ticks: u32, amplitude_n: f32, mut contact: impl FnMut(f32) -> f32) -> ContactResponse {
    let mut tick = 0;
    observed(ticks, |commanded| {
        tick += 1;
        let amplitude_n = if tick <= 1000 { amplitude_n } else { 0.0 };
        let phase = core::f32::consts::TAU * 0.05 * tick as f32;
        contact(commanded) + amplitude_n * libm::sinf(phase)
    })
}

#[test]
fn a_contact_certainly_lags_even_if_its_force_swings() {
    let gives = swinging(1000, 3.0, compliant(1e5, 60.0));
    assert!(gives.lags > 0.0, "{gives:?}");
    assert_eq!(swinging(1000, 3.0, |commanded| commanded).lags, 0.0);
}

/// The force changes for other reasons while no readings arrive, and by more than in a tick.
#[test]
fn a_rigid_contact_is_found_even_if_readings_are_lost() {
    let mut tick = 0;
    let elapsed_ticks = |tick| if tick % 10 == 0 { 3 } else { 1 };
    let found = observed_by(estimator(), ROUNDING_N, elapsed_ticks, 1500, |commanded| {
        let drift_n = noise(tick / 10);
        tick += 1;
        commanded + drift_n
    });
    assert_eq!(found, ContactResponse::rigid(P_RATIO));
}

#[test]
fn all_is_allowed_if_it_is_off() {
    let settings = ResponseSettings {
        enabled: false,
        ..Default::default()
    };
    let estimator = ResponseEstimator::new(&settings, TICK_S);
    let found = estimator.response(P_PER_KG, P_RATIO);
    assert_eq!(found, ContactResponse::rigid(P_RATIO));
}

/// Passes readings without a change to an estimator, and counts the ticks until it probes.
fn ticks_until_probe(estimator: &mut ResponseEstimator) -> u8 {
    let mut ticks = 0;
    while estimator.allowed.probe_n == 0.0 {
        estimator.update(10.0, 0.0, 1);
        ticks += 1;
    }
    ticks
}

/// Forces that stay the same by chance for a few ticks would look like a contact that does not follow the torque.
#[test]
fn a_few_readings_show_nothing() {
    let mut state = estimator();
    // Two forces before the first change of a change.
    state.touched_s = SETTLING_S - 2.5 * TICK_S;
    for _ in 0..2 {
        state.update(10.0, 0.0, 1);
    }
    let unknown = state.response(P_PER_KG, P_RATIO);
    let turn = |state: &mut ResponseEstimator, number: u32| {
        for tick in 0..Turn::COUNT as u32 {
            state.update(10.0, 0.05 * noise(10 * number + tick), 1);
        }
        state.average();
        state.bound();
    };
    for number in 1..LEAST_TURNS as u32 {
        turn(&mut state, number);
        let found = state.response(P_PER_KG, P_RATIO);
        assert_eq!(
            ContactResponse {
                probe_n: 0.0,
                ..found
            },
            unknown
        );
    }
    turn(&mut state, 0);
    assert_eq!(state.response(P_PER_KG, P_RATIO).lags, 1.0);
}

#[test]
fn the_better_the_response_is_known_the_less_is_probed() {
    let probe_n = |ticks| observed(ticks, compliant(1e5, 60.0)).probe_n.abs();
    assert_eq!(probe_n(60), ResponseSettings::default().probe_n);
    assert!(probe_n(1500) > 0.0 && probe_n(1500) < 0.02);
}

#[test]
fn after_a_pause_the_contact_settles_before_the_next_probe() {
    let mut state = estimator();
    ticks_until_probe(&mut state);
    state.pause();
    let ticks = ticks_until_probe(&mut state);
    let settling = SETTLING_S / TICK_S;
    assert!((f32::from(ticks) - settling).abs() <= 1.0, "{ticks}");
}

/// The rounding of a torque stage of 20 bits shows nothing below the noise of the force cell.
#[test]
fn behind_a_fine_torque_stage_only_the_probe_finds_a_rigid_contact() {
    let share = |probe_n: f32| {
        let settings = ResponseSettings {
            probe_n,
            ..Default::default()
        };
        let estimator = ResponseEstimator::new(&settings, TICK_S);
        observed_by(
            estimator,
            ROUNDING_N / 256.0,
            |_| 1,
            1500,
            |force_n| force_n,
        )
        .loop_share
    };
    let rigid = ContactResponse::rigid(P_RATIO).loop_share;
    assert_eq!(share(ResponseSettings::default().probe_n), rigid);
    let least_of_rigid = share(0.0) / rigid;
    assert!(least_of_rigid < 0.1, "{least_of_rigid}");
}
