//! Small studies of lift-off, with the governor and without.

use crate::plain;
use painleve_study_core::{Outcome, rows};

use super::*;

#[test]
fn lift_offs_are_counted_and_noticed_with_either_evidence() {
    let study = LiftOff {
        seed: 1,
        runs: 8,
        slide_s: 1.0,
        overrides: Vec::new(),
    };
    let outcome = LiftOffs::new(rows(&study, || ()).unwrap());
    for of in &outcome.evidence {
        assert!(of.lift_offs >= 4, "{}", outcome.table());
        assert!(of.in_time > 0 && of.slid_h > 0.0, "{}", outcome.table());
    }
    assert!(
        outcome
            .rows
            .iter()
            .filter_map(|row| row.noticed_s)
            .all(|time_s| time_s >= 0.0)
    );
}

#[test]
fn with_the_governor_the_tip_stays_on_the_belt() {
    let study = LiftOff {
        seed: 1,
        runs: 2,
        slide_s: 0.5,
        overrides: vec!["controller.governor.enabled=true".into()],
    };
    for row in rows(&study, || ()).unwrap() {
        assert_eq!((row.lift_off_s, row.noticed_s), (None, None), "{row:?}");
    }
}

#[test]
fn runs_that_cannot_be_solved_are_counted_and_all_others_are_kept() {
    let unsolvable = [
        // During its fall, this arm jams at full stretch.
        "belt.friction=0.488",
        "belt.profile={ kind = \"constant\", speed_m_s = 0.0 }",
        "impact={ law = \"poisson\", restitution = 0.0 }",
        "initial.theta1_deg=12.03905122650615",
        "initial.theta2_deg=48.33684166490143",
        "run.enable_at_s=100",
    ];
    let study = LiftOff {
        seed: 1,
        runs: 4,
        slide_s: 0.2,
        overrides: unsolvable.map(String::from).into(),
    };
    let mut found = rows(&study, || ()).unwrap();
    let solvable = LiftOff {
        runs: 1,
        overrides: Vec::new(),
        ..study
    };
    found.extend(rows(&solvable, || ()).unwrap());
    let outcome = LiftOffs::new(found);
    for of in &outcome.evidence {
        assert_eq!((of.unsolved, of.lift_offs), (4, 1), "{}", outcome.table());
    }
}

/// Uses rows made by hand, so that a change of the controller does not change the snapshot.
#[test]
fn the_table_distinguishes_early_late_short_and_missed() {
    let row = |evidence, flight_s: f64, noticed_s: Option<f64>| Row {
        index: 0,
        evidence,
        mu: 0.6,
        v_belt_m_s: -0.4,
        lift_off_s: Some(3.0),
        flight_s: Some(flight_s),
        noticed_s,
        false_alarms: 0,
        slid_s: 720.0,
        solved: true,
    };
    let [cell, encoders] = LiftOff::EVIDENCE;
    let stays_down = Row {
        lift_off_s: None,
        flight_s: None,
        false_alarms: 2,
        ..row(cell, 0.0, None)
    };
    let unsolved = Row {
        solved: false,
        ..row(encoders, 0.1, Some(0.001))
    };
    let rows = vec![
        row(cell, 0.1, Some(0.003)),
        row(cell, 0.1, Some(0.006)),
        row(cell, 0.004, Some(0.002)),
        stays_down,
        row(encoders, 0.1, Some(0.008)),
        row(encoders, 0.02, None),
        unsolved,
    ];
    insta::assert_snapshot!(plain(&LiftOffs::new(rows)));
}

#[test]
fn no_runs_slide_for_no_time() {
    let found = plain(&LiftOffs::new(Vec::new()));
    assert!(!found.contains("-0.00"), "{found}");
}
