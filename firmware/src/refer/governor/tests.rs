//! Tests of the edges against Table II of the paper, and of the governed reference.

use super::*;
use crate::configuration::Configuration;
use painleve_shared::{ArmParameters, Pose, Slip};
use proptest::prelude::*;

const TICK_S: f32 = 1e-3;

fn arm() -> Arm<f32> {
    Arm::new(ArmParameters::default()).unwrap()
}

fn known(coefficient: f32, slip: Slip) -> FrictionEstimate {
    FrictionEstimate {
        coefficient,
        catch_up: 0.0,
        variance: 0.0,
        slip,
        slip_seen: true,
        sticks: false,
    }
}

fn governor() -> EdgeGovernor {
    let settings = GovernorSettings {
        p_ratio: 0.0,
        distance_m: 0.0,
        ..Default::default()
    };
    with(&configuration(&settings))
}

/// Returns a configuration of an arm that is known exactly.
fn configuration(governor: &GovernorSettings) -> Configuration {
    let mut configuration = Configuration::default();
    configuration.settings.governor = *governor;
    for encoder in &mut configuration.converters.encoders {
        encoder.bits = 24;
    }
    configuration
}

fn with(configuration: &Configuration) -> EdgeGovernor {
    EdgeGovernor::new(
        &configuration.settings.governor,
        configuration.tick_s(),
        configuration.kept_distance_m(),
        arm().reach_on_belt_m(),
    )
}

fn searched(tip_t_m: f32, posture: Posture, friction: &FrictionEstimate) -> EdgeGovernor {
    let mut governor = governor();
    for _ in 0..300 {
        governor.search(&arm(), posture, tip_t_m, friction, 0.0);
    }
    governor
}

#[test]
fn the_edges_are_those_of_table_ii() {
    let friction = known(0.6, Slip::Positive);
    for (posture, edge) in [(Posture::ElbowUp, 0.182_68), (Posture::ElbowDown, 0.164_71)] {
        let found = searched(-0.1, posture, &friction).stretch;
        assert!(
            (found.upper_m - edge).abs() < 2e-5,
            "{posture:?}: {found:?}"
        );
        assert!(found.lower_m < -0.183, "{posture:?}: {found:?}");
    }
}

/// The calibration of the length shortens the reach, perhaps below points that the search has found.
#[test]
fn a_reach_that_shrinks_during_a_search_does_not_hold_it_up() {
    let shorter = Arm::new(ArmParameters {
        link_length_m: [0.2; 2],
        ..ArmParameters::default()
    })
    .unwrap();
    let friction = known(0.6, Slip::Positive);
    for shortened_at in 0..60 {
        let mut governor = governor();
        for tick in 0..200 {
            let arm = if tick < shortened_at { arm() } else { shorter };
            governor.search(&arm, Posture::ElbowDown, -0.02, &friction, 0.0);
        }
        let found = governor.stretch;
        let reach_m = shorter.reach_on_belt_m();
        assert!(
            -reach_m < found.lower_m && found.upper_m < reach_m,
            "{shortened_at}: {found:?}"
        );
    }
}

/// Returns the distance, m, from the upper edge with the friction 0.6 to where p is zero, 0.16471 m.
fn distance_m(configuration: &Configuration, landing: f32) -> f32 {
    let mut governor = with(configuration);
    let friction = known(0.6, Slip::Positive);
    for _ in 0..300 {
        let posture = Posture::ElbowDown;
        governor.search(&arm(), posture, -0.1, &friction, landing);
    }
    0.164_71 - governor.stretch.upper_m
}

#[test]
fn what_moves_the_tip_adds_to_the_distance_in_squares() {
    let mut configuration = configuration(&GovernorSettings {
        p_ratio: 0.0,
        ..Default::default()
    });
    for encoder in &mut configuration.converters.encoders {
        encoder.bits = 11;
    }
    configuration.arm.coulomb_friction_nm = [0.05, 0.02];
    configuration.settings.estimator.tip_deviation_m = 2e-3;
    let distance = distance_m(&configuration, 0.0);
    // 0.5, 3.47, 3 and 4 mm.
    assert!((distance - 6.11e-3).abs() < 3e-5, "{distance}");
    configuration.settings.governor = GovernorSettings::default();
    let more = distance_m(&configuration, 0.0);
    assert!(more > distance + 0.5e-3, "{more}");
}

