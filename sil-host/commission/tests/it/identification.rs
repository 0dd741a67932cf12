//! Arms as bad as life are identified on their own belts and then slide in closed loops; wrong ones are refused.
//!
//! `PAINLEVE_ARMS=100 cargo test --profile verify -p painleve-commission --test it -- --ignored --nocapture` prints the
//! figures of the documentation.

mod mujoco;
mod mujoco_arm;

use painleve_commission::identification::{
    Found, IdentificationError, Slid, SlideRig, SlideTick, Surprise, identify_arm, prior, readings,
    slide_scenario,
};
use painleve_commission::set_down::SetDown;
use painleve_commission::simulated::{
    GeometryMistake, PlantOf, SimulatedError, SimulatedSlides, imperfect,
};
use painleve_firmware::law::LawSettings;
use painleve_identify::parameters::Drawn;
use painleve_identify::torques::{Estimate, Joint, Joints};
use painleve_identify::{Parameter, Reading, Refusal};
use painleve_plant::Plant;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::Scenario;
use painleve_shared::counts::{EncoderCounts, ForceCounts, TorqueCounts};
use painleve_shared::frame::SensorFrame;
use painleve_shared::{Arm, Pose, Posture};
use painleve_study_core::case::{ControllerChoice, at_rest_on_belt};
use painleve_study_quality::distribution::Percentiles;
use painleve_study_quality::effects::{Contact, EffectsStudy};
use painleve_study_quality::proportion::Proportion;
use painleve_study_quality::robustness::{self, Criterion, Ending, Row};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const FIRST_SEED: u64 = 7_003_000;

/// Closed loops of each arm.
const LOOPS: usize = 3;

/// Part of the stages' limits, known to a fifth, that every stage gives: a controller that knows more asks for it in vain.
const SURE_TORQUE: f32 = 0.8;

/// How well the arms are known that [`imperfect`] draws: link 1 has been measured.
fn drawn() -> Drawn {
    Drawn {
        length: 3e-4,
        ..Drawn::default()
    }
}

/// Random belts, references, and all effects of a rig at their typical level, except for those that throw the tip.
fn loops(seed: u64, runs: usize) -> EffectsStudy {
    EffectsStudy {
        controllers: vec![ControllerChoice::Hybrid],
        contacts: vec![Contact::Compliant],
        effects: vec!["everything"],
        levels: vec![1.0],
        seed,
        criterion: Criterion::Kept,
        runs,
        overrides: [
            "effects.push.impulse_ns=[0, 0]",
            "converters.torque.error.pulse_nm=[0, 0]",
        ]
        .map(String::from)
        .to_vec(),
    }
}

fn identified(
    scenario: &Scenario,
    seed: u64,
    mistake: Option<GeometryMistake>,
) -> (Result<Found, String>, SimulatedSlides) {
    identified_on(BuiltInPlant::new, scenario, seed, mistake)
}

fn identified_on<P: Plant>(
    plant_of: PlantOf<P>,
    scenario: &Scenario,
    seed: u64,
    mistake: Option<GeometryMistake>,
) -> (Result<Found, String>, SimulatedSlides<P>) {
    let actual = imperfect(scenario, seed).unwrap();
    let mut rig = SimulatedSlides::on(plant_of, actual, mistake);
    let found = identify_arm(&mut rig, scenario, &drawn()).map_err(|error| match error {
        IdentificationError::Refused(refusal) => refusal.to_string(),
        other => panic!("{other}"),
    });
    (found, rig)
}

/// Sets the tip down anywhere in the stretch that `drive` tells the operator, unless it starts there, or at the best place;
/// returns whether there is such a stretch.
fn set_down(scenario: &mut Scenario, run: usize) -> bool {
    let theta = theta(&scenario.initial.state(&scenario.arm).unwrap());
    let posture = Posture::of(&theta);
    let arm = Arm::new(scenario.arm).unwrap();
    let SetDown { best_m, stretch_m } = SetDown::of(scenario, posture).unwrap();
    let start_m = arm.tip_m(&Pose::new(&theta)).x;
    let there_m = match &stretch_m {
        Some(stretch_m) if stretch_m.contains(&start_m) => start_m,
        Some(stretch_m) => Pcg64::seed_from_u64(run as u64).random_range(stretch_m.clone()),
        None => best_m,
    };
    scenario.initial = at_rest_on_belt(&arm, there_m, posture).unwrap();
    stretch_m.is_some()
}

