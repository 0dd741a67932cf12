//! Convergence to the rigid plant as the stiffness grows.

use super::*;

fn study() -> Stiffness {
    Stiffness {
        parameters: PlantParameters::default(),
        stiffnesses_n_m: vec![1e4, 1e5, 1e6, 1e7],
        v_belt: Grid::of(-0.4),
        transient_s: 2.0,
        record_s: 1.0,
    }
}

#[test]
fn the_inconsistent_start_goes_to_the_impact_without_collision() {
    let study = study();
    let (rigid, _) = study.first_contact(None).unwrap();
    assert!(rigid.impulse_ns > 0.0 && rigid.throw_m_s > 0.0, "{rigid:?}");
    let contacts = study.stiffnesses_n_m.iter().map(|&stiffness| {
        let (contact, _) = study.first_contact(Some(stiffness)).unwrap();
        (contact.contact_s, contact.impulse_ns, contact.slip_m_s)
    });
    let contacts: Vec<_> = contacts.collect();
    for pair in contacts.windows(2) {
        // The contact gets shorter, and its impulse nears that of the impact.
        assert!(pair[1].0 < 0.7 * pair[0].0, "{contacts:?}");
    }
    let last = contacts.last().unwrap();
    assert!(
        (last.1 / rigid.impulse_ns - 1.0).abs() < 0.2,
        "{contacts:?} {rigid:?}"
    );
}

#[test]
fn a_slide_goes_to_the_rigid_plants() {
    let study = study();
    let deviations = study
        .stiffnesses_n_m
        .iter()
        .map(|&stiffness| study.deviation_rad(Some(stiffness)).unwrap());
    let deviations: Vec<f64> = deviations.collect();
    for pair in deviations.windows(2).take(2) {
        assert!(pair[1] < 0.5 * pair[0], "{deviations:?}");
    }
    assert_eq!(study.deviation_rad(None).unwrap(), 0.0);
}

#[test]
fn the_end_of_the_belt_goes_to_where_p_is_zero() {
    let study = study();
    let arm = painleve_shared::Arm::new(study.parameters.arm).unwrap();
    for posture in [Posture::ElbowUp, Posture::ElbowDown] {
        let line = painleve_plant::belt_line::BeltLine::new(&arm, posture);
        let p = |tip_t_m: f64| {
            let tau = line.tau(tip_t_m).unwrap();
            line.p_per_kg(
                tau,
                study.parameters.friction,
                painleve_shared::Slip::Positive,
            )
        };
        let rigid_m = study.edge_m(None, posture).unwrap();
        assert!(
            p(rigid_m - 2e-5) > 0.0 && p(rigid_m + 2e-5) < 0.0,
            "{rigid_m}"
        );
        // The load comes at once: on a soft belt the tip moves before the contact carries it.
        let short_m = study.stiffnesses_n_m.iter().map(|&stiffness| {
            let edge_m = study.edge_m(Some(stiffness), posture).unwrap();
            (rigid_m - edge_m).abs()
        });
        let short_m: Vec<f64> = short_m.collect();
        assert!(short_m.is_sorted_by(|one, next| next < one), "{short_m:?}");
        assert!(
            short_m.iter().all(|&short_m| short_m < 0.012),
            "{short_m:?}"
        );
    }
}