#[test]
fn the_stretch_ends_where_p_has_its_least_value_in_kilograms() {
    let settings = GovernorSettings {
        p_ratio: 0.0,
        p_per_kg: 2.0,
        distance_m: 0.0,
        ..Default::default()
    };
    let back_m = distance_m(&configuration(&settings), 0.0);
    let arm = Arm::<f32>::new(ArmParameters::default()).unwrap();
    let theta = arm
        .link_angles_on_belt_rad(0.164_71 - back_m, Posture::ElbowDown)
        .unwrap();
    let p = arm.p_per_kg(&Pose::new(&theta), 0.6, Slip::Positive);
    assert!((p - 2.0).abs() < 0.02, "{p} 1/kg, {back_m} m back");
}

#[test]
fn a_tip_that_may_land_asks_for_more() {
    let configuration = configuration(&GovernorSettings::default());
    let of = |landing| distance_m(&configuration, landing);
    assert_eq!(of(0.05), of(0.0));
    assert!(of(0.3) > 2.0 * of(0.0));
}

#[test]
fn the_distance_grows_with_the_square_of_the_period() {
    for (tick_hz, expected_m) in [(2000.0, 0.125e-3), (1000.0, 0.5e-3), (500.0, 2e-3)] {
        let settings = GovernorSettings {
            p_ratio: 0.0,
            ..Default::default()
        };
        let configuration = Configuration {
            tick_hz,
            ..configuration(&settings)
        };
        let distance = distance_m(&configuration, 0.0);
        assert!((distance - expected_m).abs() < 3e-5, "{distance}");
    }
}

#[test]
fn a_tip_beyond_the_edge_is_led_back_to_the_stretch_next_to_it() {
    let friction = known(0.6, Slip::Positive);
    let upper_m = searched(0.18, Posture::ElbowDown, &friction)
        .stretch
        .upper_m;
    assert!((upper_m - 0.164_71).abs() < 2e-5, "{upper_m}");
}

/// p of 6/kg is kept beyond 0.165 m only, where the arm is nearly straight; on the way there it falls to 1.3/kg.
#[test]
fn without_an_admissible_place_nearby_the_tip_is_led_to_the_best_one_and_not_across_the_belt() {
    let settings = GovernorSettings {
        p_per_kg: 6.0,
        ..Default::default()
    };
    let mut governor = with(&configuration(&settings));
    let friction = known(0.79, Slip::Negative);
    let mut tip_t_m = 0.03;
    for _ in 0..3000 {
        governor.search(&arm(), Posture::ElbowDown, tip_t_m, &friction, 0.0);
        if governor.has_edges_for(Posture::ElbowDown, 0.0) {
            let Stretch { lower_m, upper_m } = governor.stretch;
            tip_t_m += (tip_t_m.max(lower_m).min(upper_m) - tip_t_m).clamp(-1e-3, 1e-3);
        }
    }
    assert!((tip_t_m + 0.1).abs() < 0.015, "{tip_t_m}");
}

/// A tip in the air swings about the place to which it is led: the place must not swing with it.
#[test]
fn the_best_place_is_the_same_for_every_tip_or_the_tips_own() {
    let settings = GovernorSettings {
        p_per_kg: 6.0,
        ..Default::default()
    };
    let friction = known(0.79, Slip::Negative);
    let led = (0..80)
        .map(|step| -0.12 + 5e-4 * step as f32)
        .filter_map(|tip_t_m| {
            let mut governor = with(&configuration(&settings));
            for _ in 0..30 {
                governor.search(&arm(), Posture::ElbowDown, tip_t_m, &friction, 0.0);
            }
            let Stretch { lower_m, upper_m } = governor.stretch;
            assert_eq!(lower_m, upper_m, "{tip_t_m}");
            (upper_m != tip_t_m).then_some(upper_m)
        });
    let led: std::vec::Vec<f32> = led.collect();
    assert!(led.len() > 40, "{led:?}");
    assert!(led.iter().all(|place_m| *place_m == led[0]), "{led:?}");
}

