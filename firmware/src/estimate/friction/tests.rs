//! Tests of the friction estimate on simulated readings.

use super::*;
use crate::test_readings;
use proptest::prelude::*;

const NOISE_N: f32 = 0.1;

/// Returns uniform noise with that deviation.
fn noise(step: u32) -> f32 {
    3.0_f32.sqrt() * NOISE_N * test_readings::noise(step)
}

/// The settings of a force cell with that noise.
fn cell() -> ContactSettings {
    ContactSettings {
        force_noise_n: NOISE_N,
        ..ContactSettings::default()
    }
}

fn slide(tested: &mut Tested, friction: f32, slip: Slip, ticks: u32) {
    for tick in 0..ticks {
        let force = Vector2::new(-friction * slip.sign::<f32>() * 10.0, 10.0);
        tested.update(&(force + Vector2::new(noise(2 * tick), noise(2 * tick + 1))));
    }
}

/// An estimator with its estimate.
struct Tested {
    estimator: FrictionEstimator,
    estimate: FrictionEstimate,
    /// Whether the tip is dragged along by the belt.
    is_dragged: bool,
}

impl Tested {
    fn new(first_guess: f32) -> Self {
        Self::with(&FrictionSettings {
            first_guess,
            ..Default::default()
        })
    }

    fn with(settings: &FrictionSettings) -> Self {
        Self {
            estimator: FrictionEstimator::new(settings, &cell(), 1e-3),
            estimate: FrictionEstimate::first(settings),
            is_dragged: false,
        }
    }

    fn update(&mut self, force_n: &Vector2<f32>) {
        self.catch_up(force_n);
    }

    /// Updates, and returns what the tick's answer catches up with.
    fn catch_up(&mut self, force_n: &Vector2<f32>) -> f32 {
        let (estimate, is_dragged) = (&mut self.estimate, self.is_dragged);
        self.estimator.correct(estimate, force_n, |_| is_dragged);
        let catch_up = estimate.catch_up;
        self.estimator.update(estimate, force_n);
        catch_up
    }
}

proptest! {
    #[test]
    fn friction_and_slip_are_found_from_a_wrong_guess(
        friction in 0.1_f32..1.2, wrong in 0.7_f32..1.3, positive: bool,
    ) {
        let slip = if positive { Slip::Positive } else { Slip::Negative };
        let mut tested = Tested::new(friction * wrong);
        slide(&mut tested, friction, slip, 100);
        let found = tested.estimate;
        prop_assert_eq!(found.slip, slip);
        prop_assert!((found.coefficient - friction).abs() < 0.01, "{:?}", found);
        prop_assert!((found.coefficient - friction).abs() < 5.0 * found.deviation());
    }
}

#[test]
fn nothing_is_learnt_in_the_air() {
    let mut tested = Tested::new(0.4);
    for tick in 0..1000 {
        tested.update(&Vector2::new(noise(tick), 0.1));
    }
    let found = tested.estimate;
    assert_eq!(found.coefficient, 0.4);
    assert!((found.deviation() - FrictionSettings::default().first_deviation).abs() < 1e-3);
}

#[test]
fn stick_does_not_lower_the_friction_estimate() {
    let mut tested = Tested::new(0.6);
    slide(&mut tested, 0.6, Slip::Positive, 200);
    tested.is_dragged = true;
    slide(&mut tested, 0.1, Slip::Positive, 4000);
    assert!(tested.estimate.sticks);
    assert!((tested.estimate.coefficient - 0.6).abs() < 0.01);
}

#[test]
fn only_friction_near_the_other_side_of_the_cone_reverses_the_slip() {
    let mut tested = Tested::new(0.6);
    slide(&mut tested, 0.6, Slip::Positive, 200);
    tested.is_dragged = true;
    slide(&mut tested, 0.4, Slip::Negative, 100);
    let found = tested.estimate;
    assert!(found.slip == Slip::Positive && found.sticks);
    slide(&mut tested, 0.6, Slip::Negative, 4);
    let found = tested.estimate;
    assert!(found.slip == Slip::Negative && !found.sticks);
}

