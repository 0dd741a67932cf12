//! Every built-in mistake is found and named, and nothing is found in healthy arms.

use painleve_commission::simulated::{BuiltInMistake, SimulatedError, SimulatedRig, random_arm};
use painleve_commission::{
    CommissionError, Commissioned, Expected, Mistake, NoSlide, OperatorTask, RawReadings, Rig,
    commission,
};
use painleve_plant::decimal::as_written;
use painleve_plant::scenario::{Knowledge, Scenario};
use painleve_shared::counts::TorqueCounts;
use painleve_shared::{Arm, ArmParameters, Pose};

const TORQUE_LIMIT_NM: f64 = 1.0;

/// First seed of the random arms.
const FIRST_SEED: u64 = 20_000;

/// Commissions a simulated arm; a refusal is its message.
fn commissioned(
    scenario: &Scenario,
    mistake: Option<BuiltInMistake>,
    seed: u64,
) -> Result<Commissioned, String> {
    let expected = Expected::new(scenario, TORQUE_LIMIT_NM).unwrap();
    let mut rig = SimulatedRig::new(scenario, mistake, seed);
    commission(&mut rig, &expected).map_err(|error| match error {
        CommissionError::Refused(mistake) => mistake.to_string(),
        other => panic!("{other}"),
    })
}

/// Returns the findings as messages, and whether the arm was refused.
fn found(scenario: &Scenario, mistake: BuiltInMistake, seed: u64) -> (bool, Vec<String>) {
    match commissioned(scenario, Some(mistake), seed) {
        Ok(commissioned) => {
            let deviations = commissioned.deviations.iter();
            (false, deviations.map(ToString::to_string).collect())
        }
        Err(message) => (true, vec![message]),
    }
}

/// Returns the beginning of every message that names the mistake, and whether the arm is refused.
fn named(mistake: BuiltInMistake) -> (bool, &'static [&'static str]) {
    use BuiltInMistake::*;
    match mistake {
        FirstEncoderMirrored => (
            false,
            &["encoder of joint 1: counts in the other direction"],
        ),
        ElbowEncoderMirrored => (
            false,
            &["encoder of the elbow: counts in the other direction"],
        ),
        EncodersSwapped => (true, &["encoders: exchanged"]),
        FirstEncoderTurned => (false, &["encoder of joint 1: its zero is"]),
        ElbowEncoderTurned => (false, &["encoder of the elbow: its zero is"]),
        ElbowEncoderDead => (true, &["encoder of the elbow: its reading did not change"]),
        FirstEncoderSilent => (true, &["encoder of joint 1: no readings"]),
        ElbowEncoderGeared => (true, &["encoder of the elbow: turned by"]),
        FirstStageMirrored => (
            false,
            &["torque stage of joint 1: turns its joint in the other"],
        ),
        ElbowStageMirrored => (
            false,
            &["torque stage of the elbow: turns its joint in the other"],
        ),
        StagesSwapped => (true, &["torque stages: exchanged"]),
        FirstStageHalved => (true, &["torque stage of joint 1: gives 0."]),
        ElbowStageDoubled => (true, &["torque stage of the elbow: gives "]),
        FirstGearOfAnotherRatio => (true, &["torque stage of joint 1: gives 0.3"]),
        ElbowStageDead => (true, &["torque stage of the elbow: no effect"]),
        ForceCellUpsideDown => (
            false,
            &[
                "force cell: f_n has the other sign",
                "force cell: f_t has the other sign",
            ],
        ),
        TangentialForceMirrored => (false, &["force cell: f_t has the other sign"]),
        ForceAxesSwapped => (true, &["force cell: f_t and f_n are exchanged"]),
        ForceCellOutOfBalance => (true, &["force cell: f_n reads"]),
        ForceCellWithoutSupply => (true, &["force cell: no readings"]),
        ForceCellStuck => (true, &["force cell: f_n did not change"]),
        ForceCellOfAnotherRange => (true, &["force cell: reads 0.3"]),
        BeltTooHigh => (false, &["belt: it is"]),
    }
}

/// Checks that exactly the messages of the mistake are found.
fn is_named(scenario: &Scenario, mistake: BuiltInMistake, seed: u64) -> Result<(), String> {
    let (is_refused, beginnings) = named(mistake);
    let (refused, messages) = found(scenario, mistake, seed);
    let matches = refused == is_refused
        && messages.len() == beginnings.len()
        && messages
            .iter()
            .zip(beginnings)
            .all(|(message, beginning)| message.starts_with(beginning));
    matches
        .then_some(())
        .ok_or(format!("seed {seed}, {}: {messages:?}", mistake.name()))
}

