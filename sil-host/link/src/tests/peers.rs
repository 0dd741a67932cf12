//! Ends that are missing, refused, silent, or leave without ending the session.

use super::*;
use crate::lock_file::Role;
use crate::run_files::RunFiles;

/// Polls for an answer until there is an error.
fn error_of(plant: &mut PlantEnd) -> LinkError {
    loop {
        match plant.try_receive() {
            Ok(_) => thread::sleep(Duration::from_millis(1)),
            Err(error) => return error,
        }
    }
}

#[test]
fn a_second_plant_is_refused_and_the_first_continues() {
    let bus = TestBus::new();
    let plant = bus.plant().unwrap();
    let error = bus.plant().err().unwrap();
    assert!(matches!(&error, LinkError::BusInUse { bus: named } if *named == bus.name));
    assert!(error.to_string().contains(bus.name.as_str()));

    bus.assert_works(plant);
}

#[test]
fn a_second_controller_is_refused_and_the_first_continues() {
    let bus = TestBus::new();
    let (plant, controller) = bus.plant_and_echo();
    let error = bus.controller(PATIENT).err().unwrap();
    assert!(matches!(&error, LinkError::ControllerInUse { bus: named } if *named == bus.name));

    finish(plant, controller);
    bus.assert_nothing_left();
}

#[test]
fn a_pair_meets_no_stranger() {
    let stranger = TestBus::new();
    let pair = TestBus {
        pair: Some(Pair::unique()),
        ..stranger.clone()
    };
    let other = TestBus {
        pair: Some(Pair::unique()),
        ..stranger.clone()
    };
    for (plants, refused) in [(&pair, [&stranger, &other]), (&stranger, [&pair, &other])] {
        let plant = plants.plant().unwrap();
        for controllers in refused {
            let error = controllers.controller(SHORT).err().unwrap();
            assert!(matches!(error, LinkError::PlantMissing { .. }), "{error}");
        }
        plants.assert_works(plant);
    }
}

#[test]
fn the_error_about_a_missing_plant_names_the_command_to_start() {
    let bus = TestBus::new();
    let error = bus.controller(SHORT).err().unwrap();
    assert!(matches!(error, LinkError::PlantMissing { .. }));
    let advice = format!("painleve plant --bus {}", bus.name);
    assert!(error.to_string().contains(&advice), "{error}");
    bus.assert_nothing_left();
}

#[test]
fn the_error_about_a_missing_controller_names_the_command_to_start() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let error = plant.wait_for_controller(SHORT).unwrap_err();
    assert!(matches!(error, LinkError::ControllerMissing { .. }));
    let advice = format!("painleve controller --bus {}", bus.name);
    assert!(error.to_string().contains(&advice), "{error}");
    assert!(matches!(
        plant.exchange(&sensor(0)),
        Err(LinkError::ControllerGone { .. })
    ));
}

#[test]
fn a_controller_that_is_slow_to_start_is_not_missing() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    plant.set_silence_limit(2 * SHORT);
    let bus = bus.bus();
    let _claim = bus.claim(Role::Controller).unwrap().ok().unwrap();
    let run = RunFiles::ready(&bus.folder(), &bus.place, None).unwrap();
    assert!(run.join().unwrap());
    let error = plant.wait_for_controller(SHORT).unwrap_err();
    assert!(
        matches!(error, LinkError::ControllerSilent { .. }),
        "{error}"
    );
}

#[test]
fn a_plant_that_leaves_without_ending_the_session_is_detected() {
    let bus = TestBus::new();
    let (mut plant, controller) = bus.plant_and_echo();
    plant.exchange(&sensor(0)).unwrap();
    drop(plant);
    assert!(matches!(
        controller.join().unwrap(),
        Err(LinkError::PlantGone { .. })
    ));
    bus.assert_nothing_left();
}

#[test]
fn a_silent_live_controller_is_detected() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let _mute = bus.process("mute");
    plant.wait_for_controller(PATIENT).unwrap();
    plant.set_silence_limit(SHORT);
    assert!(matches!(
        plant.exchange(&sensor(0)),
        Err(LinkError::ControllerSilent { .. })
    ));
    plant.send(&sensor(1)).unwrap();
    let error = error_of(&mut plant);
    assert!(matches!(error, LinkError::ControllerSilent { .. }));
}

#[test]
fn a_silent_live_plant_is_detected() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = bus.spawn_with(5 * SHORT, |mut controller, _| controller.receive());
    plant.wait_for_controller(PATIENT).unwrap();
    assert!(matches!(
        controller.join().unwrap(),
        Err(LinkError::PlantSilent { .. })
    ));
}

/// To a stranger, the plant of a pair is one that does not become ready.
#[test]
fn the_silence_limit_covers_the_start() {
    let stranger = TestBus::new();
    let pair = TestBus {
        pair: Some(Pair::unique()),
        ..stranger.clone()
    };
    let _plant = pair.plant().unwrap();
    match stranger.controller_with(SHORT, PATIENT).err().unwrap() {
        LinkError::PlantSilent { silence, .. } => assert!(silence < DEFAULT_SILENCE_LIMIT),
        other => panic!("{other}"),
    }
}

#[test]
fn a_killed_controller_is_detected_and_the_bus_can_be_used_again() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let mut killed = bus.process("controller");
    plant.wait_for_controller(PATIENT).unwrap();
    plant.exchange(&sensor(0)).unwrap();
    killed.kill();
    // Well before the silence limit, which would give another error.
    assert!(matches!(
        plant.exchange(&sensor(1)),
        Err(LinkError::ControllerGone { .. })
    ));
    plant.send(&sensor(2)).unwrap();
    let error = error_of(&mut plant);
    assert!(matches!(error, LinkError::ControllerGone { .. }));

    // The surviving plant can continue with another controller...
    bus.assert_works(plant);
}

#[test]
fn a_killed_plant_is_detected_and_the_bus_can_be_used_again() {
    let bus = TestBus::new();
    let mut killed = bus.process("plant");
    let (mut survivor, _) = bus.controller(PATIENT).unwrap();
    for _ in 0..100 {
        let Received::Frame(frame) = survivor.receive().unwrap() else {
            panic!("the plant has not ended the session");
        };
        survivor.send(&answer(&frame)).unwrap();
    }
    killed.kill();
    // A new plant starts while the surviving controller is still there.
    let restarted = {
        let bus = bus.clone();
        thread::spawn(move || {
            let mut plant = bus.plant().unwrap();
            plant.wait_for_controller(PATIENT).unwrap();
            plant.exchange(&sensor(0)).unwrap();
            plant.end().unwrap();
        })
    };
    let error = loop {
        match survivor.receive() {
            Ok(Received::Frame(frame)) => survivor.send(&answer(&frame)).unwrap(),
            Ok(Received::End) => panic!("the plant was killed before any end"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, LinkError::PlantGone { .. }), "{error}");
    drop(survivor);

    assert_eq!(bus.echo().join().unwrap().unwrap(), 1);
    restarted.join().unwrap();
    bus.assert_nothing_left();
}
