//! The paradox lies where the paper shows it, and the lines are exact.

use painleve_shared::Posture;

use super::*;

fn maps_of(settings: &RegionsStudy) -> Result<Regions, StudyError> {
    settings.check()?;
    Ok(Regions::new(
        settings,
        painleve_study_core::rows(settings, || ())?,
    ))
}

fn settings() -> RegionsStudy {
    RegionsStudy {
        arm: ArmParameters::default(),
        mu: 0.6,
        theta1_deg: "-37:37:0.5".parse().unwrap(),
        theta1_dot_rad_s: "-8:8:0.5".parse().unwrap(),
        theta2: vec![Theta2::Positive, Theta2::Negative],
        slips: vec![Slip::Positive, Slip::Negative],
    }
}

#[test]
fn the_paradox_is_where_the_paper_has_it() {
    let regions = maps_of(&settings()).unwrap();
    let [map, other_slip, _, mirrored] = &regions.maps[..] else {
        panic!("four maps");
    };
    // Elbow up at z_t = 0.18269 m and elbow down at 0.16470 m, see Table II.
    let arm = Arm::new(ArmParameters::default()).unwrap();
    let theta1 = |tip: f64, posture| {
        arm.link_angles_on_belt_rad(tip, posture)
            .unwrap()
            .first()
            .to_degrees()
    };
    let expected = [
        theta1(0.182_685_924_513_854_5, Posture::ElbowUp),
        theta1(0.164_704_566_326_326_77, Posture::ElbowDown),
    ];
    assert_eq!(map.p_zero_theta1_deg.len(), 2);
    for (zero, expected) in map.p_zero_theta1_deg.iter().zip(expected) {
        assert!((zero - expected).abs() < 1e-9, "{zero} {expected}");
    }
    assert!(other_slip.p_zero_theta1_deg.is_empty());
    assert_eq!(other_slip.inconsistent, 0.0);
    // p has a mirror image.
    let zeros: Vec<f64> = mirrored
        .p_zero_theta1_deg
        .iter()
        .rev()
        .map(|zero| -zero)
        .collect();
    for (zero, mirrored) in map.p_zero_theta1_deg.iter().zip(zeros) {
        assert!((zero - mirrored).abs() < 1e-9);
    }
    // x0,a starts inconsistent.
    let start = map
        .cells
        .iter()
        .find(|cell| cell.theta1_deg == 32.0 && cell.theta1_dot_rad_s == 0.0);
    assert_eq!(start.unwrap().mode, SolutionMode::Inconsistent);
    assert!(map.inconsistent > 0.0 && map.indeterminate > 0.0);
    let parts = map.sliding + map.flight + map.indeterminate + map.inconsistent;
    assert!((parts - 1.0).abs() < 1e-12);
}

#[test]
fn b_is_zero_on_its_line_and_changes_sign_across() {
    let arm = Arm::new(ArmParameters::default()).unwrap();
    let regions = maps_of(&settings()).unwrap();
    let mut points = 0;
    for map in &regions.maps {
        for &[theta1, rate] in map.b_zero.iter().flatten() {
            let column = RegionColumn::new(&arm, theta1.to_radians(), map.theta2).unwrap();
            let scale = column.b_m_s2(2.0 * rate + 1.0).abs() + column.b_m_s2(0.0).abs();
            assert!(
                column.b_m_s2(rate).abs() < 1e-9 * scale,
                "{theta1} {rate}: {}",
                column.b_m_s2(rate)
            );
            points += 1;
        }
    }
    assert!(points > 1000, "{points}");
}

#[test]
fn a_grid_out_of_reach_of_the_belt_is_refused() {
    let settings = RegionsStudy {
        theta1_deg: "40,50".parse().unwrap(),
        ..settings()
    };
    let error = maps_of(&settings).unwrap_err().to_string();
    assert!(error.contains("below 37.10"), "{error}");
}