/// Masses in grams, and a force cell that is too small.
#[test]
fn a_weight_that_no_cell_measures_is_told_before_anybody_holds_the_arm() {
    for key in ["arm.link_mass_kg=[120, 120]", "converters.force.range_n=3"] {
        let overrides = [key.to_owned()];
        let scenario = Scenario::default().with_overrides("heavy", &overrides);
        let refusal = commissioned(&scenario.unwrap(), None, 1).unwrap_err();
        let expected = "more than the force cell measures (converters.force.range_n = ";
        assert!(refusal.contains(expected), "{key}: {refusal}");
    }
}

#[test]
fn every_built_in_mistake_is_found_and_named() {
    for mistake in BuiltInMistake::ALL {
        assert_eq!(is_named(&Scenario::default(), *mistake, 1), Ok(()));
    }
}

/// With its elbow up, the arm rests with 17.4 N on a force cell of 20 N: pressing harder takes the cell to its limit.
#[test]
fn every_mistake_is_found_in_an_arm_whose_weight_nearly_fills_the_force_cell() {
    let scenario = Scenario::load("hybrid-elbow-up", &[]).unwrap();
    for mistake in BuiltInMistake::ALL {
        for seed in 1..4 {
            assert_eq!(is_named(&scenario, *mistake, seed), Ok(()));
        }
    }
}

#[test]
fn a_healthy_arm_is_refused_for_no_more_than_the_range_of_its_force_cell() {
    let mut passed = 0;
    // By its model, the arm rests with 17.4 N, and by a board's readings no working cell gives more than 96 % of its range.
    for range_n in (0..30).map(|step| 17.0 + 0.1 * f64::from(step)) {
        let range = format!("converters.force.range_n={range_n}");
        let scenario = Scenario::load("hybrid-elbow-up", &[range]).unwrap();
        for seed in 1..5 {
            match commissioned(&scenario, None, seed) {
                Ok(commissioned) => {
                    assert_eq!(commissioned.deviations, [], "{range_n} N, seed {seed}");
                    passed += 1;
                }
                Err(refusal) => assert!(
                    refusal.contains("converters.force.range_n"),
                    "{range_n} N, seed {seed}: {refusal}"
                ),
            }
        }
    }
    assert!(passed >= 40, "{passed}");
}

#[test]
#[ignore = "a campaign"]
fn every_mistake_is_found_in_random_arms() {
    let failures: Vec<String> = (FIRST_SEED..FIRST_SEED + 25)
        .flat_map(|seed| {
            let scenario = random_arm(seed).unwrap();
            let failures = BuiltInMistake::ALL.iter();
            failures
                .filter_map(|mistake| is_named(&scenario, *mistake, seed).err())
                .collect::<Vec<_>>()
        })
        .collect();
    assert!(
        failures.is_empty(),
        "{} failures: {failures:#?}",
        failures.len()
    );
}

#[test]
fn nothing_is_found_in_a_hundred_healthy_random_arms() {
    for seed in FIRST_SEED..FIRST_SEED + 100 {
        let arm = random_arm(seed).unwrap();
        let commissioned = commissioned(&arm, None, seed).unwrap();
        assert_eq!(commissioned.deviations, [], "seed {seed}");
        let described = arm.arm_model.map(|model| as_written(model.height_m));
        assert_eq!(Some(commissioned.height_m), described, "seed {seed}");
    }
}

/// A corrected scenario describes the arm: commissioned again, nothing is found.
#[test]
fn a_corrected_scenario_describes_the_arm() {
    let scenario = Scenario::default();
    for mistake in BuiltInMistake::ALL.iter().filter(|it| !named(**it).0) {
        let corrected = commissioned(&scenario, Some(*mistake), 1).unwrap();
        let corrected = corrected.applied_to(&scenario).unwrap();
        if *mistake != BuiltInMistake::BeltTooHigh {
            // The arm keeps its mistake: what is described now is built into the arm that was described.
            let mut mistaken = SimulatedRig::new(&scenario, Some(*mistake), 2);
            let expected = Expected::new(&corrected, TORQUE_LIMIT_NM).unwrap();
            let again = commission(&mut mistaken, &expected).unwrap();
            assert_eq!(again.deviations, [], "{}", mistake.name());
        }
        assert_eq!(
            Scenario::from_toml(&corrected.to_commented_toml()).unwrap(),
            corrected
        );
    }
}

/// An arm that has been identified: its encoders' errors are corrected, and known.
fn identified() -> Scenario {
    let overrides = [
        "controller.estimator.encoders.zero_rad=[0.045, -0.04]",
        "controller.estimator.encoders.cosine_rad=[0.005, -0.004]",
        "controller.estimator.tip_deviation_m=3e-4",
        "knowledge.source=slides",
        "knowledge.off_line_m=2e-5",
    ];
    let scenario = Scenario::default();
    scenario
        .with_overrides("identified", &overrides.map(String::from))
        .unwrap()
}

