//! Small studies of capture, with torque and without.

use super::*;
use crate::study::{Outcome, rows};

#[test]
fn bouncing_arms_are_caught_alike_on_any_number_of_threads() {
    let study = Capture {
        seed: 1,
        runs: 6,
        overrides: Vec::new(),
    };
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| rows(&study, || ()).unwrap())
    };
    let found = on(1);
    assert_eq!(found, on(2));
    let captures = Captures::new(found);
    assert!(captures.success.successes >= 5, "{}", captures.table());
    assert!(captures.rows.iter().any(|row| row.capture_s > 0.0));
}

#[test]
fn an_arm_without_torque_is_not_caught() {
    let study = Capture {
        seed: 1,
        runs: 1,
        overrides: vec!["controller.torque_limit_nm=0".into()],
    };
    let row = study.row(0).unwrap();
    assert!(!row.success && row.capture_s > LIMIT_S, "{row:?}");
}

#[test]
fn a_run_that_cannot_be_solved_is_counted_and_none_of_the_others_is_lost() {
    let unsolvable = [
        "belt.friction=10",
        "arm.stiffness_nm_rad=189.7",
        "arm.damping_nms_rad=10",
        "initial.theta1_deg=28.0864",
        "initial.theta2_deg=-24.0783",
        "solver.chatter_speed_m_s=1e-8",
    ];
    let study = Capture {
        seed: 1,
        runs: 1,
        overrides: unsolvable.map(String::from).into(),
    };
    let mut rows = rows(&study, || ()).unwrap();
    assert!(!rows[0].solved && !rows[0].success, "{rows:?}");
    let caught = Row {
        solved: true,
        success: true,
        capture_s: 0.2,
        ..rows[0].clone()
    };
    rows.push(caught);
    let captures = Captures::new(rows);
    assert_eq!((captures.unsolved, captures.success.successes), (1, 1));
    assert_eq!(captures.capture_s.map(|times| times.count), Some(1));
}
