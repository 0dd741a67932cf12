//! The criterion on maps with known exponents.

use nalgebra::{Matrix2, SVector, Vector1, Vector2};

use super::tangent::along;
use super::{Regime, RegimeVerdict, Return, Tangent};

/// Classifies a map by its iterates after a transient.
fn judge_map<const N: usize>(
    start: SVector<f64, N>,
    transient: usize,
    iterations: usize,
    map: impl Fn(&SVector<f64, N>) -> SVector<f64, N>,
) -> RegimeVerdict {
    let mut state = (0..transient).fold(start, |state, _| map(&state));
    let mut tangent = Tangent::default();
    let returns: Vec<Return<N>> = (0..iterations)
        .map(|iteration| {
            tangent.carry(|direction| along(&state, direction, &map));
            state = map(&state);
            Return {
                time_s: iteration as f64,
                state,
                log_growth: tangent.take_log_growth(),
            }
        })
        .collect();
    RegimeVerdict::of(&returns)
}

fn logistic(r: f64, iterations: usize) -> RegimeVerdict {
    judge_map(Vector1::new(0.3), 10_000, iterations, |x| {
        Vector1::new(r * x.x * (1.0 - x.x))
    })
}

/// ln 2 at r = 4 (Ulam and von Neumann).
#[test]
fn the_logistic_map_at_4_is_chaotic_with_exponent_ln_2() {
    let verdict = logistic(4.0, 20_000);
    assert_eq!(verdict.regime, Regime::Chaotic);
    let (exponent, error) = (
        verdict.exponent_per_s.unwrap(),
        verdict.standard_error_per_s.unwrap(),
    );
    assert!((exponent - 2.0_f64.ln()).abs() < 0.01, "{exponent}");
    assert!(error < 0.01 && (exponent - 2.0_f64.ln()).abs() < 4.0 * error);
}

/// At r = 3.2 the multiplier of the 2-cycle is 4 + 2r − r² = 0.16; at r = 1 + √5 it is 0.
#[test]
fn the_logistic_maps_2_cycle_has_the_exponent_of_its_multiplier() {
    let verdict = logistic(3.2, 400);
    assert_eq!(
        (verdict.regime, verdict.period),
        (Regime::Periodic, Some(2))
    );
    let expected = 0.5 * 0.16_f64.ln();
    assert!(
        (verdict.exponent_per_s.unwrap() - expected).abs() < 1e-6,
        "{verdict:?}"
    );
}

/// Period doublings at r = 3, 3.4495, 3.5441, 3.5644 …, chaos from 3.5699, the window of period 3 from
/// 1 + √8 = 3.8284.
#[test]
fn the_logistic_maps_cascade_and_windows_are_classified() {
    for (r, regime, period) in [
        (2.9, Regime::Periodic, Some(1)),
        (3.4, Regime::Periodic, Some(2)),
        (3.5, Regime::Periodic, Some(4)),
        (3.55, Regime::Periodic, Some(8)),
        (3.565, Regime::Periodic, Some(16)),
        (3.7, Regime::Chaotic, None),
        (3.83, Regime::Periodic, Some(3)),
        (3.9, Regime::Chaotic, None),
    ] {
        let verdict = logistic(r, 2000);
        assert_eq!(
            (verdict.regime, verdict.period),
            (regime, period),
            "r = {r}: {verdict:?}"
        );
    }
}

/// At a period doubling the exponent is zero, and the verdict must be undecided.
#[test]
fn at_a_bifurcation_the_verdict_is_undecided() {
    assert_eq!(logistic(3.0, 400).regime, Regime::Undecided);
}

/// 0.41922 for a = 1.4, b = 0.3 (Sprott, *Chaos and Time-Series Analysis*).
#[test]
fn the_henon_map_has_its_exponent() {
    let verdict = judge_map(Vector2::new(0.1, 0.1), 1000, 50_000, |x| {
        Vector2::new(1.0 - 1.4 * x.x * x.x + x.y, 0.3 * x.x)
    });
    assert_eq!(verdict.regime, Regime::Chaotic);
    assert!(
        (verdict.exponent_per_s.unwrap() - 0.419_22).abs() < 0.01,
        "{verdict:?}"
    );
}

/// A rotation by an irrational angle neither recurs nor amplifies or damps deviations.
#[test]
fn a_rotation_is_undecided() {
    let (sine, cosine) = 1.0_f64.sin_cos();
    let rotation = Matrix2::new(cosine, -sine, sine, cosine);
    let verdict = judge_map(Vector2::new(1.0, 0.0), 0, 2000, |x| rotation * x);
    assert_eq!(verdict.regime, Regime::Undecided, "{verdict:?}");
}

#[test]
fn vanishing_deviations_are_periodic_with_exponent_minus_infinity() {
    let verdict = judge_map(Vector1::new(0.3), 10, 100, |_| Vector1::new(0.7));
    assert_eq!(
        (verdict.regime, verdict.period),
        (Regime::Periodic, Some(1))
    );
    assert_eq!(verdict.exponent_per_s, Some(f64::NEG_INFINITY));
}

#[test]
fn too_few_returns_are_undecided_and_none_are_quiet() {
    assert_eq!(logistic(4.0, 30).regime, Regime::Undecided);
    assert_eq!(RegimeVerdict::of::<1>(&[]).regime, Regime::Quiet);
}