#[test]
fn ticks_before_a_flight_are_no_part_of_a_row_after_it() {
    let mut tested = Tested::new(0.6);
    slide(&mut tested, 0.6, Slip::Positive, 200);
    tested.is_dragged = true;
    slide(&mut tested, 0.6, Slip::Negative, 2);
    tested.estimator.leave(&mut tested.estimate, None);
    slide(&mut tested, 0.6, Slip::Negative, 1);
    assert_eq!(tested.estimate.slip, Slip::Positive);
}

#[test]
fn a_tip_that_has_left_the_belt_no_longer_sticks() {
    let mut tested = Tested::new(0.6);
    tested.estimate.sticks = true;
    tested.estimator.leave(&mut tested.estimate, None);
    assert!(!tested.estimate.sticks);
}

#[test]
fn less_friction_is_learnt_at_once_unless_the_belt_drags_the_tip() {
    let mut tested = Tested::new(0.6);
    slide(&mut tested, 0.6, Slip::Positive, 2000);
    slide(&mut tested, 0.4, Slip::Positive, 5);
    assert!(!tested.estimate.sticks);
    assert!((tested.estimate.coefficient - 0.4).abs() < 0.02);
}

#[test]
fn less_friction_is_learnt_as_soon_as_the_belt_no_longer_drags_the_tip() {
    let mut tested = Tested::new(0.6);
    slide(&mut tested, 0.6, Slip::Positive, 2000);
    tested.is_dragged = true;
    slide(&mut tested, 0.4, Slip::Positive, 1);
    assert!(tested.estimate.sticks);
    tested.is_dragged = false;
    slide(&mut tested, 0.4, Slip::Positive, 3);
    assert!(!tested.estimate.sticks);
    assert!((tested.estimate.coefficient - 0.4).abs() < 0.02);
}

#[test]
fn friction_that_drifts_is_followed() {
    let mut tested = Tested::new(0.6);
    slide(&mut tested, 0.6, Slip::Positive, 2000);
    for tick in 0..500 {
        let friction = 0.6 + 0.1 * tick as f32 / 500.0;
        slide(&mut tested, friction, Slip::Positive, 1);
    }
    let found = tested.estimate;
    assert!((found.coefficient - 0.7).abs() < 0.03, "{found:?}");
}

#[test]
fn friction_that_varies_like_a_sine_is_followed() {
    let mut tested = Tested::new(0.6);
    let mut square_sum = 0.0;
    for tick in 0..1000_u16 {
        let phase = core::f32::consts::TAU * 4.0 * 1e-3 * f32::from(tick);
        let friction = 0.6 + 0.12 * phase.sin();
        tested.update(&Vector2::new(-10.0 * friction, 10.0));
        if tick >= 500 {
            let error = tested.estimate.coefficient - friction;
            square_sum += error * error;
        }
    }
    let error = (square_sum / 500.0).sqrt();
    assert!(error < 0.01, "{error}");
}

#[test]
fn a_small_rise_of_friction_is_learnt_in_one_tick() {
    let mut tested = Tested::new(0.6);
    let quiet = Vector2::new(-6.0, 10.0);
    (0..2000).for_each(|_| tested.update(&quiet));
    tested.update(&Vector2::new(-6.8, 10.0));
    let found = tested.estimate;
    assert!((found.coefficient - 0.68).abs() < 0.002, "{found:?}");
}

#[test]
fn the_impulse_that_a_sudden_change_has_cost_is_given_back_in_one_tick() {
    let mut tested = Tested::new(0.6);
    let ratio = |ratio: f32| Vector2::new(-10.0 * ratio, 10.0);
    (0..2000).for_each(|_| tested.update(&ratio(0.6)));
    assert_eq!(tested.catch_up(&ratio(0.6)), 0.0);
    for (before, after) in [(0.6, 0.8), (0.8, 0.6)] {
        let found = tested.catch_up(&ratio(after));
        let missed = MISSED_TICKS * (after - before);
        assert!((found - missed).abs() < 0.02 * missed.abs(), "{found}");
        assert!(tested.catch_up(&ratio(after)).abs() < 0.01);
        (0..20).for_each(|_| tested.update(&ratio(after)));
    }
}