/// Results of closed loops.
fn describe(name: &str, rows: &[Row]) -> (Proportion, Percentiles) {
    let kept: Vec<&Row> = rows.iter().filter(|row| row.ending.is_kept()).collect();
    let share = Proportion::new(kept.len(), rows.len());
    let error_m = Percentiles::of(kept.iter().map(|row| row.error_m).collect()).unwrap();
    println!(
        "{name}: kept {share}; tip error {:.2} mm median, {:.2} mm 95 %, {:.2} mm 99 %, {:.2} mm at most",
        1e3 * error_m.median,
        1e3 * error_m.p95,
        1e3 * error_m.p99,
        1e3 * error_m.max,
    );
    let resting_m = kept.iter().filter_map(|row| row.resting_error_m).collect();
    if let Some(resting_m) = Percentiles::of(resting_m) {
        println!(
            "  place of {} tips whose reference stands, mean of 0.1 s: off by {:.2} mm median, {:.2} mm 95 %",
            resting_m.count,
            1e3 * resting_m.median,
            1e3 * resting_m.p95,
        );
    }
    let held = kept.iter().filter(|row| row.ending == Ending::AtEdge);
    let to_edge_m = Percentiles::of(held.filter_map(|row| row.to_edge_m).collect());
    println!("  where an edge held it, m before it: {to_edge_m:?}");
    let lost = rows.iter().filter(|row| !row.ending.is_kept());
    for row in lost {
        println!(
            "  {}: {:?} at {:?} s, fault {:?}, μ {:.2}, {:?}",
            row.index, row.ending, row.first_lift_off_s, row.fault, row.mu, row.posture
        );
    }
    (share, error_m)
}

#[test]
#[ignore = "a campaign"]
fn arms_as_bad_as_life_are_identified() {
    for seed in 51_000..51_003 {
        let scenario = Scenario::default();
        let (found, rig) = identified(&scenario, seed, None);
        let Found {
            identified, joints, ..
        } = found.unwrap();
        assert!(identified.off_line_m[1] < 0.1 * identified.off_line_m[0]);
        assert!(identified.place_deviation_m < 6e-4 && rig.time_s < 120.0);
        assert!(rig.largest_force_n < 8.0, "{}", rig.largest_force_n);
        let actual = imperfect(&scenario, seed).unwrap();
        for (name, truth, found) in assert_joints_found(&actual, &joints) {
            let most = match name.split(' ').next() {
                Some("friction" | "stiffness") => 0.1 * truth,
                Some("offset") => 0.01,
                // Newtons, hardly told from the cell's gain where the tip presses evenly.
                Some("zero") => 0.2,
                _ => 0.05,
            };
            assert!(found.deviation < most, "{name}: {truth}, {found:?}");
        }
        let [before_nm, after_nm] = joints.left_over_nm.unwrap();
        assert!(after_nm < 0.2 * before_nm, "{before_nm} {after_nm}");
    }
}

#[test]
#[ignore = "a campaign"]
fn the_belts_tilt_is_as_far_off_as_its_deviation_says() {
    let own = Scenario::load("../../examples/own-arm.toml", &[]).unwrap();
    for scenario in [own, Scenario::default()] {
        let [mut error_square, mut off_square] = [0.0; 2];
        for seed in 1..=16 {
            let actual = imperfect(&scenario, seed).unwrap();
            let error_rad = scenario.arm.belt_tilt_rad - actual.arm.belt_tilt_rad;
            let mut rig = SimulatedSlides::new(actual, None);
            let found = identify_arm(&mut rig, &scenario, &drawn()).unwrap();
            let tilt = found.joints.tilt_rad;
            let error_rad = error_rad + tilt.value;
            error_square += error_rad.powi(2) / 16.0;
            off_square += (error_rad / tilt.deviation).powi(2) / 16.0;
        }
        let [error_rad, off] = [error_square, off_square].map(f64::sqrt);
        println!(
            "{}: {error_rad:.4} rad off, {off:.2} deviations, root mean square",
            scenario.name
        );
        assert!(off < 1.2, "{}: {off}", scenario.name);
    }
}

#[test]
fn a_value_that_is_not_taken_or_that_no_controller_takes_leaves_what_was_known() {
    let scenario = Scenario::default();
    let (found, _) = identified(&scenario, 51_000, None);
    let mut found = found.unwrap();
    let known = found.applied_to(&scenario, "").unwrap();
    found.joints.joints[0].friction_nm = Estimate {
        value: 0.2,
        deviation: 0.3,
    };
    let again = found.applied_to(&known, "").unwrap();
    assert_eq!(again.arm_model, known.arm_model);
    assert_eq!(again.knowledge, known.knowledge);
    let [one_nm, two_nm] = found
        .applied_to(&scenario, "")
        .unwrap()
        .knowledge
        .coulomb_friction_nm;
    assert!(one_nm == 0.0 && two_nm > 0.0, "{one_nm} {two_nm}");
    // Torques that show nothing give estimates of zero with deviations of zero.
    let nothing = Estimate {
        value: 0.0,
        deviation: 0.0,
    };
    found.joints.joints = found.joints.joints.map(|joint| Joint {
        friction_nm: nothing,
        ..joint
    });
    found.joints.left_over_nm = None;
    assert_eq!(
        found.applied_to(&known, "").unwrap().arm_model,
        known.arm_model
    );
    let zero = Parameter::Zero(1);
    found.identified.fit.parameters.set(zero, 0.25);
    let refusal = found.applied_to(&scenario, "").unwrap_err().to_string();
    let expected = "by the slides, controller.estimator.encoders.zero_rad.1 = 0.25 is outside";
    assert!(refusal.starts_with(expected), "{refusal}");
}

