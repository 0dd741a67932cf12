//! The linearised loop against sines, and both against what breaks the loop.

use painleve_plant::simulation::Simulation;
use painleve_plant::{Controller, Plant};

use super::*;

fn study(controller: &str, tips_m: &[f64], frequencies: usize) -> LoopMargins {
    let Ok(controller) = controller.parse();
    LoopMargins {
        controllers: vec![controller],
        posture: Posture::ElbowDown,
        tips_m: tips_m.to_vec(),
        frequencies,
        overrides: Vec::new(),
    }
}

/// The bar: 5 % and 3°.
fn agree(controller: &str, tips_m: &[f64], frequencies: usize) {
    let study = study(controller, tips_m, frequencies);
    let rows = painleve_study_core::rows(&study, || ()).unwrap();
    let mut compared = 0;
    for row in &rows {
        assert_eq!(row.not_held, None, "{controller} at {} m", row.tip_m);
        for point in row.loops.iter().flat_map(|one| &one.points) {
            compared += 1;
            let ratio = 10_f64.powf((point.measured_gain_db - point.gain_db) / 20.0);
            let degrees = point.measured_phase_deg - point.phase_deg;
            assert!(
                (ratio - 1.0).abs() < 0.05 && degrees.abs() < 3.0,
                "{controller} at {} m: {point:?}",
                row.tip_m
            );
        }
    }
    assert!(
        compared >= tips_m.len() * frequencies,
        "{compared} compared"
    );
}

#[test]
#[ignore = "compares two ways of computing margins"]
fn finite_differences_and_sines_agree() {
    agree("hybrid", &[0.05], 3);
    agree("pid", &[0.0], 2);
}

#[test]
#[ignore = "takes more than a minute"]
fn finite_differences_and_sines_agree_along_the_belt() {
    agree("hybrid", &[-0.14, -0.08, -0.02, 0.03, 0.08, 0.14], 20);
    agree("pid", &[-0.15, -0.12, -0.08, -0.04, 0.0, 0.03], 20);
}

/// Returns how far the tip moves in the last second of a run whose torque is later than the controller knows, m.
fn motion_with_delay_m(scenario: &Scenario, more_ticks: f64) -> f64 {
    let mut controller = Controller::new(&scenario.controller_configuration()).unwrap();
    let mut late = scenario.clone();
    late.converters.torque.delay_ticks += more_ticks;
    let mut simulation = Simulation::new(&late).unwrap();
    let (mut least_m, mut most_m) = (f64::INFINITY, f64::NEG_INFINITY);
    for _ in 0..6000 {
        let sensor = simulation.sample(&mut ()).unwrap();
        let answer = controller.tick(&sensor);
        simulation.advance(Some(&answer), &mut ()).unwrap();
        if simulation.plant().time_s() > 5.0 {
            let tip_m = simulation.plant().snapshot().tip_t_m;
            (least_m, most_m) = (tip_m.min(least_m), tip_m.max(most_m));
        }
    }
    most_m - least_m
}

/// The margin of delay is the delay from which on the tip does not come to rest.
#[test]
#[ignore = "runs at the edge of stability"]
fn the_delay_margin_is_the_delay_that_the_loop_bears() {
    let study = study("pid", &[-0.08], 2);
    let row = study.row(0).unwrap();
    let delays = row.loops.iter().filter_map(|one| one.margins.delay_ms);
    let margin_ms = delays.fold(f64::INFINITY, f64::min);
    let scenario = study.scenario(0, &[]).unwrap();
    // A tick is a millisecond.
    let [stable_m, unstable_m] =
        [0.9, 1.1].map(|part| motion_with_delay_m(&scenario, part * margin_ms));
    assert!(
        stable_m < 1e-4 && unstable_m > 1e-3,
        "{margin_ms} ms: {stable_m}, {unstable_m}"
    );
}

#[test]
fn a_place_beyond_the_edge_is_not_held() {
    let row = study("pid", &[0.15], 2).row(0).unwrap();
    assert!(row.not_held.is_some() && row.loops.is_empty());
    assert_eq!(LoopMargins::lines(&row).into_iter().count(), 1);
}

/// A disturbance of 32 times a sine's size lifts the tip off there: with its flight, the position's loop would seem to cross
/// over at 427 Hz, 0.3° from instability. Sines cross over near 45 Hz.
#[test]
fn near_the_edge_no_flight_passes_for_the_loop() {
    let row = study("hybrid", &[0.1628], 2).row(0).unwrap();
    let margins = &row.loops[0].margins;
    assert!(margins.modulus > 0.15, "{margins:?}");
}

/// A disturbance of 32 times a sine's size reverses the slip on a belt of 20 mm/s: with it, the position's loop would seem to
/// cross over at 476 Hz. On a faster belt it crosses over at 25 Hz.
#[test]
fn on_a_slow_belt_no_friction_at_rest_passes_for_the_loop() {
    let on_belt = |speed_m_s: f64| LoopMargins {
        overrides: vec![format!("belt.profile.speed_m_s={speed_m_s}")],
        ..study("hybrid", &[0.0], 2)
    };
    let slow = on_belt(0.02).row(0).unwrap();
    let crossover_hz = slow.loops[0].margins.crossover_hz.unwrap();
    assert!((20.0..30.0).contains(&crossover_hz), "{crossover_hz}");
    let standing = on_belt(0.0).row(0).unwrap();
    assert_eq!(standing.not_held, Some(NotHeld::Sticks));
}

#[test]
fn the_delay_of_ones_own_scenario_is_in_its_loop() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("late.toml");
    let late = ["converters.torque.delay_ticks=3".to_owned()];
    let scenario = Scenario::load("hybrid-elbow-down", &late).unwrap();
    std::fs::write(&path, scenario.to_toml().unwrap()).unwrap();
    let delay_ms = |study: &LoopMargins| -> f64 {
        let rows = painleve_study_core::rows(study, || ()).unwrap();
        rows[0].loops[0].margins.delay_ms.unwrap()
    };
    let of_the_file = delay_ms(&study(path.to_str().unwrap(), &[0.05], 0));
    let given = LoopMargins {
        overrides: late.to_vec(),
        ..study("hybrid", &[0.05], 0)
    };
    assert!(
        (of_the_file - delay_ms(&given)).abs() < 0.01,
        "{of_the_file}"
    );
    assert!(of_the_file < 0.9 * delay_ms(&study("hybrid", &[0.05], 0)));
}