/// Follows the reference `wanted` until it stands still; returns the final and the largest
/// position.
fn follow(
    governor: &mut EdgeGovernor,
    wanted: impl Fn(f32) -> TipReference,
) -> (TipReference, f32) {
    let mut largest = f32::MIN;
    let mut last = TipReference::default();
    for tick in 0..8000 {
        last = governor.govern(&wanted(tick as f32 * TICK_S));
        largest = largest.max(last.position_m);
    }
    (last, largest)
}

fn ramp(from: f32, speed: f32, end: f32) -> impl Fn(f32) -> TipReference {
    move |time: f32| {
        let position_m = from + speed * time;
        if position_m < end {
            TipReference {
                position_m,
                velocity_m_s: speed,
                acceleration_m_s2: 0.0,
            }
        } else {
            TipReference {
                position_m: end,
                ..Default::default()
            }
        }
    }
}

proptest! {
    #[test]
    fn edges_mirror_with_posture_and_slip(friction in 0.4_f32..1.0, tip in -0.1_f32..0.0) {
        let here = searched(tip, Posture::ElbowDown, &known(friction, Slip::Positive)).stretch;
        let there = searched(-tip, Posture::ElbowUp, &known(friction, Slip::Negative)).stretch;
        prop_assert!((here.upper_m + there.lower_m).abs() < 3e-5);
        prop_assert!((here.lower_m + there.upper_m).abs() < 3e-5);
    }

    #[test]
    fn a_reference_beyond_the_edge_ends_at_it_and_never_passes_it(
        speed in 0.03_f32..0.5, end in 0.166_f32..0.3,
    ) {
        let mut governor = searched(0.0, Posture::ElbowDown, &known(0.6, Slip::Positive));
        governor.restart(0.0);
        let edge = governor.stretch.upper_m;
        let (last, largest) = follow(&mut governor, ramp(0.0, speed, end));
        prop_assert!(governor.at_edge);
        prop_assert!(largest < edge + 1e-4, "{} {}", largest, edge);
        prop_assert!((last.position_m - edge).abs() < 1e-4 && last.velocity_m_s.abs() < 1e-3);
    }

    #[test]
    fn a_reference_inside_is_reached_and_then_followed_exactly(
        speed in 0.01_f32..0.3, end in -0.1_f32..0.16, start in -0.15_f32..0.15,
    ) {
        let mut governor = searched(0.0, Posture::ElbowDown, &known(0.6, Slip::Positive));
        governor.restart(start);
        let (last, _) = follow(&mut governor, ramp(-0.15, speed, end));
        let wanted = ramp(-0.15, speed, end)(7.999);
        prop_assert!((last.position_m - wanted.position_m).abs() < 1e-4, "{:?} {:?}", last, wanted);
        prop_assert!(!governor.at_edge);
    }
}

#[test]
fn a_moving_reference_is_caught_without_a_step_at_any_rate() {
    for tick_hz in [1e3, 1e2] {
        let configuration = Configuration {
            tick_hz,
            ..configuration(&GovernorSettings {
                catch_up_m_s: 0.3,
                ..GovernorSettings::default()
            })
        };
        let tick_s = configuration.tick_s();
        let mut governor = with(&configuration);
        governor.restart(-0.02);
        let mut last = governor.govern(&TipReference::at_rest(-0.02));
        let wanted = ramp(0.0, 0.25, 0.15);
        for tick in 0..(0.5 / tick_s) as u32 {
            let reference = governor.govern(&wanted(tick as f32 * tick_s));
            let step_m = (reference.position_m - last.position_m).abs();
            let fastest_m_s = reference.velocity_m_s.abs().max(last.velocity_m_s.abs());
            assert!(
                step_m < fastest_m_s * tick_s + RESOLVED_M + 1e-7,
                "{tick}: {step_m}"
            );
            last = reference;
        }
        assert!(governor.follows, "{tick_s}");
    }
}