/// Simulated arms with the elbow up take more than 1.2 N·m.
#[test]
fn a_torque_limit_that_is_too_low_is_named_before_all_that_follows_from_it() {
    for (limit_nm, seed) in [(0.4, 3), (0.5, 1), (0.6, 2), (0.7, 1), (0.8, 3), (0.9, 2)] {
        let limit = format!("controller.torque_limit_nm={limit_nm}");
        let scenario = Scenario::default()
            .with_overrides("weak", &[limit])
            .unwrap();
        let (found, _) = identified(&scenario, seed, None);
        let refusal = found.map(|_| ()).unwrap_err();
        let expected =
            format!("a torque was at its limit (controller.torque_limit_nm = {limit_nm})");
        assert!(refusal.contains(&expected), "{limit_nm}, {seed}: {refusal}");
    }
}

/// Zeros that are wrong by almost 3° lift a tip that presses with 4 N only.
#[test]
#[ignore = "a long identification"]
fn a_tip_that_is_lifted_presses_more_at_the_next_attempt() {
    let study = loops(7_005_000, 211);
    let scenario = study.scenario(study.cells()[0], 210).unwrap();
    let (found, rig) = identified(&scenario, 7_005_070, None);
    assert_eq!(found.map(|_| ()), Ok(()));
    assert!(rig.largest_force_n < 10.0, "{}", rig.largest_force_n);
}

/// A tip that did not press yet when the drive takes it over would bounce, and then press with 11 N.
#[test]
fn a_tip_rests_on_its_belt_before_it_slides() {
    let study = loops(7_016_000, 450);
    let scenario = study.scenario(study.cells()[0], LOOPS * 59).unwrap();
    let actual = imperfect(&scenario, 7_016_059).unwrap();
    let mut rig = SimulatedSlides::new(actual, None);
    for (index, posture) in [Posture::ElbowDown, Posture::ElbowUp]
        .into_iter()
        .enumerate()
    {
        let slide = slide_scenario(&scenario, 0.2, posture, 4.0).unwrap();
        assert!(rig.slide(index, &slide, posture).unwrap().is_complete);
    }
    assert!(rig.largest_force_n < 7.0, "{}", rig.largest_force_n);
}

/// A rig that ends some of its attempts.
struct Breaking {
    rig: SimulatedSlides,
    break_off: fn(usize, &mut Slid),
    /// Normal force of each attempt, N.
    forces_n: Vec<f32>,
    /// Forces of the attempts that were announced as repeated.
    repeated_n: Vec<f32>,
}

impl SlideRig for Breaking {
    type Error = SimulatedError;

    fn slide(
        &mut self,
        index: usize,
        scenario: &Scenario,
        posture: Posture,
    ) -> Result<Slid, SimulatedError> {
        let mut slid = self.rig.slide(index, scenario, posture)?;
        if let Some(LawSettings::Hybrid(law)) = scenario.controller.law.of_set() {
            self.forces_n.push(law.normal_force_n);
        }
        (self.break_off)(self.forces_n.len(), &mut slid);
        Ok(slid)
    }

    fn repeats(&mut self, _: &Refusal, force_n: f64) {
        self.repeated_n.push(force_n as f32);
    }
}

/// Returns why the arm of a rig is refused; `None` if it is identified.
fn refusal_by<R: SlideRig>(rig: &mut R, scenario: &Scenario) -> Option<Refusal> {
    match identify_arm(rig, scenario, &drawn()) {
        Ok(_) => None,
        Err(IdentificationError::Refused(refusal)) => Some(refusal),
        Err(other) => panic!("{other}"),
    }
}

/// Returns why the arm of such a rig is refused, and the normal force of each attempt, N.
fn broken_off(break_off: fn(usize, &mut Slid)) -> (Option<Refusal>, Vec<f32>) {
    let scenario = Scenario::default();
    let actual = imperfect(&scenario, 51_000).unwrap();
    let mut rig = Breaking {
        rig: SimulatedSlides::new(actual, None),
        break_off,
        forces_n: Vec::new(),
        repeated_n: Vec::new(),
    };
    let refusal = refusal_by(&mut rig, &scenario);
    let harder = rig.forces_n.iter().filter(|force_n| **force_n > 4.0);
    assert!(harder.eq(&rig.repeated_n), "{:?}", rig.repeated_n);
    (refusal, rig.forces_n)
}

