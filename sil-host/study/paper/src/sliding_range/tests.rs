//! Sliding ranges whose ends are known or sharp.

use super::*;

fn study(controller: ControllerChoice, posture: Posture) -> SlidingRange {
    SlidingRange {
        controllers: vec![controller],
        converters: vec![ConverterChoice::Hardware],
        postures: vec![posture],
        mu: vec![0.6],
        references: vec![Reference::MinimumJerk(3.0)],
        overrides: Vec::new(),
        criterion: Criterion {
            scan_step_m: 0.05,
            resolution_m: 2e-3,
            ..Criterion::default()
        },
    }
}

#[test]
fn the_hybrid_law_goes_farther_than_in_the_paper_and_the_pid_lifts_off_elbow_up() {
    let far = study(ControllerChoice::Hybrid, Posture::ElbowDown)
        .row(0)
        .unwrap();
    assert!(far.z_sliding_m.unwrap() > 0.16, "{far:?}");
    assert!((far.limit_m - 0.164_705).abs() < 1e-6);
    assert!((far.z_sliding_m.unwrap() - far.tip_t_m.unwrap()).abs() < 1e-3);
    assert_eq!(far.paper_m, Some(0.148));
    let up = study(ControllerChoice::Pid, Posture::ElbowUp)
        .row(0)
        .unwrap();
    assert_eq!((up.z_sliding_m, up.ends_by), (None, RangeEnd::LiftOff));
    assert_eq!(up.paper_m, None);
}

/// A run bounces twice before the tip is captured, and reaches the same target.
#[test]
fn on_a_compliant_contact_bounces_before_the_capture_do_not_end_the_range() {
    let mut study = study(ControllerChoice::Hybrid, Posture::ElbowDown);
    study.overrides = vec!["contact.kind='compliant'".into()];
    let row = study.row(0).unwrap();
    assert!(
        row.z_sliding_m.is_some_and(|reached_m| reached_m > 0.16),
        "{row:?}"
    );
}

/// The paper's arm is symmetric: its mirror image has the other posture, slip and direction.
#[test]
fn on_a_belt_that_runs_the_other_way_the_tip_slides_the_other_way() {
    let mut study = study(ControllerChoice::Hybrid, Posture::ElbowUp);
    study.overrides = vec!["belt.profile={kind='constant',speed_m_s=0.4}".into()];
    let row = study.row(0).unwrap();
    assert!(row.start_m > 0.16, "{row:?}");
    assert!((row.limit_m + 0.164_705).abs() < 1e-6, "{row:?}");
    let case = study.case(0).unwrap();
    assert_eq!(case.limit_m(row.start_m).unwrap().1, RangeEnd::Limit);
    assert!(row.z_sliding_m.unwrap() < -0.16, "{row:?}");
}

/// Without friction p > 0 as far as the arm reaches.
#[test]
fn a_range_that_no_edge_limits_ends_with_the_reach() {
    let mut study = study(ControllerChoice::Hybrid, Posture::ElbowDown);
    study.mu = vec![0.05];
    let row = study.row(0).unwrap();
    assert!((row.limit_m - 0.184_103).abs() < 1e-5, "{row:?}");
    let case = study.case(0).unwrap();
    assert_eq!(case.limit_m(row.start_m).unwrap().1, RangeEnd::Reach);
}

/// Unequal links, offset centres of mass, a tip mass, a tilted belt.
#[test]
fn a_user_defined_arm_slides_to_its_own_edge_in_both_postures() {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../examples/own-arm.toml"
    );
    for posture in [Posture::ElbowDown, Posture::ElbowUp] {
        let mut study = study(ControllerChoice::Scenario(file.into()), posture);
        study.converters = vec![ConverterChoice::Own];
        let row = study.row(0).unwrap();
        // Farther than the full reach of the paper's arm.
        assert!(row.limit_m > 0.2, "{row:?}");
        assert!(row.z_sliding_m.unwrap() >= 0.98 * row.limit_m, "{row:?}");
    }
}

#[test]
fn the_range_ends_where_the_next_target_fails() {
    let mut study = study(ControllerChoice::Pid, Posture::ElbowDown);
    // The step of speed at the start of a fast ramp throws the tip off.
    study.references = vec![Reference::Ramp(2.0)];
    let row = study.row(0).unwrap();
    assert_eq!(row.ends_by, RangeEnd::LiftOff);
    let case = study.case(0).unwrap();
    let end = row.z_sliding_m.unwrap();
    assert!(matches!(
        case.run(end, &BuiltInPlant::new).unwrap(),
        Trialled::Reached { .. }
    ));
    let beyond = end + study.criterion.resolution_m;
    let failed = case.run(beyond, &BuiltInPlant::new).unwrap();
    assert!(matches!(failed, Trialled::Failed(RangeEnd::LiftOff)));
}

#[test]
fn an_unattainable_tolerance_is_reported_as_not_reached() {
    let mut study = study(ControllerChoice::Hybrid, Posture::ElbowDown);
    study.criterion.within_m = 1e-9;
    study.criterion.patience_s = 2.5;
    study.criterion.scan_step_m = 1.0;
    let row = study.row(0).unwrap();
    assert_eq!((row.z_sliding_m, row.ends_by), (None, RangeEnd::NotReached));
}

#[test]
fn a_controller_that_does_not_reach_the_belt_is_reported_before_any_case_runs() {
    let mut study = study(
        ControllerChoice::Scenario("nothing".into()),
        Posture::ElbowUp,
    );
    assert!(study.check().unwrap_err().to_string().contains("nothing"));
    study.controllers = vec![ControllerChoice::Hybrid];
    study.mu = vec![-1.0];
    let error = study.check().unwrap_err().to_string();
    assert!(error.contains("belt.friction = -1"), "{error}");
}