#[test]
fn edges_of_the_other_posture_are_forgotten() {
    let friction = known(0.6, Slip::Positive);
    let mut governor = searched(0.0, Posture::ElbowDown, &friction);
    assert!(governor.has_edges_for(Posture::ElbowDown, 0.0));
    // Before the search for others, too.
    assert!(!governor.has_edges_for(Posture::ElbowUp, 0.0));
    assert!(!governor.has_edges_for(Posture::ElbowDown, 0.2));
    governor.search(&arm(), Posture::ElbowUp, 0.0, &friction, 0.0);
    assert!(!governor.has_edges_for(Posture::ElbowUp, 0.0));
    // A tip that had moved on to another place.
    governor.search(&arm(), Posture::ElbowDown, 0.05, &friction, 0.0);
    let Stretch { lower_m, upper_m } = governor.stretch;
    assert!(lower_m < 0.05 && upper_m > 0.05 && upper_m - lower_m < 0.005);
}

/// A margin that no place in reach keeps.
#[test]
fn of_places_that_are_all_out_of_reach_the_innermost_is_the_best() {
    for tip_t_m in [0.1, 0.15, 0.164, -0.164] {
        let settings = GovernorSettings {
            distance_m: 0.5,
            ..Default::default()
        };
        let mut governor = with(&configuration(&settings));
        let friction = known(0.6, Slip::Positive);
        for _ in 0..30 {
            governor.search(&arm(), Posture::ElbowDown, tip_t_m, &friction, 0.0);
        }
        let Stretch { lower_m, upper_m } = governor.stretch;
        assert!(
            lower_m.abs().max(upper_m.abs()) < tip_t_m.abs(),
            "{lower_m} {upper_m}"
        );
    }
}

#[test]
fn a_reference_that_was_reached_is_followed_however_fast() {
    let mut governor = searched(0.0, Posture::ElbowDown, &known(0.6, Slip::Positive));
    governor.restart(0.0);
    for tick in 0..100 {
        // 0.3 mm in a tick is a motion, not a jump.
        let wanted = ramp(0.0, 0.3, 0.2)(tick as f32 * TICK_S);
        assert_eq!(governor.govern(&wanted), wanted, "{tick}");
    }
}

#[test]
fn a_governor_that_is_off_passes_any_reference_on() {
    let friction = known(0.6, Slip::Positive);
    let mut governor = with(&configuration(&GovernorSettings {
        enabled: false,
        ..Default::default()
    }));
    for _ in 0..300 {
        governor.search(&arm(), Posture::ElbowDown, 0.0, &friction, 0.0);
    }
    let beyond = TipReference::at_rest(0.2);
    assert_eq!(governor.govern(&beyond), beyond);
    assert!(!governor.at_edge);
    // There the reference of a thrown tip waits.
    assert_eq!(TipReference::at_rest(governor.last.position_m), beyond);
}

#[test]
fn edges_stay_in_order_where_the_tip_has_crossed_one() {
    let friction = known(0.8, Slip::Positive);
    let governor = searched(-0.1, Posture::ElbowDown, &friction);
    let mut crossed = governor;
    crossed.stretch = Stretch {
        lower_m: 0.25,
        upper_m: 0.3,
    };
    for _ in 0..300 {
        crossed.search(&arm(), Posture::ElbowDown, -0.1, &friction, 0.0);
        let Stretch { lower_m, upper_m } = crossed.stretch;
        assert!(lower_m <= upper_m, "{lower_m} {upper_m}");
    }
    assert_eq!(crossed.stretch, governor.stretch);
}