/// As after a fault, with the tip on the belt until then.
fn end_early(slid: &mut Slid) {
    slid.ticks.truncate(1200);
    slid.is_complete = false;
}

#[test]
fn a_slide_that_ends_early_is_repeated_and_refused_if_none_is_whole() {
    let (refusal, forces_n) = broken_off(|attempt, slid| {
        if attempt == 1 {
            end_early(slid);
        }
    });
    assert_eq!(refusal, None);
    assert_eq!(forces_n, [4.0, 5.0, 4.0, 4.0, 4.0]);
    let (refusal, forces_n) = broken_off(|_, slid| end_early(slid));
    let Some(Refusal::NotOnBelt { percent, .. }) = refusal else {
        panic!("{refusal:?}");
    };
    assert!(percent < 20.0, "{percent}");
    assert_eq!(forces_n, [4.0, 5.0, 6.0, 4.0, 5.0, 6.0]);
}

/// The tip leaves its belt while the elbow turns at 3 rad/s.
fn throw(slid: &mut Slid) {
    end_early(slid);
    let thrown = turning(3.0, ForceCounts(0), 0..40);
    let lasts = slid.ticks.iter_mut().rev().take(40).rev();
    for (tick, thrown) in lasts.zip(thrown.ticks) {
        let [_, EncoderCounts(elbow)] = &mut tick.sensor.joints;
        *elbow = elbow.wrapping_add(thrown.sensor.joints[1].0) & 0x3fff;
        tick.sensor.normal_force = thrown.sensor.normal_force;
    }
}

#[test]
fn a_tip_that_is_thrown_presses_more_at_the_next_attempt() {
    let (refusal, forces_n) = broken_off(|attempt, slid| {
        if attempt <= 2 {
            throw(slid);
        }
    });
    assert_eq!(refusal, None);
    assert_eq!(forces_n, [4.0, 5.0, 6.0, 4.0, 4.0, 4.0]);
    let (refusal, forces_n) = broken_off(|_, slid| throw(slid));
    let is_fast = matches!(refusal, Some(Refusal::MovedTooFast { slide: 0, .. }));
    assert!(is_fast, "{refusal:?}");
    assert_eq!(forces_n, [4.0, 5.0, 6.0]);
}

/// Changes an arm, and returns why it is refused.
fn refusal_of(change: impl Fn(&mut Scenario)) -> Refusal {
    let scenario = Scenario::default();
    let mut actual = imperfect(&scenario, 51_000).unwrap();
    change(&mut actual);
    let mut rig = SimulatedSlides::new(actual, None);
    refusal_by(&mut rig, &scenario).unwrap()
}

/// The elbow's spring is six times as stiff as the drawing says; then somebody pushes the tip along the belt.
#[test]
fn a_tip_that_presses_too_hard_or_moves_too_fast_ends_the_slide_at_once() {
    let pressed = refusal_of(|actual| actual.arm.stiffness_nm_rad[1] *= 6.0);
    assert!(
        matches!(pressed, Refusal::PressedTooHard { slide: 0, .. }),
        "{pressed}"
    );
    let moved = refusal_of(|actual| {
        actual.effects.push.impulse_ns = [0.5, 0.0];
        actual.effects.push.duration_s = 0.05;
    });
    assert!(
        matches!(moved, Refusal::MovedTooFast { slide: 0, .. }),
        "{moved}"
    );
}

/// A force cell or a stage that is dead, and a spring that nobody told of: the values that the torques show would be wrong.
#[test]
fn torques_that_the_model_does_not_explain_are_refused() {
    let faults = [
        "tangential_force={ kind = 'off', from_s = 0.0, until_s = 1000.0 }",
        "torque_2={ kind = 'off', from_s = 3.0, until_s = 1000.0 }",
    ];
    let dead = faults.map(|fault| {
        refusal_of(|actual| {
            let fault = format!("converters.faults.{fault}");
            *actual = actual.clone().with_overrides("dead", &[fault]).unwrap();
        })
    });
    let untold = refusal_of(|actual| actual.arm.stiffness_nm_rad[0] = 0.8);
    for refusal in dead.into_iter().chain([untold]) {
        assert!(matches!(refusal, Refusal::OtherTorques { .. }), "{refusal}");
    }
}

