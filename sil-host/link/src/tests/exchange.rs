//! Exchange of messages between two ends.

use std::time::Instant;

use painleve_plant::controller_host::ControllerHost;

use super::*;

#[test]
fn every_frame_is_answered() {
    let bus = TestBus::new();
    let (mut plant, controller) = bus.plant_and_echo();
    let first = u32::MAX - 500;
    for n in 0..1000 {
        let frame = sensor(first.wrapping_add(n));
        assert_eq!(plant.exchange(&frame).unwrap(), answer(&frame));
    }
    plant.end().unwrap();
    assert_eq!(controller.join().unwrap().unwrap(), 1000);
    bus.assert_nothing_left();
}

#[test]
fn a_late_controller_receives_the_session_and_all_further_frames() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    for tick in 0..10 {
        plant.send(&sensor(tick)).unwrap();
    }
    let controller =
        bus.spawn(move |mut controller, session| (session, controller.receive().unwrap()));
    plant.wait_for_controller(PATIENT).unwrap();
    plant.send(&sensor(10)).unwrap();
    let (learned, received) = controller.join().unwrap();
    assert_eq!(learned, session());
    assert_eq!(received, Received::Frame(sensor(10)));
    drop(plant);
    bus.assert_nothing_left();
}

#[test]
fn frames_sent_in_a_burst_arrive_in_order_and_before_the_end() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let (sent, all_sent) = std::sync::mpsc::channel();
    let controller = bus.spawn(move |mut controller, _| {
        all_sent.recv().unwrap();
        let mut ticks = Vec::new();
        while let Received::Frame(frame) = controller.receive().unwrap() {
            ticks.push(frame.tick);
        }
        ticks
    });
    plant.wait_for_controller(PATIENT).unwrap();
    let burst = FRAME_BUFFER as u32 + 6;
    for tick in 0..burst {
        plant.send(&sensor(tick)).unwrap();
    }
    plant.end().unwrap();
    sent.send(()).unwrap();
    // More than the buffer holds: the oldest six are dropped.
    assert_eq!(controller.join().unwrap(), (6..burst).collect::<Vec<_>>());
    bus.assert_nothing_left();
}

#[test]
fn answers_are_received_without_waiting() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    assert!(plant.try_receive().unwrap().is_none());
    let controller = bus.echo();
    plant.wait_for_controller(PATIENT).unwrap();
    for tick in 0..3 {
        plant.send(&sensor(tick)).unwrap();
    }
    let mut answered = Vec::new();
    while answered.len() < 3 {
        match plant.try_receive().unwrap() {
            Some(frame) => answered.push(frame.tick),
            None => thread::yield_now(),
        }
    }
    assert_eq!(answered, [0, 1, 2]);
    plant.end().unwrap();
    controller.join().unwrap().unwrap();
}

#[test]
fn a_lost_frame_takes_the_time_of_a_board_that_keeps_it() {
    let bus = TestBus::new();
    let mut plant = lockstep::Lockstep {
        end: bus.plant().unwrap(),
        skip: SHORT,
    };
    let start = Instant::now();
    assert!(plant.skip().unwrap().frame.is_none());
    assert!(start.elapsed() >= SHORT);
}

#[test]
fn simultaneous_buses_do_not_interfere() {
    let a = TestBus::new();
    let b = TestBus {
        name: BusName::unique(),
        ..a.clone()
    };
    let mut plants = [a.plant().unwrap(), b.plant().unwrap()];
    let controllers = [a.echo(), b.echo()];
    for (index, plant) in plants.iter_mut().enumerate() {
        plant.wait_for_controller(PATIENT).unwrap();
        for tick in 0..=index as u32 {
            plant.exchange(&sensor(tick)).unwrap();
        }
    }
    for plant in plants {
        plant.end().unwrap();
    }
    assert_eq!(controllers.map(|c| c.join().unwrap().unwrap()), [1, 2]);
    a.assert_nothing_left();
}

#[test]
fn an_answer_to_a_wrong_tick_is_an_error() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = bus.spawn(move |mut controller, _| {
        controller.receive().unwrap();
        controller.send(&answer(&sensor(6))).unwrap();
        controller.receive().unwrap()
    });
    plant.wait_for_controller(PATIENT).unwrap();
    assert!(matches!(
        plant.exchange(&sensor(7)),
        Err(LinkError::WrongTick {
            asked: 7,
            answered: 6,
            ..
        })
    ));
    plant.end().unwrap();
    assert_eq!(controller.join().unwrap(), Received::End);
}

#[test]
fn an_interrupt_ends_a_wait() {
    let bus = TestBus::new();
    let interrupt = Interrupt::default();
    let mut plant =
        PlantEnd::create_in(bus.place.clone(), &bus.name, None, &session(), &interrupt).unwrap();
    interrupt.request();
    assert!(matches!(
        plant.wait_for_controller(PATIENT),
        Err(LinkError::Interrupted)
    ));
    drop(plant);
    let opened = ControllerEnd::open_in(
        bus.place.clone(),
        &bus.name,
        None,
        PATIENT,
        PATIENT,
        &interrupt,
    );
    assert!(matches!(opened, Err(LinkError::Interrupted)));
    bus.assert_nothing_left();
}