/// Distance of the resting tip from the belt by what was measured, m.
fn gap_m(commissioned: &Commissioned, scenario: &Scenario) -> f64 {
    let tip = Arm::new(scenario.arm)
        .unwrap()
        .tip_m(&Pose::new(&commissioned.rest_rad));
    tip.y + scenario.arm.height_m
}

/// An operator who holds a link in another direction than told in one pose.
struct Careless {
    rig: SimulatedRig,
    pose: usize,
    plumb_deg: [f64; 2],
    poses: usize,
}

impl Rig for Careless {
    type Error = SimulatedError;

    fn instruct(&mut self, mut task: OperatorTask) -> Result<(), SimulatedError> {
        if let OperatorTask::Hold { plumb_deg } = &mut task {
            if self.poses == self.pose {
                *plumb_deg = self.plumb_deg;
            }
            self.poses += 1;
        }
        self.rig.instruct(task)
    }

    fn exchange(&mut self, torques: [TorqueCounts; 2]) -> Result<RawReadings, SimulatedError> {
        self.rig.exchange(torques)
    }
}

#[test]
fn a_pose_that_is_held_otherwise_than_told_gives_no_zero() {
    let scenario = Scenario::default();
    let expected = Expected::new(&scenario, TORQUE_LIMIT_NM).unwrap();
    // The elbow in the other direction, link 1 in the other direction, and link 1 off by 40° with its elbow right.
    for (pose, plumb_deg, joint) in [
        (0, [0.0, -90.0], 1),
        (2, [90.0, 180.0], 1),
        (1, [-90.0, 90.0], 0),
        (2, [50.0, -40.0], 0),
    ] {
        let mut rig = Careless {
            rig: SimulatedRig::new(&scenario, None, 1),
            pose,
            plumb_deg,
            poses: 0,
        };
        match commission(&mut rig, &expected) {
            Err(CommissionError::Refused(mistake)) => {
                assert_eq!(mistake, Mistake::HeldOtherwise { joint }, "{plumb_deg:?}");
            }
            other => panic!("{plumb_deg:?}: {other:?}"),
        }
    }
}

#[test]
fn an_identified_arm_stays_identified() {
    let scenario = identified();
    for seed in 1..5 {
        let commissioned = commissioned(&scenario, None, seed).unwrap();
        assert_eq!(commissioned.deviations, []);
        let gap_m = gap_m(&commissioned, &scenario);
        assert!(gap_m.abs() < 3e-4, "{gap_m}");
        let corrected = commissioned.applied_to(&scenario).unwrap();
        assert_eq!(corrected.knowledge, scenario.knowledge);
        assert_eq!(
            corrected.controller.estimator,
            scenario.controller.estimator
        );
    }
}

#[test]
fn a_magnet_that_has_been_turned_takes_its_correction_and_what_was_known_with_it() {
    let scenario = identified();
    for (joint, mistake) in [
        (0, BuiltInMistake::FirstEncoderTurned),
        (1, BuiltInMistake::ElbowEncoderTurned),
    ] {
        let commissioned = commissioned(&scenario, Some(mistake), 1).unwrap();
        assert_eq!(commissioned.deviations.len(), 1);
        // To half a degree of the operator's hands, and the error once around.
        let gap_m = gap_m(&commissioned, &scenario);
        assert!(gap_m.abs() < 2e-3, "{gap_m}");
        let corrected = commissioned.applied_to(&scenario).unwrap();
        let estimator = &corrected.controller.estimator;
        let mut encoders = scenario.controller.estimator.encoders;
        encoders.zero_rad[joint] = 0.0;
        encoders.cosine_rad[joint] = 0.0;
        assert_eq!(estimator.encoders, encoders);
        assert!(
            estimator.tip_deviation_m > 0.01,
            "{}",
            estimator.tip_deviation_m
        );
        assert_eq!(corrected.knowledge.off_line_m, 0.0);
        // Commissioned again, the arm is as the scenario says.
        let expected = Expected::new(&corrected, TORQUE_LIMIT_NM).unwrap();
        let mut rig = SimulatedRig::new(&scenario, Some(mistake), 2);
        let again = commission(&mut rig, &expected).unwrap();
        assert_eq!(again.deviations, []);
    }
}

#[test]
fn a_belt_that_has_been_moved_leaves_the_correction_and_takes_what_was_known() {
    let scenario = identified();
    let commissioned = commissioned(&scenario, Some(BuiltInMistake::BeltTooHigh), 1).unwrap();
    let corrected = commissioned.applied_to(&scenario).unwrap();
    let estimator = &corrected.controller.estimator;
    assert_eq!(estimator.encoders, scenario.controller.estimator.encoders);
    assert!(
        estimator.tip_deviation_m > 0.01,
        "{}",
        estimator.tip_deviation_m
    );
}