/// Ticks of an arm whose elbow turns at a rate, with a normal force.
fn turning(rate_rad_s: f64, force: ForceCounts, ticks: impl Iterator<Item = u32>) -> Slid {
    let scale = Scenario::default().converters.scales().encoders[1];
    let tick = |tick: u32| SlideTick {
        sensor: SensorFrame {
            tick,
            joints: [
                EncoderCounts(0),
                scale.reading(rate_rad_s * f64::from(tick) * 1e-3),
            ],
            normal_force: force,
            ..SensorFrame::default()
        },
        ..SlideTick::default()
    };
    Slid {
        ticks: ticks.map(tick).collect(),
        is_complete: false,
    }
}

#[test]
fn a_surprise_lasts_and_is_seen_whatever_ticks_arrive() {
    let scenario = Scenario::default();
    let force = scenario.converters.scales().force;
    let [soft, hard] = [4.0, 18.0].map(|force_n| ForceCounts(force.counts(force_n).0));
    let of = |slid: Slid| slid.surprise(&scenario);
    let is_hard = |slid: Slid| matches!(of(slid), Some(Surprise::PressesTooHard { .. }));
    let is_fast = |slid: Slid| matches!(of(slid), Some(Surprise::MovesTooFast { .. }));
    // A link of 0.2 m or so; the serial line may carry one tick of four.
    for every in [1, 4] {
        let ticks = |count| (0..count).step_by(every);
        assert!(is_hard(turning(0.0, hard, ticks(20))));
        assert!(is_fast(turning(3.0, soft, ticks(40))));
        assert_eq!(of(turning(1.0, soft, ticks(40))), None);
        assert_eq!(of(turning(3.0, hard, ticks(8))), None);
    }
    assert_eq!(of(Slid::default()), None);
    // Two impacts, with the line silent between them.
    assert_eq!(of(turning(0.0, hard, [0, 200].into_iter())), None);
    // What is missing presses on nothing.
    assert_eq!(of(turning(0.0, ForceCounts::MISSING, 0..40)), None);
    // A reading that is wrong seems to throw the tip there and back, and a landing presses for some ticks.
    for wrong in 0..40 {
        let mut slid = turning(1.0, soft, 0..40);
        let sensor = &mut slid.ticks[wrong].sensor;
        sensor.joints[1] = EncoderCounts(sensor.joints[1].0 ^ 0x400);
        sensor.normal_force = hard;
        assert_eq!(of(slid), None, "{wrong}");
    }
}

#[test]
fn longer_and_heavier_arms_are_identified() {
    for overrides in [
        ["arm.link_length_m=[0.5, 0.5]", "arm.height_m=0.9"],
        ["arm.link_mass_kg=[0.5, 0.5]", "belt.friction=0.5"],
    ] {
        let overrides = overrides.map(str::to_owned);
        let scenario = Scenario::default()
            .with_overrides("other", &overrides)
            .unwrap();
        let (found, _) = identified(&scenario, 51_000, None);
        let found = found.unwrap();
        let place_m = found.identified.place_deviation_m;
        assert!(place_m < 0.0025 * scenario.arm.height_m, "{place_m}");
        let friction = scenario.belt.friction;
        assert!(
            (found.friction / friction - 1.0).abs() < 0.08,
            "{}",
            found.friction
        );
    }
}

#[test]
fn slides_keep_the_scenarios_own_gains() {
    let of = |override_of_law: &str| {
        let scenario = Scenario::default()
            .with_overrides("gains", &[override_of_law.to_owned()])
            .unwrap();
        let slide = slide_scenario(&scenario, 0.6, Posture::ElbowDown, 4.5).unwrap();
        match slide.controller.law.of_set() {
            Some(LawSettings::Hybrid(law)) => *law,
            other => panic!("{other:?}"),
        }
    };
    let own = of("controller.law.hybrid.velocity_gain_per_s=117");
    assert_eq!((own.normal_force_n, own.velocity_gain_per_s), (4.5, 117.0));
    assert_eq!(of("controller.law={ pid = {} }").normal_force_n, 4.5);
}

