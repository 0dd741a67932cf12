//! Tests of the plant against references, and of the documentation that describes it.

mod alternate_readings;
mod bits;
mod contact_force;
mod contact_states;
mod documentation;
mod edges;
mod links;
mod mujoco_arms;
mod open_loop_section;
mod random_frames;
mod settings;
mod trade_off;

use painleve_plant::closed_loop::{ClosedLoop, LoopResult};
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;

/// Runs a scenario to its end.
fn run(scenario: &str, overrides: &[&str]) -> LoopResult {
    let overrides: Vec<String> = overrides.iter().map(ToString::to_string).collect();
    let scenario =
        Scenario::load(scenario, &overrides).unwrap_or_else(|error| panic!("{scenario}: {error}"));
    let simulation = Simulation::new(&scenario).expect("a valid scenario");
    let host = InProcess::new(&scenario.controller_configuration()).expect("a valid one");
    let mut closed_loop = ClosedLoop::new(simulation, host);
    for _ in 0..scenario.run.ticks() {
        closed_loop.tick(&mut ()).expect("an answer");
    }
    closed_loop.finish().0
}
