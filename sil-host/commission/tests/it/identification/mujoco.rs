//! Arms whose mechanics and contact are MuJoCo's are identified, and then slide in closed loops.
//!
//! `PAINLEVE_ARMS=20 cargo test --profile verify -p painleve-commission --test it -- --ignored --nocapture arms_in_mujoco`
//! prints the figures of the lab book.

use nalgebra::Vector2;
use painleve_commission::simulated::{PlantOf, imperfect};
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::mechanics::motion::theta;
use painleve_plant::scenario::{InitialState, Scenario};
use painleve_plant::{Plant, Snapshot};
use painleve_shared::{Arm, GeneralisedTorque, JointTorque, LinkMotion, Pose};
use painleve_study_quality::distribution::Percentiles;
use painleve_study_quality::proportion::Proportion;
use painleve_study_quality::robustness;

use super::campaigns::{SURE_TORQUE, describe, loops};
use super::mujoco_arm::{MujocoArm, python};
use super::{identified_on, within_deviations};

const FIRST_SEED: u64 = 7_004_000;

/// The bar: largest tip error of 95 % of the arms, m, and least part of the loops that keep the tip.
const ERROR_M: f64 = 7e-4;
const KEPT: f64 = 0.95;

/// Identifies arms and runs one closed loop of each; returns those kept, and the errors of their tips.
fn identified_arms(plant_of: PlantOf<MujocoArm>) -> (Proportion, Percentiles) {
    let arms = std::env::var("PAINLEVE_ARMS").map_or(2, |arms| arms.parse().unwrap());
    let study = loops(FIRST_SEED, arms);
    let cell = study.cells()[0];
    let (mut rows, mut refused, mut forces_n) = (Vec::new(), Vec::new(), Vec::new());
    let (mut inside, mut parameters) = (0, 0);
    for arm in 0..arms {
        let seed = FIRST_SEED + arm as u64;
        let scenario = study.scenario(cell, arm).unwrap();
        let (found, rig) = identified_on(plant_of, &scenario, seed, None);
        forces_n.push(rig.largest_force_n);
        let found = match found {
            Ok(found) => found,
            Err(refusal) => {
                refused.push(format!("{seed}: {refusal}"));
                continue;
            }
        };
        let (right, all) = within_deviations(&scenario, seed, &found);
        inside += right;
        parameters += all;
        let mut actual = imperfect(&scenario, seed).unwrap();
        actual.controller.torque_limit_nm *= SURE_TORQUE;
        let known = found.applied_to(&actual, "").unwrap();
        let row = robustness::run_on(plant_of(&known).unwrap(), arm, &known).unwrap();
        println!(
            "{seed}: {:?}, {:.2} mm off, {:.1} N at most in slides of {:.0} s",
            row.ending,
            1e3 * row.error_m,
            rig.largest_force_n,
            rig.time_s
        );
        rows.push(row);
    }
    println!("{arms} arms, {} refused: {refused:#?}", refused.len());
    println!("within 3 deviations: {inside} of {parameters}");
    forces_n.sort_by(f64::total_cmp);
    println!("largest force of each arm, N: {forces_n:.1?}");
    assert!(100 * inside >= 99 * parameters, "{inside} of {parameters}");
    let (kept, error_m) = describe("identified", &rows);
    // A refused arm is not kept.
    (Proportion::new(kept.successes, arms), error_m)
}

#[test]
#[ignore = "installs MuJoCo and takes minutes"]
fn arms_in_mujoco_are_identified() {
    if python().is_none() {
        return;
    }
    the_arms_move_as_ours();
    let (kept, error_m) = identified_arms(MujocoArm::new);
    assert!(
        error_m.p95 <= ERROR_M && kept.rate >= KEPT,
        "{error_m:?} {kept}"
    );
}

/// An arm whose elbow sticks has p < 0 over much of the belt: its tip swings, however well it is known.
#[test]
#[ignore = "installs MuJoCo and takes minutes"]
fn arms_in_mujoco_whose_joints_do_not_bend_are_identified() {
    if python().is_some() {
        identified_arms(MujocoArm::without_bristles);
    }
}

/// The same torques move MuJoCo's arm and ours alike: in the air, with and without friction of the joints, and on the belt.
fn the_arms_move_as_ours() {
    for seed in FIRST_SEED..FIRST_SEED + 3 {
        let mut actual = imperfect(&Scenario::default(), seed).unwrap();
        actual.effects.surface = Default::default();
        actual.effects.joints.static_ratio = 1.0;
        let in_air = Scenario {
            initial: InitialState::at_rest(50.0, 70.0),
            ..actual.clone()
        };
        let without = |mut scenario: Scenario| {
            scenario.effects.joints.coulomb_nm = 0.0;
            scenario
        };
        let swing = |force_n, swing_nm| Torques { force_n, swing_nm };
        // Friction takes 90 mrad off.
        swing(0.0, 0.3).both_after(0.06, &in_air, 2e-4);
        swing(0.0, 0.1).both_after(0.3, &without(in_air), 2e-4);
        let (ours, theirs) = swing(4.0, 0.02).both_after(0.2, &without(actual), 1e-4);
        assert!((ours.normal_force_n - theirs.normal_force_n).abs() < 0.01);
        assert!((ours.tangential_force_n - theirs.tangential_force_n).abs() < 0.01);
        assert!(ours.normal_force_n > 3.0, "{ours:?}");
    }
}

/// Torques that hold the start of an arm with a normal force and its friction, and a swing on top.
struct Torques {
    force_n: f64,
    swing_nm: f64,
}

impl Torques {
    /// Returns our arm and MuJoCo's after some time, whose angles must agree.
    fn both_after(
        &self,
        duration_s: f64,
        scenario: &Scenario,
        within_rad: f64,
    ) -> (Snapshot, Snapshot) {
        let arm = Arm::new(scenario.arm).unwrap();
        let start = theta(&scenario.initial.state(&scenario.arm).unwrap());
        let pose = Pose::new(&start);
        let slip = scenario.slip_at_rest();
        let friction_n = -scenario.belt.friction * slip.sign::<f64>() * self.force_n;
        let load_nm = arm.passive_torque_nm(&start, &LinkMotion::zeros(), &pose);
        let held_nm = arm.jacobian(&pose).transpose() * Vector2::new(friction_n, self.force_n);
        let hold_nm = (load_nm - GeneralisedTorque::from_vector(held_nm)).to_joints();
        let ours = self.after(duration_s, BuiltInPlant::new(scenario).unwrap(), hold_nm);
        let theirs = self.after(duration_s, MujocoArm::new(scenario).unwrap(), hold_nm);
        let error_rad = (ours.theta_rad - theirs.theta_rad).amax();
        assert!(error_rad < within_rad, "{error_rad} {ours:?} {theirs:?}");
        (ours, theirs)
    }

    fn after(&self, duration_s: f64, mut plant: impl Plant, hold_nm: JointTorque<f64>) -> Snapshot {
        for tick in 0..(duration_s * 1e3) as u32 {
            let swing_nm = self.swing_nm * libm::sin(20.0 * plant.time_s());
            plant.command_torque(hold_nm + JointTorque::new(swing_nm, -swing_nm), 0.0);
            plant.advance(f64::from(tick + 1) * 1e-3, &mut ()).unwrap();
        }
        plant.snapshot()
    }
}