/// A motor leads its joint by the twist of the gear under the torque that the tick before has commanded.
#[test]
fn encoders_on_motors_are_read_without_the_twist_of_the_gears() {
    let soft = "controller.estimator.gear_compliance_rad_nm=[2e-3, 1e-3]".to_owned();
    let scenario = Scenario::default()
        .with_overrides("gears", &[soft])
        .unwrap();
    let newton_metres = f64::from(scenario.converters.scales().torque.per_count());
    let tick = |tick: u32, counts: [i32; 2]| SlideTick {
        sensor: SensorFrame {
            tick,
            ..SensorFrame::default()
        },
        torques: counts.map(TorqueCounts),
    };
    let ticks = [tick(7, [100, -300]), tick(8, [500, 0]), tick(9, [0, 0])];
    let (soft, rigid) = (
        readings(&scenario, ticks),
        readings(&Scenario::default(), ticks),
    );
    // No torque is known from before the first tick: its own stands for it.
    for (index, counts) in [[100, -300], [100, -300], [500, 0]].into_iter().enumerate() {
        for joint in 0..2 {
            let twist_rad = rigid[index].encoders_rad[joint] - soft[index].encoders_rad[joint];
            let expected = [2e-3, 1e-3][joint] * f64::from(counts[joint]) * newton_metres;
            assert!((twist_rad - expected).abs() < 1e-9, "{index}: {twist_rad}");
        }
    }
    let numbers = |readings: &[Reading]| readings.iter().map(|it| it.tick).collect::<Vec<_>>();
    assert_eq!(numbers(&soft), [7, 8, 9]);
    // A torque beyond the stages' range is no torque, and twists no gear.
    let wrong = [
        tick(7, [100, -300]),
        tick(8, [i32::MAX, 0]),
        tick(9, [0, 0]),
    ];
    let soft = readings(&scenario, wrong);
    assert_eq!(numbers(&soft), [7, 9]);
    assert_eq!(soft[1].encoders_rad, rigid[2].encoders_rad);
}

#[test]
fn a_spring_that_rests_elsewhere_is_told_from_one_that_is_stiffer() {
    let scenario = Scenario::default();
    let mut actual = imperfect(&scenario, 51_001).unwrap();
    actual.arm.spring_rest_rad[1] += 0.05;
    let mut rig = SimulatedSlides::new(actual.clone(), None);
    let found = identify_arm(&mut rig, &scenario, &drawn()).unwrap();
    assert_joints_found(&actual, &found.joints);
    let [first, elbow] = found.joints.joints;
    assert!(!first.has_offset() && elbow.has_offset(), "{found:?}");
    let farther_rad = elbow.rest_error_rad().unwrap();
    assert!((farther_rad - 0.05).abs() < 0.01, "{farther_rad}");
}

/// The zeros of both cells have drifted by 5 % of the force in the slides.
#[test]
fn a_force_cell_with_another_zero_does_not_pass_for_one_with_another_gain() {
    let scenario = Scenario::default();
    let mut actual = imperfect(&scenario, 51_002).unwrap();
    actual.converters.force.bias_n = [-0.2, 0.2];
    let mut rig = SimulatedSlides::new(actual.clone(), None);
    let found = identify_arm(&mut rig, &scenario, &drawn()).unwrap();
    assert_joints_found(&actual, &found.joints);
    let [_, normal] = found.joints.cells;
    assert!(normal.gain.deviation < 0.06 && normal.zero_n.deviation < 0.2);
}

/// Joints that turn to and fro show less friction than they have.
#[test]
fn joints_that_vibrate_do_not_pass_for_joints_with_less_friction() {
    // This tip is thrown. Of the arms 51_001 … 51_040 and 52_001 … 52_060 none presses with more than 12.4 N.
    let scenario = Scenario::default();
    let mut actual = imperfect(&scenario, 51_003).unwrap();
    actual.effects.hanging_belt.mass_kg = 0.02;
    actual.effects.surface.vibration_m = 5e-5;
    let mut rig = SimulatedSlides::new(actual.clone(), None);
    let found = identify_arm(&mut rig, &scenario, &drawn()).unwrap();
    let mut joints = joint_truths(&actual, &found.joints);
    // On an arm that is thrown, the cells' cross-talk, and gain and zero of the normal force's, are up to 3.7 deviations off: no
    // verdict rests on them.
    let is_off = |name: &str| name.starts_with("cross-talk") || name.ends_with(" of cell 1");
    joints.retain(|(name, ..)| !is_off(name));
    assert_within_three_deviations(&joints);
    assert!(!found.joints.joints.iter().any(|it| it.has_offset()));
    assert!(rig.largest_force_n < 15.0, "{}", rig.largest_force_n);
}

/// Closed loops: all of them, and those set down where p is large enough.
#[derive(Default)]
struct Judged {
    rows: Vec<Row>,
    with_margin: Vec<Row>,
}

impl Judged {
    /// Sets the tip down and runs a closed loop.
    fn run(&mut self, run: usize, mut scenario: Scenario) {
        let has_margin = set_down(&mut scenario, run);
        let plant = BuiltInPlant::new(&scenario).unwrap();
        let row = robustness::run_on(plant, run, &scenario).unwrap();
        if has_margin {
            self.with_margin.push(row.clone());
        }
        self.rows.push(row);
    }

    /// Prints the results; returns how many of those set down where p is large enough were kept, and the error of all.
    fn describe(&self, name: &str) -> (Proportion, Percentiles) {
        let large_p = format!("{name}, set down where p is large enough");
        let (kept, _) = describe(&large_p, &self.with_margin);
        (kept, describe(name, &self.rows).1)
    }
}

