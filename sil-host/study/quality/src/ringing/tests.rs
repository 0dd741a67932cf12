//! The limit against the roots of the characteristic polynomial, and one measured onset against the limit.

use nalgebra::Matrix3;
use proptest::prelude::*;

use super::*;

/// Returns whether s³ + (λ + c p) s² + (k p + c Q22 λ) s + k Q22 λ has a root with a positive real part.
fn is_unstable(contact: &ContactAtPlace, rate: f64) -> bool {
    let ContactAtPlace {
        stiffness_n_m: k,
        damping_ns_m: c,
        p_per_kg: p,
        q22_per_kg: q22,
    } = *contact;
    let companion = Matrix3::new(
        -(rate + c * p),
        -(k * p + c * q22 * rate),
        -k * q22 * rate,
        1.0,
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
    );
    companion
        .complex_eigenvalues()
        .iter()
        .any(|root| root.re > 0.0)
}

proptest! {
    #[test]
    fn the_limit_is_where_a_root_crosses_the_imaginary_axis(
        stiffness_n_m in 1e4..1e7_f64, damping_ns_m in 5.0..500.0_f64,
        q22_per_kg in 2.0..50.0_f64, p_ratio in 0.02..1.5_f64,
    ) {
        let contact = ContactAtPlace {
            stiffness_n_m, damping_ns_m, q22_per_kg, p_per_kg: p_ratio * q22_per_kg,
        };
        let largest = contact.largest_rate_per_s();
        if largest.is_finite() {
            prop_assert!(!is_unstable(&contact, 0.98 * largest));
            prop_assert!(is_unstable(&contact, 1.02 * largest));
        } else {
            for rate in [1.0, 30.0, 1e3, 1e5] {
                prop_assert!(!is_unstable(&contact, rate));
            }
        }
    }
}

#[test]
fn the_measured_onset_is_at_the_limit() {
    // Within a second, a slow observer throws the tip off somewhat inside the limit, and the tip may come to rest again.
    for (rate_per_s, most) in [(67.0, 1.1), (10.0, 1.25)] {
        let study = Ringing {
            stiffness_n_m: 1e5,
            dampings_ns_m: vec![76.0],
            rates_per_s: vec![rate_per_s],
            overrides: Vec::new(),
        };
        let row = study.row(0).unwrap();
        let (onset, limit) = (row.onset_p_ratio.unwrap(), row.limit_p_ratio.unwrap());
        assert!(onset > 0.9 * limit && onset < most * limit, "{row:?}");
    }
}

/// The mirror image: with its elbow down, a relaxed spring to the other side, and a belt along +t.
#[test]
fn on_a_belt_along_t_the_mirrored_arm_rings_at_the_same_place() {
    let onset = |overrides: &[&str]| {
        let study = Ringing {
            stiffness_n_m: 1e5,
            dampings_ns_m: vec![76.0],
            rates_per_s: vec![67.0],
            overrides: overrides.iter().map(ToString::to_string).collect(),
        };
        study.check().unwrap();
        study.row(0).unwrap().onset_p_ratio.unwrap()
    };
    let rest = 0.239_459_173_373_622_05;
    let spring = format!("arm.spring_rest_rad=[0, {rest}]");
    let (one, mirrored) = (onset(&[]), onset(&["belt.profile.speed_m_s=0.4", &spring]));
    assert!((one - mirrored).abs() < 0.01 * one, "{one}, {mirrored}");
}
