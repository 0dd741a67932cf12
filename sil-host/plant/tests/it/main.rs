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

/// With the drive off the arm falls on the belt and slides along it, to where a torque throws it off.
#[test]
fn a_contact_before_the_drive_is_on_is_no_capture() {
    let belt = ["belt.friction=0.57", "belt.profile.speed_m_s=-0.288"];
    let contact = run("capture", &belt).statistics.contact;
    let captured_s = contact.captured_s.expect("a capture");
    assert!(captured_s >= 1.5 && contact.lift_offs == 0, "{contact:?}");
}