/// A magnet that slips by less than the operator's hands are trusted, and a belt that moves by less than the zeros are.
#[test]
fn a_small_change_of_an_identified_arm_takes_what_was_known_with_it() {
    let scenario = identified();
    let mut slipped = scenario.clone();
    slipped.converters.encoder.offset_counts[1] += 91;
    let mut lowered = scenario.clone();
    lowered.arm.height_m += 0.003;
    for actual in [slipped, lowered] {
        let mut rig = SimulatedRig::new(&actual, None, 1);
        let expected = Expected::new(&scenario, TORQUE_LIMIT_NM).unwrap();
        let commissioned = commission(&mut rig, &expected).unwrap();
        let corrected = commissioned.applied_to(&scenario).unwrap();
        assert_eq!(corrected.knowledge.off_line_m, 0.0);
        assert!(corrected.controller.estimator.tip_deviation_m > 0.01);
    }
}

#[test]
fn play_that_the_operator_has_told_is_kept() {
    let told = "controller.estimator.tip_deviation_m=0.05".to_owned();
    let scenario = Scenario::default().with_overrides("play", &[told]).unwrap();
    let commissioned = commissioned(&scenario, None, 1).unwrap();
    let corrected = commissioned.applied_to(&scenario).unwrap();
    assert_eq!(corrected.knowledge.told_m, 0.05);
    let drawn = commissioned.applied_to(&Scenario::default()).unwrap();
    let drawn_m = drawn.controller.estimator.tip_deviation_m;
    let deviation_m = corrected.controller.estimator.tip_deviation_m;
    assert!((deviation_m - drawn_m.hypot(0.05)).abs() < 1e-6);
    // Whatever was identified of an arm that has changed is gone.
    let moved = Scenario {
        knowledge: Knowledge {
            off_line_m: 2e-5,
            ..corrected.knowledge.clone()
        },
        arm: ArmParameters {
            height_m: scenario.arm.height_m + 0.02,
            ..scenario.arm
        },
        ..corrected
    };
    // So is what a rehearsal has measured, even of an arm that is mounted alike.
    let mut rehearsed = drawn.clone();
    rehearsed.knowledge.source = Knowledge::rehearsal(1);
    let real = commissioned.applied_to(&rehearsed).unwrap();
    assert!(!real.knowledge.is_rehearsed());
    let again = commissioned.applied_to(&moved).unwrap();
    assert_eq!(again.knowledge.told_m, 0.05);
    assert_eq!(again.controller.estimator.tip_deviation_m, deviation_m);
}

#[test]
fn a_torque_below_the_noise_of_the_force_cell_blames_no_part() {
    let scenario = Scenario::default();
    for seed in FIRST_SEED..FIRST_SEED + 8 {
        let expected = Expected::new(&scenario, 2e-3).unwrap();
        let mut rig = SimulatedRig::new(&scenario, None, seed);
        let refusal = commission(&mut rig, &expected).unwrap_err();
        let is_named = matches!(
            refusal,
            CommissionError::Refused(Mistake::TorqueTooSmall { .. })
        );
        assert!(is_named, "{refusal}");
    }
}

#[test]
fn a_friction_too_large_to_be_measured_is_told_from_a_torque_limit() {
    let friction = |friction: f64, torque_limit_nm: f64| {
        let overrides = [format!("belt.friction={friction}")];
        let scenario = Scenario::default()
            .with_overrides("rough", &overrides)
            .unwrap();
        let expected = Expected::new(&scenario, torque_limit_nm).unwrap();
        let mut rig = SimulatedRig::new(&scenario, None, 2);
        commission(&mut rig, &expected).unwrap().friction
    };
    let limited = friction(0.9, 0.2).unwrap_err();
    assert_eq!(limited, NoSlide::TorqueLimit { limit_nm: 0.2 });
    assert_eq!(
        limited.to_string(),
        "the tip did not slide within a torque of 0.2 N·m; raise --torque-limit-nm, or set belt.friction"
    );
    assert_eq!(friction(1.9, 5.0), Err(NoSlide::Holds));
}

#[test]
fn friction_is_measured_to_a_tenth() {
    let mut measured = 0;
    for seed in FIRST_SEED..FIRST_SEED + 40 {
        let scenario = random_arm(seed).unwrap();
        if let Ok(friction) = commissioned(&scenario, None, seed).unwrap().friction {
            let actual = scenario.belt.friction;
            assert!(
                (friction / actual - 1.0).abs() < 0.15,
                "seed {seed}: {friction}, {actual}"
            );
            measured += 1;
        }
    }
    assert!(measured > 10, "{measured}");
}