#[test]
fn a_change_of_friction_does_not_hide_the_next_one() {
    let mut tested = Tested::new(0.6);
    (0..2000).for_each(|_| tested.update(&Vector2::new(-6.0, 10.0)));
    for step in 0..20_u8 {
        let friction = if step % 2 == 0 { 0.68 } else { 0.6 };
        (0..50).for_each(|_| tested.update(&Vector2::new(-10.0 * friction, 10.0)));
        if step % 2 == 1 {
            tested.update(&Vector2::new(-6.8, 10.0));
            let found = tested.estimate;
            assert!((found.coefficient - 0.68).abs() < 0.005, "{found:?}");
        }
    }
}

#[test]
fn more_friction_is_learnt_at_once() {
    let mut tested = Tested::new(0.3);
    slide(&mut tested, 0.3, Slip::Positive, 2000);
    slide(&mut tested, 0.7, Slip::Positive, 5);
    let found = tested.estimate;
    assert!((found.coefficient - 0.7).abs() < 0.02, "{found:?}");
}

#[test]
fn a_friction_that_is_not_estimated_stays_the_first_guess() {
    let settings = FrictionSettings {
        first_deviation: 0.0,
        ..Default::default()
    };
    for (friction, is_dragged) in [(0.3, false), (0.3, true), (0.8, false), (0.6, false)] {
        let mut tested = Tested {
            is_dragged,
            ..Tested::with(&settings)
        };
        for slip in [Slip::Negative, Slip::Positive] {
            slide(&mut tested, friction, slip, 2000);
            let found = tested.estimate;
            assert_eq!((found.coefficient, found.deviation()), (0.6, 0.0));
            assert_eq!(tested.catch_up(&Vector2::new(-9.0, 10.0)), 0.0);
            // The direction of slip still follows the force, near the other side of the cone.
            assert!(found.slip == slip || friction < 0.5, "{found:?}");
        }
    }
}

/// Passes readings of the friction 0.6 without noise.
fn without_noise(ticks: u32) -> Tested {
    let mut tested = Tested::new(0.6);
    for _ in 0..ticks {
        tested.update(&Vector2::new(-6.0, 10.0));
    }
    tested
}

#[test]
fn a_rise_of_less_than_a_hundredth_is_not_sudden() {
    let mut tested = without_noise(3000);
    // Eight deviations of a reading and of what is known are 0.0077.
    tested.update(&Vector2::new(-6.07, 10.0));
    let learnt = tested.estimate.coefficient - 0.6;
    assert!(learnt < 0.0035, "{learnt}");
}

/// The variance settles at R T/τ, whatever it was: with the least noise, and with none that a gain near one resolves.
#[test]
fn what_is_known_is_forgotten_in_the_averaging_time() {
    let noise_n = cell().force_noise_n;
    let least = LEAST_NOISE * noise_n * noise_n * (1.0 + 0.6 * 0.6) / (10.0 * 10.0);
    let settled = without_noise(5000).estimate.variance;
    let expected = least * 1e-3 / AVERAGING_S;
    assert!(
        (settled / expected - 1.0).abs() < 0.1,
        "{settled} {expected}"
    );
    let mut surest = without_noise(0);
    surest.estimator.force_variance_n2 *= 1e-8;
    surest.estimator.reading_variance_n2 *= 1e-8;
    for _ in 0..3000 {
        surest.update(&Vector2::new(-6.0, 10.0));
        assert!(surest.estimate.variance > 0.0);
    }
}

#[test]
fn what_is_known_is_forgotten_with_readings_only() {
    let Tested {
        mut estimator,
        mut estimate,
        ..
    } = without_noise(3000);
    let before = estimate.variance;
    for _ in 0..1000 {
        estimator.update(&mut estimate, &Vector2::new(-6.0, 10.0));
    }
    assert_eq!(estimate.variance, before);
}
