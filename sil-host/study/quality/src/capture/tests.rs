//! Small studies of capture, with torque and without.

use crate::plain;
use painleve_study_core::{Outcome, rows};

use super::*;

#[test]
fn a_bouncing_arm_is_captured() {
    let study = Capture {
        seed: 1,
        runs: 6,
        overrides: Vec::new(),
    };
    let captures = Captures::new(rows(&study, || ()).unwrap());
    assert!(captures.success.successes >= 5, "{}", captures.table());
    assert!(captures.rows.iter().any(|row| row.capture_s > 0.0));
}

#[test]
fn an_arm_without_torque_is_not_captured() {
    let study = Capture {
        seed: 1,
        runs: 1,
        overrides: vec!["controller.torque_limit_nm=0".into()],
    };
    let row = study.row(0).unwrap();
    assert!(!row.success && row.capture_s > LIMIT_S, "{row:?}");
}

#[test]
fn a_run_that_cannot_be_solved_is_counted_and_all_others_are_kept() {
    let unsolvable = [
        // During its fall, this arm jams at full stretch.
        "belt.friction=0.488",
        "belt.profile={ kind = \"constant\", speed_m_s = 0.0 }",
        "impact={ law = \"poisson\", restitution = 0.0 }",
        "initial.theta1_deg=12.03905122650615",
        "initial.theta2_deg=48.33684166490143",
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

/// Uses rows made by hand, so that a change of the controller does not change the snapshot.
#[test]
fn the_table_names_the_runs_that_failed() {
    let row = |index: usize, capture_s: f64, error_m: f64| Row {
        index,
        enabled_s: 5.0 + 0.125 * index as f64,
        noise_seed: 40 + index as u64,
        capture_s,
        error_m,
        fault: None,
        tip_t_m: 0.12,
        success: capture_s <= LIMIT_S && error_m <= WITHIN_M,
        solved: true,
    };
    let unsolved = Row {
        success: false,
        solved: false,
        ..row(4, 0.05, 0.0)
    };
    let rows = vec![
        row(0, 0.15, 1e-4),
        row(1, 0.25, 2e-4),
        row(2, 0.75, 3e-4),
        row(3, 0.2, 0.005),
        unsolved,
    ];
    insta::assert_snapshot!(plain(&Captures::new(rows)));
}
