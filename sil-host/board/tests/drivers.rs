//! The board's sensor drivers in the loop: the run is the same as without them, and bit errors give
//! no wrong reading.

#![allow(clippy::unwrap_used)]

use painleve_board::{BoardError, ConnectedBoard as _, Drivers, OnBoard};
use painleve_chips::BridgeFailure;
use painleve_plant::closed_loop::{ClosedLoop, LoopResult};
use painleve_plant::controller_host::{ControllerHost, InProcess};
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_shared::ActuatorFrame;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::status::Fault;

fn run(scenario: &Scenario, host: impl ControllerHost) -> LoopResult {
    let simulation = Simulation::new(scenario).unwrap();
    let mut closed_loop = ClosedLoop::new(simulation, host);
    for _ in 0..scenario.run.ticks() {
        closed_loop.tick(&mut ()).unwrap();
    }
    closed_loop.finish().0
}

fn with_drivers(scenario: &Scenario, bit_errors: f64) -> Result<LoopResult, BoardError> {
    let drivers = Drivers::new(&scenario.controller_configuration(), bit_errors)?;
    Ok(run(scenario, OnBoard::new(drivers)))
}

#[test]
fn every_built_in_scenario_gives_the_same_run_with_the_drivers() {
    let mut compared = 0;
    for name in built_in::names() {
        let scenario = Scenario::load(name, &[]).unwrap();
        let configuration = scenario.controller_configuration();
        let native = run(&scenario, InProcess::new(&configuration).unwrap());
        match with_drivers(&scenario, 0.0) {
            Ok(result) => {
                assert_eq!(result.log_hash, native.log_hash, "{name}");
                compared += 1;
            }
            // Ideal converters have a higher resolution than any part.
            Err(BoardError::Parts { .. }) => assert_eq!(name, "paper-gains"),
            Err(error) => panic!("{name}: {error}"),
        }
    }
    assert_eq!(compared, built_in::names().count() - 1);
}

/// With the first sensor of each channel alone, and with the second one alone.
#[test]
fn one_sensor_on_each_channel_gives_the_same_run() {
    let native = Scenario::load(built_in::DEFAULT, &[]).unwrap();
    let native = run(
        &native,
        InProcess::new(&native.controller_configuration()).unwrap(),
    );
    for sensors in ["first", "second"] {
        let overrides = [format!("converters.mounting.sensors={sensors}")];
        let scenario = Scenario::load(built_in::DEFAULT, &overrides).unwrap();
        let result = with_drivers(&scenario, 0.0).unwrap();
        assert_eq!(result.log_hash, native.log_hash, "{sensors}");
    }
}

/// A scenario with ideal converters, run with the board's converters. Its tip bounces: the force cell needs a
/// range that the impacts do not exceed, because a board rejects the readings of a saturated cell.
#[test]
fn a_scenario_with_ideal_converters_runs_with_those_of_the_board() {
    let overrides = [
        "converters.encoder.bits=14",
        "converters.force.bits=12",
        "converters.force.range_n=500",
    ];
    let scenario = Scenario::load("paper-gains", &overrides.map(String::from)).unwrap();
    let configuration = scenario.controller_configuration();
    let native = run(&scenario, InProcess::new(&configuration).unwrap());
    let result = with_drivers(&scenario, 0.0).unwrap();
    assert_eq!(result.log_hash, native.log_hash);
}

/// Each way in which an axis of the force cell can die is found at once: the live zero.
#[test]
fn a_dead_force_cell_takes_the_torque_off_within_two_ticks() {
    let scenario = Scenario::load("hybrid-elbow-down", &[]).unwrap();
    let configuration = scenario.controller_configuration();
    for axis in 0..2 {
        for failure in BridgeFailure::ALL {
            let mut drivers = Drivers::new(&configuration, 0.0).unwrap();
            let mut simulation = Simulation::new(&scenario).unwrap();
            let mut answer = ActuatorFrame::default();
            for tick in 0..300 {
                if tick == 298 {
                    assert_ne!(answer.torques, [TorqueCounts(0); 2]);
                    drivers.bridges[axis].failure = Some(*failure);
                }
                let frame = simulation.sample(&mut ()).unwrap();
                answer = drivers.exchange(&frame).unwrap().frame;
                simulation.advance(Some(&answer), &mut ()).unwrap();
            }
            assert_eq!(answer.torques, [TorqueCounts(0); 2], "{axis} {failure:?}");
            assert_eq!(answer.latched_fault(), Some(Fault::ForceOutOfRange));
        }
    }
}

/// A lost reading keeps the torque unchanged for one tick; a wrong one would throw the tip off the
/// belt.
#[test]
fn runs_survive_bit_errors() {
    for name in ["hybrid-elbow-down", "hybrid-elbow-up", "edge"] {
        let scenario = Scenario::load(name, &[]).unwrap();
        let result = with_drivers(&scenario, 1e-4).unwrap();
        assert_eq!(result.fault, None, "{name}");
        assert_eq!(result.statistics.lift_offs, 0, "{name}");
    }
}