/// Measures with all effects of a rig.
#[test]
#[ignore = "takes minutes"]
fn identified_arms_put_the_tip_where_they_say() {
    let arms = std::env::var("PAINLEVE_ARMS").map_or(10, |arms| arms.parse().unwrap());
    let study = loops(FIRST_SEED, LOOPS * arms);
    let cell = study.cells()[0];
    let (mut by_plumb_line, mut careful) = (Judged::default(), Judged::default());
    let mut identified_arms = Judged::default();
    let (mut refused, mut inside, mut parameters) = (Vec::new(), 0, 0);
    let (mut time_s, mut forces_n) = (0.0_f64, Vec::new());
    for arm in 0..arms {
        let seed = FIRST_SEED + arm as u64;
        let first = study.scenario(cell, LOOPS * arm).unwrap();
        let (found, rig) = identified(&first, seed, None);
        time_s = time_s.max(rig.time_s);
        forces_n.push(rig.largest_force_n);
        for run in LOOPS * arm..LOOPS * (arm + 1) {
            let mut actual = imperfect(&study.scenario(cell, run).unwrap(), seed).unwrap();
            // It throws the tip.
            actual.effects.surface.seam_height_m = 0.0;
            actual.controller.torque_limit_nm *= SURE_TORQUE;
            // As by a plumb line, and by a careful operator, whose zeros are within 1°.
            for (part, judged) in [(1.0, &mut by_plumb_line), (1.0 / 3.0, &mut careful)] {
                let mut told = actual.clone();
                let zero_rad = &mut told.converters.encoder.mounting_error_rad;
                *zero_rad = zero_rad.map(|it| part * it);
                let drawn = Drawn {
                    zero_rad: part * drawn().zero_rad,
                    ..drawn()
                };
                let deviation_m = prior(&actual, &drawn).tip_deviation_m();
                told.controller.estimator.tip_deviation_m = deviation_m as f32;
                judged.run(run, told);
            }
            if let Ok(found) = &found {
                identified_arms.run(run, found.applied_to(&actual, "").unwrap());
            }
        }
        match found {
            Err(refusal) => refused.push(format!("{seed}: {refusal}")),
            Ok(found) => {
                let (right, all) = within_deviations(&first, seed, &found);
                inside += right;
                parameters += all;
            }
        }
    }
    println!("{arms} arms, {} refused: {refused:#?}", refused.len());
    println!("within 3 deviations: {inside} of {parameters}; {time_s:.0} s at most");
    forces_n.sort_by(f64::total_cmp);
    println!("largest force of each arm, N: {forces_n:.1?}");
    let (_, before) = by_plumb_line.describe("not identified, margin of a drawing");
    careful.describe("not identified, zeros within 1°");
    let (kept, after) = identified_arms.describe("identified");
    assert!(refused.is_empty() && time_s <= 120.0);
    assert!(100 * inside >= 99 * parameters, "{inside} of {parameters}");
    assert!(kept.rate > 0.9, "{kept}");
    assert!(after.median < 0.2 * before.median, "{after:?} {before:?}");
}

/// Returns how many parameters of an arm lie within three deviations of the truth, and how many there are; prints the others.
fn within_deviations(scenario: &Scenario, seed: u64, found: &Found) -> (usize, usize) {
    let actual = imperfect(scenario, seed).unwrap();
    let fit = &found.identified.fit;
    let of_geometry = truths(&actual).into_iter().map(|(parameter, truth)| {
        let estimate = Estimate {
            value: fit.parameters.get(parameter),
            deviation: fit.deviation(parameter),
        };
        (parameter.to_string(), truth, estimate)
    });
    let (mut inside, mut parameters) = (0, 0);
    for (name, truth, estimate) in of_geometry.chain(joint_truths(&actual, &found.joints)) {
        let error = estimate.value - truth;
        parameters += 1;
        if error.abs() < 3.0 * estimate.deviation {
            inside += 1;
        } else {
            println!("{seed}: {name} off by {error:.2e}, {estimate:?}");
        }
    }
    (inside, parameters)
}

