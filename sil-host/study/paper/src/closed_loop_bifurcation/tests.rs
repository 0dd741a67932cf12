//! Controllers that keep the tip on the belt, and one that does not.

use painleve_study_core::outcome::Outcome;

use super::*;

fn study(controller: ControllerChoice) -> ClosedLoopBifurcation {
    ClosedLoopBifurcation {
        controllers: vec![controller],
        converters: vec![ConverterChoice::Hardware],
        mu: vec![0.6],
        v_belt_m_s: vec![-0.9, -0.4],
        initial: vec![Initial::D, Initial::U],
        seed: 1,
        reference: Reference::MinimumJerk(1.0),
        target_m: None,
        transient_s: 2.0,
        record_s: 0.5,
        overrides: Vec::new(),
    }
}

#[test]
fn the_hybrid_law_keeps_the_tip_on_the_belt_from_either_posture() {
    let study = study(ControllerChoice::Hybrid);
    study.check().unwrap();
    let rows = painleve_study_core::rows(&study, || ()).unwrap();
    assert_eq!(rows.len(), 4);
    for (row, (speed, initial)) in
        rows.iter()
            .zip([(-0.9, "d"), (-0.9, "u"), (-0.4, "d"), (-0.4, "u")])
    {
        assert_eq!((row.v_belt_m_s, row.initial.as_str()), (speed, initial));
        assert_eq!((row.bouncing, row.lift_offs, row.fault), (false, 0, None));
        assert_eq!(row.contact_fraction, 1.0);
        assert!((row.tip_t_m - row.target_m).abs() < 2e-3, "{row:?}");
    }
}

#[test]
fn lift_offs_are_counted_and_the_rest_of_the_motion_is_recorded() {
    let study = ClosedLoopBifurcation {
        initial: vec![Initial::U],
        ..study(ControllerChoice::Pid)
    };
    let diagram = ClosedLoopDiagram::new(painleve_study_core::rows(&study, || ()).unwrap());
    assert!(
        diagram
            .rows
            .iter()
            .all(|row| row.lift_offs > 0 && row.first_lift_off_s.is_some())
    );
    assert_eq!(diagram.sections.len(), 1);
    assert_eq!(diagram.sections[0].lifted_m_s, [-0.9, -0.4]);
}

#[test]
fn the_papers_result_stands_beside_its_own_case_only() {
    let paper = |study: ClosedLoopBifurcation| study.row(0).unwrap().paper;
    let short = ClosedLoopBifurcation {
        reference: Reference::Step,
        transient_s: 0.1,
        record_s: 0.1,
        ..study(ControllerChoice::Hybrid)
    };
    assert_eq!(paper(short.clone()), Some("never bounces"));
    for other in [
        ClosedLoopBifurcation {
            mu: vec![0.5],
            ..short.clone()
        },
        ClosedLoopBifurcation {
            target_m: Some(0.1),
            ..short.clone()
        },
        ClosedLoopBifurcation {
            initial: vec![Initial::U],
            ..short.clone()
        },
        ClosedLoopBifurcation {
            overrides: vec!["arm.tip_mass_kg=0.01".into()],
            ..short.clone()
        },
        ClosedLoopBifurcation {
            controllers: vec![ControllerChoice::Pid],
            ..short
        },
    ] {
        assert_eq!(paper(other.clone()), None, "{other:?}");
    }
}

#[test]
fn belt_speeds_are_named_from_the_least_to_the_greatest() {
    let row = |v_belt_m_s| Row {
        controller: ControllerChoice::Hybrid,
        converters: ConverterChoice::Hardware,
        mu: 0.6,
        v_belt_m_s,
        initial: "d".into(),
        max_theta1_dot_rad_s: 1.0,
        bouncing: true,
        contact_fraction: 0.5,
        lift_offs: 0,
        first_lift_off_s: None,
        fault: None,
        target_m: 0.1,
        tip_t_m: 0.1,
        paper: None,
    };
    let diagram = ClosedLoopDiagram::new([-0.4, -0.9, 0.2, -0.1].map(row).to_vec());
    let table = diagram.table().to_string();
    assert!(table.contains("4 of 4 (-0.9 … 0.2 m/s)"), "{table}");
    assert!(table.contains("0 of 4"), "{table}");
}

/// From the mirrored start, to the edge that a tip meets on this belt.
#[test]
fn a_belt_in_the_other_direction_has_the_mirrored_target() {
    let study = ClosedLoopBifurcation {
        v_belt_m_s: vec![-0.4, 0.4],
        initial: vec![Initial::D],
        ..study(ControllerChoice::Hybrid)
    };
    let targets = [0, 1].map(|index| study.scenario(index).unwrap().0.target_m);
    assert_eq!(targets, [0.148, -0.148]);
}

#[test]
fn random_starts_are_followed_in_their_own_posture() {
    let study = ClosedLoopBifurcation {
        initial: (1..=12).map(Initial::Random).collect(),
        v_belt_m_s: vec![-0.4],
        ..study(ControllerChoice::Hybrid)
    };
    let targets: Vec<f64> = (0..study.len())
        .map(|index| study.scenario(index).unwrap().0.target_m)
        .collect();
    assert!(
        targets.contains(&0.148) && targets.contains(&0.163),
        "{targets:?}"
    );
}

#[test]
fn out_of_range_values_are_reported_before_any_cell_runs() {
    let far = ClosedLoopBifurcation {
        target_m: Some(0.5),
        ..study(ControllerChoice::Hybrid)
    };
    let error = far.check().unwrap_err().to_string();
    assert!(error.contains("--target-m = 0.5"), "{error}");
    let fast = ClosedLoopBifurcation {
        v_belt_m_s: vec![1e9],
        ..study(ControllerChoice::Hybrid)
    };
    assert!(
        fast.check().unwrap_err().to_string().contains("belt."),
        "{:?}",
        fast.check()
    );
}

#[test]
fn a_target_out_of_reach_of_ones_own_arm_is_refused_by_the_option_that_sets_it() {
    let short = ClosedLoopBifurcation {
        overrides: vec![
            "arm.link_length_m=[0.1,0.1]".into(),
            "arm.height_m=0.15".into(),
        ],
        ..study(ControllerChoice::Hybrid)
    };
    let error = short.row(0).unwrap_err().to_string();
    assert!(
        error.starts_with("--target-m = 0.148 is outside"),
        "{error}"
    );
}
