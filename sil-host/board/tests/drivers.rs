//! The board's sensor drivers in the loop: the same run as without them, and no wrong reading with bit
//! errors.

#![allow(clippy::unwrap_used)]

use painleve_board::{BoardError, Drivers, OnBoard};
use painleve_plant::closed_loop::{ClosedLoop, LoopResult};
use painleve_plant::controller_host::{ControllerHost, InProcess};
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;

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
fn every_built_in_scenario_runs_as_without_drivers() {
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
            // Ideal converters resolve more than any part.
            Err(BoardError::Parts { .. }) => assert_eq!(name, "paper-gains"),
            Err(error) => panic!("{name}: {error}"),
        }
    }
    assert_eq!(compared, built_in::names().count() - 1);
}

/// The same with the converters of the board where the scenario has ideal ones.
#[test]
fn a_scenario_with_ideal_converters_runs_with_those_of_the_board() {
    let overrides = ["converters.encoder.bits=14", "converters.force.bits=13"];
    let scenario = Scenario::load("paper-gains", &overrides.map(String::from)).unwrap();
    let configuration = scenario.controller_configuration();
    let native = run(&scenario, InProcess::new(&configuration).unwrap());
    let result = with_drivers(&scenario, 0.0).unwrap();
    assert_eq!(result.log_hash, native.log_hash);
}

/// A lost reading leaves the torque as it was for one tick; a wrong one would throw the tip off the belt.
#[test]
fn with_bit_errors_the_run_goes_on() {
    for name in ["hybrid-elbow-down", "hybrid-elbow-up", "edge"] {
        let scenario = Scenario::load(name, &[]).unwrap();
        let result = with_drivers(&scenario, 1e-4).unwrap();
        assert_eq!(result.fault, None, "{name}");
        assert_eq!(result.statistics.lift_offs, 0, "{name}");
    }
}