/// Returns what can be compared: the zeros, lengths and the height, of an arm whose encoders' errors are sines.
fn truths(actual: &Scenario) -> Vec<(Parameter, f64)> {
    let encoder = &actual.converters.encoder;
    let [length_1, length_2] = actual.arm.link_length_m;
    let mut truths = vec![
        (Parameter::Length, length_1),
        (Parameter::Ratio, length_2 / length_1),
        (Parameter::Height, actual.arm.height_m),
    ];
    for joint in 0..2 {
        let (once, twice) = (
            encoder.eccentricity_rad[joint],
            encoder.second_harmonic_rad[joint],
        );
        let (sine, cosine) = libm::sincos(encoder.eccentricity_phase_rad[joint]);
        let (second_sine, second_cosine) = libm::sincos(encoder.second_harmonic_phase_rad[joint]);
        // What is added takes the error off.
        truths.extend([
            (Parameter::Zero(joint), -encoder.mounting_error_rad[joint]),
            (Parameter::Sine(joint), -once * cosine),
            (Parameter::Cosine(joint), -once * sine),
            (Parameter::SecondSine(joint), -twice * second_cosine),
            (Parameter::SecondCosine(joint), -twice * second_sine),
        ]);
    }
    truths
}

/// Checks that what the torques show was found within three deviations, and returns it.
fn assert_joints_found(actual: &Scenario, found: &Joints) -> Vec<(String, f64, Estimate)> {
    let joints = joint_truths(actual, found);
    assert_within_three_deviations(&joints);
    joints
}

fn assert_within_three_deviations(joints: &[(String, f64, Estimate)]) {
    for (name, truth, found) in joints {
        let error = found.value - truth;
        assert!(
            error.abs() < 3.0 * found.deviation,
            "{name}: {truth}, {found:?}"
        );
    }
}

/// Returns what the torques show of joints, stages and force cells, with what was found.
fn joint_truths(actual: &Scenario, found: &Joints) -> Vec<(String, f64, Estimate)> {
    let mut truths = Vec::new();
    for (index, joint) in found.joints.iter().enumerate() {
        let gain = 1.0 + actual.converters.torque.error.gain[index];
        truths.push((format!("gain of stage {index}"), gain, joint.gain));
        let commanded = 1.0 / gain;
        let friction_nm = commanded * actual.effects.joints.coulomb_nm;
        truths.push((format!("friction {index}"), friction_nm, joint.friction_nm));
        let stiffness_nm_rad = commanded * actual.arm.stiffness_nm_rad[index];
        let told_rad = actual.arm_model.unwrap().spring_rest_rad[index];
        let farther_rad = actual.arm.spring_rest_rad[index] - f64::from(told_rad);
        let offset_nm = -stiffness_nm_rad * farther_rad;
        truths.push((format!("offset {index}"), offset_nm, joint.offset_nm));
        if stiffness_nm_rad > 0.0 {
            let name = format!("stiffness {index}");
            truths.push((name, stiffness_nm_rad, joint.stiffness_nm_rad));
        }
    }
    let told_rad = f64::from(actual.arm_model.unwrap().belt_tilt_rad);
    let tilt_rad = actual.arm.belt_tilt_rad - told_rad;
    truths.push(("tilt".into(), tilt_rad, found.tilt_rad));
    let force = &actual.converters.force;
    for (index, cell) in found.cells.iter().enumerate() {
        let gain = 1.0 + force.gain_error[index];
        truths.push((format!("gain of cell {index}"), gain, cell.gain));
        let name = format!("cross-talk into cell {index}");
        truths.push((name, force.cross_talk[index], cell.cross_talk));
        let name = format!("zero of cell {index}");
        truths.push((name, force.bias_n[index], cell.zero_n));
    }
    truths
}

#[test]
fn mistakes_are_refused_with_their_reason() {
    for mistake in GeometryMistake::ALL {
        let expected = match mistake {
            GeometryMistake::SlippingMagnet => "encoder of the elbow: slipped",
            GeometryMistake::BentLink | GeometryMistake::WrongLength => "is known beforehand",
            GeometryMistake::SamePosture => "not as told",
            GeometryMistake::EncodersSwapped => "encoders: exchanged",
            GeometryMistake::TipInAir => "does not touch the belt",
            GeometryMistake::TipOnFrame => "as on a surface that stands still",
            GeometryMistake::BeltReversed => "as if the belt ran in the other direction",
        };
        let refusal = |friction: f64| {
            let mut scenario = Scenario::default();
            scenario.belt.friction = friction;
            let (found, _) = identified(&scenario, 7_002_000, Some(*mistake));
            found.map(|_| ()).unwrap_err()
        };
        let name = mistake.name();
        let of_slide = refusal(0.6);
        assert!(of_slide.contains(expected), "{name}: {of_slide}");
        // The tip is thrown, and its slide ends before it turns back: what stands still may as well run backwards.
        let expected = match mistake {
            GeometryMistake::TipOnFrame | GeometryMistake::BeltReversed => {
                "friction pushes the tip in the belt's direction"
            }
            _ => expected,
        };
        let of_thrown = refusal(0.9);
        assert!(of_thrown.contains(expected), "{name}: {of_thrown}");
    }
}
