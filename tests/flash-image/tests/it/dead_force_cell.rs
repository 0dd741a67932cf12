//! The only force cell of an arm repeats a plausible reading while the arm is driven: no reading shows that it is
//! stuck.

#![allow(clippy::unwrap_used)]

use painleve_drivers::gap::{GapCheck, Scales};
use painleve_drivers::heating::{Heating, HeatingModel};
use painleve_drivers::plausibility::SensorReadings;
use painleve_firmware::Controller;
use painleve_flash_image::bench::{Bench, scenario, with_one_sensor};
use painleve_flash_image::board::{BoardChip, F405, G474};
use painleve_flash_image::harm::Harm;
use painleve_plant::scenario::built_in;
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::Arm;
use painleve_shared::message::Response;
use painleve_shared::status::{Fault, SupervisorState};

/// Ticks within which the torque is off: the check's 0.2 s, after the tip has come to rest.
const LIMIT_TICKS: u32 = 400;

/// The reading at which the force cell is stuck: that without a force, or the present one. Returns what the arm does until
/// the torque is off.
pub fn takes_the_torque_off<C: BoardChip>(is_zero: bool) -> Harm {
    let mut bench = Bench::<C>::new(&with_one_sensor("hybrid-elbow-down"));
    bench.drive();
    let present = [bench.frame.tangential_force.0, bench.frame.normal_force.0];
    bench.force_is_stuck_at = Some(if is_zero { [0; 2] } else { present });
    let harm = Harm::until_off(&mut bench, LIMIT_TICKS);
    let mut fault = None;
    while let Some(response) = bench.board.response(2_000_000_000) {
        if let Response::Tick { answer, .. } = response {
            fault = answer.latched_fault();
            if fault.is_some() {
                break;
            }
        }
    }
    println!("{fault:?} after {harm:?}");
    assert_eq!(fault, Some(Fault::GapAgainstForce));
    bench.assert_stays_off(100);
    harm
}

#[test]
fn a_force_cell_that_is_stuck_at_zero_takes_the_torque_off() {
    takes_the_torque_off::<F405>(true);
    takes_the_torque_off::<G474>(true);
}

#[test]
fn a_force_cell_that_is_stuck_in_contact_takes_the_torque_off() {
    takes_the_torque_off::<F405>(false);
    takes_the_torque_off::<G474>(false);
}

/// No healthy run looks like that: not in flight, at the edge, nor during capture, with or without noise. No
/// winding becomes hot.
#[test]
fn healthy_readings_of_every_scenario_are_plausible() {
    for (name, noise_n) in built_in::names().flat_map(|it| [(it, 0.02), (it, 0.0)]) {
        let mut scenario = scenario(name);
        scenario.converters.force.noise_n = noise_n;
        let configuration = scenario.controller_configuration();
        let mut controller = Controller::new(&configuration).unwrap();
        let mut simulation = Simulation::new(&scenario).unwrap();
        let mut statistics = Statistics::new(0.05);
        let converters = &configuration.converters;
        let arm = Arm::new(configuration.arm).unwrap();
        let tick_hz = configuration.tick_hz;
        let scales = Scales {
            encoders: converters.encoders,
            force: converters.force,
            torque: converters.torque,
            check_hz: tick_hz,
        };
        let mut check = GapCheck::new(arm, scales);
        let model = HeatingModel::new(
            &converters.winding,
            &converters.stages,
            &converters.torque,
            tick_hz,
        )
        .unwrap();
        let mut heating = Heating::default();
        let mut torques = None;
        for tick in 0..(scenario.run.duration_s * f64::from(tick_hz)) as u32 {
            let frame = simulation.sample(&mut statistics).unwrap();
            let readings = SensorReadings {
                joints: frame.joints.map(Some),
                forces: [Some(frame.tangential_force), Some(frame.normal_force)],
                ..SensorReadings::default()
            };
            check.begin(&readings, torques);
            check.measure();
            assert!(!check.contradicts(), "{name}, tick {tick}");
            heating.tick(torques.unwrap_or_default());
            heating.step(&model);
            assert!(!heating.is_hot(), "{name}, tick {tick}");
            let answer = controller.tick(&frame);
            let state = answer.supervisor_state();
            let is_active = state.is_some_and(SupervisorState::drives);
            torques = is_active.then_some(answer.torques);
            simulation.advance(Some(&answer), &mut statistics).unwrap();
        }
    }
}
