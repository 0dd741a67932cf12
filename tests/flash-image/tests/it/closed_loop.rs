//! The image controls the simulated arm with its own sensors and stages and gives the same torques
//! as the controller on a PC with the same counts.

#![allow(clippy::unwrap_used)]

use painleve_drivers::switches::Switches;
use painleve_firmware::Controller;
use painleve_flash_image::bench::{Bench, scenario};
use painleve_flash_image::board::{BoardChip, F405, G474};
use painleve_shared::frame::SensorFrame;
use painleve_shared::stages::StageSettings;
use painleve_shared::status::SupervisorState;

#[test]
fn the_board_with_its_own_sensors_gives_the_torques_of_a_pc() {
    gives_the_torques_of_a_pc::<F405>();
}

#[test]
fn the_nucleo_with_its_own_sensors_gives_the_torques_of_a_pc() {
    gives_the_torques_of_a_pc::<G474>();
}

fn gives_the_torques_of_a_pc<C: BoardChip>() {
    let geared = StageSettings {
        gear_ratio: [20.0, 12.5],
        gear_efficiency: [0.8, 0.9],
        motor_range_nm: Some([0.4, 0.5]),
    };
    for (name, stages) in [
        ("hybrid-elbow-down", StageSettings::default()),
        ("edge", StageSettings::default()),
        ("hybrid-elbow-down", geared),
    ] {
        let mut scenario = scenario(name);
        scenario.converters.stages = stages;
        let range_nm = scenario.converters.torque.range_nm;
        // Torque at the joint by the stages' output.
        let gear = stages
            .joint_range_nm(range_nm as f32)
            .map(|it| f64::from(it) / range_nm);
        let mut controller = Controller::new(&scenario.controller_configuration()).unwrap();
        let mut switches = Switches::new(scenario.run.tick_hz as f32);
        let mut bench = Bench::<C>::new(&scenario);
        bench.gear = gear;
        let mut answer = |tick, closed, sampled| {
            controller.tick(&SensorFrame {
                tick,
                sequence: tick,
                inputs: switches.tick(closed, false),
                ..sampled
            })
        };
        let before = bench.ticks_answered();
        for tick in 1..=before {
            answer(tick, false, bench.frame);
        }
        let mut driven = 0;
        // The image reads its sensors one tick before it uses them.
        let mut sampled = bench.frame;
        for tick in before + 1..=before + 500 {
            let (read, closed) = (bench.frame, bench.switch_is_closed());
            bench.tick();
            let answer = answer(tick, closed, std::mem::replace(&mut sampled, read));
            let drives = !matches!(
                answer.supervisor_state(),
                Some(SupervisorState::Idle | SupervisorState::Fault)
            );
            let torque = bench.board.torque();
            assert_eq!(torque.enabled, Some(drives), "{name}, tick {tick}");
            for ((answer, gear), counts) in answer.torques.iter().zip(gear).zip(torque.counts) {
                let error = f64::from(counts) - f64::from(answer.0) / gear;
                assert!(error.abs() < 0.501, "{name}, tick {tick}: {error}");
            }
            driven += u32::from(drives);
        }
        assert!(driven > 300, "{name}: {driven} ticks");
        let violations = bench.board.wiring().violations();
        assert!(violations.is_empty(), "{name}: {violations:?}");
    }
}
