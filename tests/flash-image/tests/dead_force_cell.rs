//! A force cell that repeats a plausible reading while the arm is driven: no reading shows that it is stuck.

#![allow(clippy::unwrap_used)]

use painleve_drivers::gap::GapCheck;
use painleve_firmware::Controller;
use painleve_flash_image::bench::{Bench, scenario};
use painleve_flash_image::board::{BoardChip, F405, G474};
use painleve_plant::scenario::built_in;
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::Arm;
use painleve_shared::message::Response;
use painleve_shared::status::{Fault, SupervisorState};

/// Ticks within which the torque is off: the check's 0.2 s, after the tip has come to rest.
const LIMIT_TICKS: u32 = 400;

fn takes_the_torque_off<C: BoardChip>() {
    let mut bench = Bench::<C>::new(&scenario("hybrid-elbow-down"));
    bench.drive();
    bench.force_is_stuck_at = Some(0);
    let mut ticks = 0;
    while !bench.board.torque().is_off() {
        bench.tick();
        ticks += 1;
        assert!(ticks < LIMIT_TICKS);
    }
    let mut fault = None;
    while let Some(response) = bench.board.response(2_000_000_000) {
        if let Response::Tick { answer, .. } = response {
            fault = answer.latched_fault();
            if fault.is_some() {
                break;
            }
        }
    }
    println!("{fault:?} after {ticks} ticks");
    assert_eq!(fault, Some(Fault::GapAgainstForce));
    bench.assert_stays_off(100);
}

#[test]
fn a_force_cell_that_is_stuck_at_zero_takes_the_torque_off() {
    takes_the_torque_off::<F405>();
    takes_the_torque_off::<G474>();
}

/// No healthy run looks like that: not in flight, at the edge, nor during capture.
#[test]
fn healthy_readings_of_every_scenario_are_plausible() {
    for name in built_in::names() {
        let scenario = scenario(name);
        let configuration = scenario.controller_configuration();
        let mut controller = Controller::new(&configuration).unwrap();
        let mut simulation = Simulation::new(&scenario).unwrap();
        let mut statistics = Statistics::new(0.05);
        let converters = &configuration.converters;
        let arm = Arm::new(configuration.arm).unwrap();
        let tick_hz = configuration.tick_hz;
        let mut check = GapCheck::new(arm, converters.encoders, converters.force, tick_hz);
        let mut is_active = false;
        for tick in 0..(scenario.run.duration_s * f64::from(tick_hz)) as u32 {
            let frame = simulation.sample(&mut statistics).unwrap();
            let contradicts = check.contradicts(frame.joints, frame.normal_force, is_active);
            assert!(!contradicts, "{name}, tick {tick}");
            let answer = controller.tick(&frame);
            let state = answer.supervisor_state();
            is_active = state.is_some_and(SupervisorState::drives);
            simulation.advance(Some(&answer), &mut statistics).unwrap();
        }
    }
}
