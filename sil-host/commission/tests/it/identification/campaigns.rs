//! Many arms as bad as life are identified, and then slide in closed loops.
//!
//! `PAINLEVE_ARMS=100 cargo test --profile verify -p painleve-commission --test it -- --ignored --nocapture` prints the
//! figures of the documentation.

use painleve_commission::identification::{Found, identify_arm, prior};
use painleve_commission::set_down::SetDown;
use painleve_commission::simulated::{SimulatedSlides, imperfect};
use painleve_identify::parameters::Drawn;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::Scenario;
use painleve_shared::{Arm, Pose, Posture};
use painleve_study_core::case::{ControllerChoice, at_rest_on_belt};
use painleve_study_quality::distribution::Percentiles;
use painleve_study_quality::effects::{Contact, EffectsStudy};
use painleve_study_quality::proportion::Proportion;
use painleve_study_quality::robustness::{self, Criterion, Ending, Row};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::{assert_joints_found, drawn, identified, within_deviations};

const FIRST_SEED: u64 = 7_003_000;

/// Closed loops of each arm.
pub(super) const LOOPS: usize = 3;

/// Part of the stages' limits, known to a fifth, that every stage gives: a controller that knows more asks for it in vain.
pub(super) const SURE_TORQUE: f32 = 0.8;

/// Random belts, references, and all effects of a rig at their typical level, except for those that throw the tip.
pub(super) fn loops(seed: u64, runs: usize) -> EffectsStudy {
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
pub(super) fn describe(name: &str, rows: &[Row]) -> (Proportion, Percentiles) {
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
