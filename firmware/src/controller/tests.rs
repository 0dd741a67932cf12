//! Tests of the tick's handling of frames, faults, limits and counters.

mod program;

use super::*;
use crate::configuration::ControllerSettings;
use crate::estimate::contact::Evidence;
use crate::refer::governor::Stretch;
use crate::refer::reference::{Program, Segment};
use crate::supervise::lapses::{Lapse, LapseLimits};
use crate::test_readings::pressing as frame;
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::DigitalInputs;
use painleve_shared::status::{Fault, SupervisorState};

fn configuration() -> Configuration {
    Configuration {
        settings: ControllerSettings {
            reference: Program::default(),
            ..Default::default()
        },
        ..Default::default()
    }
}

fn run(controller: &mut Controller, ticks: core::ops::Range<u32>) -> ActuatorFrame {
    ticks.fold(ActuatorFrame::default(), |_, tick| {
        controller.tick(&frame(tick))
    })
}

fn tracking() -> Controller {
    let mut controller = Controller::new(&configuration()).unwrap();
    let answer = run(&mut controller, 0..20);
    assert_eq!(answer.supervisor_state(), Some(SupervisorState::Tracking));
    assert_ne!(answer.torques, [TorqueCounts(0); 2]);
    controller
}

fn assert_fault(controller: &mut Controller, bad: &SensorFrame, fault: Fault) {
    let answer = controller.tick(bad);
    assert_eq!(answer.latched_fault(), Some(fault));
    assert_eq!(answer.torques, [TorqueCounts(0); 2], "off within the tick");
    let next = controller.tick(&frame(bad.tick.wrapping_add(1)));
    assert_eq!(next.latched_fault(), Some(fault), "latched");
    assert_eq!(next.torques, [TorqueCounts(0); 2]);
}

#[test]
fn an_update_that_is_due_is_done_before_the_next_answer() {
    let mut in_time = tracking();
    let mut late = in_time.clone();
    for tick in 20..40 {
        let mut frame = frame(tick);
        // Other readings in each tick, and some that are lost.
        frame.normal_force.0 += 10 * (tick as i32 % 3);
        if tick % 7 == 0 {
            frame.joints[0] = EncoderCounts(u32::MAX);
        }
        let expected = in_time.tick(&frame);
        assert_eq!(*late.answer(&frame), expected);
    }
}

/// Neither the search for edges nor learning waits for ticks with odd or even numbers.
#[test]
fn what_is_learnt_does_not_depend_on_the_numbers_of_the_ticks() {
    let after = |number: fn(u32) -> u32| {
        let mut controller = Controller::new(&configuration()).unwrap();
        let mut shown = None;
        for sequence in 0..300 {
            let frame = SensorFrame {
                tick: number(sequence),
                ..frame(sequence)
            };
            controller.answer_and_show(&frame, |estimates, target, command| {
                shown = Some((target.stretch, estimates.contact.friction, *command));
            });
            controller.update();
        }
        shown.unwrap()
    };
    let usual = after(|sequence| sequence);
    let Stretch { lower_m, upper_m } = usual.0;
    assert!(lower_m < -0.17 && upper_m < 0.17, "{:?}", usual.0);
    for number in [|_| 0, |_| 1, |sequence| 3 * sequence + 1] {
        assert_eq!(after(number), usual);
    }
}

#[test]
fn answers_echo_the_tick_and_count_frames() {
    let mut controller = Controller::new(&configuration()).unwrap();
    let first = controller.tick(&frame(7));
    let second = controller.tick(&frame(8));
    assert_eq!((first.tick, second.tick), (7, 8));
    assert_eq!(second.sequence, first.sequence.wrapping_add(1));
}

#[test]
fn counters_wrap_without_a_fault() {
    let mut controller = Controller::new(&configuration()).unwrap();
    let mut answer = ActuatorFrame::default();
    for tick in 0..100_u32 {
        answer = controller.tick(&frame(tick.wrapping_add(u32::MAX - 50)));
    }
    assert_eq!(answer.supervisor_state(), Some(SupervisorState::Tracking));
    assert_eq!(controller.lapses().totals().of(Lapse::LostFrame), 0);
}

/// A frame with one reading that its converter cannot give.
fn impossible(tick: u32, lapse: Lapse) -> SensorFrame {
    let mut bad = frame(tick);
    match lapse {
        Lapse::EncoderOutOfRange => bad.joints[1] = EncoderCounts(16_384),
        _ => bad.normal_force = ForceCounts(2048),
    }
    bad
}

#[test]
fn impossible_readings_keep_the_torque_and_too_many_are_a_fault() {
    for lapse in [Lapse::EncoderOutOfRange, Lapse::ForceOutOfRange] {
        let limit = LapseLimits::default().of(lapse);
        let mut controller = tracking();
        let before = controller.tick(&frame(20));
        for tick in (21..).take(limit as usize) {
            let answer = controller.tick(&impossible(tick, lapse));
            assert_eq!(answer.torques, before.torques);
            assert_eq!(answer.latched_fault(), None);
        }
        // The estimator bridges the missing readings, and the good ones make up for them.
        let good = 20 + 3 * limit;
        for tick in 21 + limit..=good {
            assert_eq!(controller.tick(&frame(tick)).latched_fault(), None);
        }
        for tick in (good + 1..).take(limit as usize) {
            controller.tick(&impossible(tick, lapse));
        }
        assert_eq!(controller.lapses().totals().of(lapse), 2 * limit);
        assert_eq!(controller.lapses().totals().of(Lapse::LostFrame), 0);
        let one_more = impossible(good + limit + 1, lapse);
        assert_fault(&mut controller, &one_more, lapse.fault());
    }
}

#[test]
fn the_drive_can_be_disabled_by_a_frame_whose_readings_are_impossible() {
    let mut controller = tracking();
    let mut bad = impossible(20, Lapse::ForceOutOfRange);
    bad.inputs = DigitalInputs::default();
    let answer = controller.tick(&bad);
    assert_eq!(answer.torques, [TorqueCounts(0); 2]);
    assert_eq!(answer.supervisor_state(), Some(SupervisorState::Idle));
    // ENABLE has to rise again in a valid frame.
    let answer = controller.tick(&frame(21));
    assert_eq!(answer.supervisor_state(), Some(SupervisorState::Idle));
}

#[test]
fn a_joint_that_jumps_is_a_fault_at_once() {
    let mut bad = frame(20);
    bad.joints[0].0 ^= 1 << 12;
    assert_fault(&mut tracking(), &bad, Fault::EncoderJump);
}

#[test]
fn after_a_jump_the_encoders_detect_flight() {
    let mut configuration = configuration();
    configuration.settings.contact.evidence = Evidence::Encoders;
    let mut controller = Controller::new(&configuration).unwrap();
    let touches = |answer: ActuatorFrame| answer.flags.contains(StatusFlags::CONTACT);
    assert!(touches(run(&mut controller, 0..20)));
    let encoder = configuration.converters.encoders[0];
    // The tip is 5 cm higher from now on.
    let thrown = |tick| {
        let mut thrown = frame(tick);
        thrown.joints[0] = encoder.reading((-4.4 - f64::from(tick)).to_radians());
        thrown
    };
    // The estimates start from the jump; two further readings show the gap.
    controller.tick(&thrown(20));
    controller.tick(&thrown(21));
    let answer = controller.tick(&thrown(22));
    assert_eq!(answer.latched_fault(), Some(Fault::EncoderJump));
    assert!(!touches(answer));
}

#[test]
fn a_lapse_around_the_tick_beyond_its_limit_latches_until_armed_again() {
    for lapse in [Lapse::Overrun, Lapse::MissingFrame, Lapse::FailedChecksum] {
        let mut controller = tracking();
        let stopped = (0..20).find_map(|_| controller.note(lapse, 1));
        let stopped = stopped.expect("every kind has a limit");
        assert_eq!(stopped.latched_fault(), Some(lapse.fault()));
        assert_eq!(stopped.torques, [TorqueCounts(0); 2], "torque off at once");
        // Reported once; the fault stays latched.
        assert_eq!(controller.note(lapse, 1), None);
        controller.note(lapse, 0);
        let answer = run(&mut controller, 20..30);
        assert_eq!(answer.latched_fault(), Some(lapse.fault()));
        assert_eq!(answer.torques, [TorqueCounts(0); 2]);
        let mut tick = 30;
        let mut with = |inputs| {
            tick += 1;
            let inputs = SensorFrame {
                inputs,
                ..frame(tick)
            };
            controller.tick(&inputs)
        };
        with(DigitalInputs::ENABLE | DigitalInputs::RESET);
        let answer = with(DigitalInputs::ENABLE);
        assert_eq!(answer.supervisor_state(), Some(SupervisorState::Idle));
        with(DigitalInputs::default());
        let answer = with(DigitalInputs::ENABLE);
        assert_eq!(answer.supervisor_state(), Some(SupervisorState::Armed));
        assert_ne!(answer.torques, [TorqueCounts(0); 2]);
    }
}

#[test]
fn lost_frames_are_counted_and_too_many_are_a_fault() {
    let mut controller = tracking();
    let answer = controller.tick(&frame(22));
    assert_eq!(answer.latched_fault(), None);
    assert_eq!(controller.lapses().totals().of(Lapse::LostFrame), 2);
    assert_fault(&mut controller, &frame(30), Fault::LostFrames);
}

#[test]
fn a_stale_frame_keeps_the_torque_and_many_are_a_fault() {
    let mut controller = tracking();
    let before = controller.tick(&frame(20));
    for _ in 0..5 {
        let answer = controller.tick(&frame(20));
        assert_eq!(answer.torques, before.torques);
    }
    assert_eq!(controller.lapses().totals().of(Lapse::StaleFrame), 5);
    assert_fault(&mut controller, &frame(20), Fault::StaleFrame);
}

#[test]
fn a_sender_that_starts_anew_resets_the_fault_and_arms() {
    let mut controller = Controller::new(&configuration()).unwrap();
    run(&mut controller, 1000..1020);
    let answer = run(&mut controller, 0..20);
    assert_eq!(answer.latched_fault(), Some(Fault::StaleFrame));
    for (sequence, inputs, state) in [
        (20, DigitalInputs::RESET, SupervisorState::Idle),
        (21, DigitalInputs::ENABLE, SupervisorState::Armed),
    ] {
        let answer = controller.tick(&SensorFrame {
            inputs,
            ..frame(sequence)
        });
        assert_eq!(answer.supervisor_state(), Some(state));
    }
}

#[test]
fn torque_is_limited() {
    let mut limited = configuration();
    // Less torque than holding the arm takes, so that pressing less does not help.
    limited.settings.torque_limit_nm = 0.05;
    let mut controller = Controller::new(&limited).unwrap();
    let answer = run(&mut controller, 0..20);
    assert!(answer.flags.contains(StatusFlags::SATURATED));
    let limit = (0.05 / limited.converters.torque.per_count()).round() as i32;
    assert!(answer.torques.iter().all(|torque| torque.0.abs() <= limit));
}

#[test]
fn the_tip_is_pressed_less_where_torque_is_short() {
    let mut limited = configuration();
    limited.settings.torque_limit_nm = 1.5;
    // A force that never follows the torque would be that of a compliant contact.
    limited.settings.response.enabled = false;
    let mut controller = Controller::new(&limited).unwrap();
    for tick in 0..200 {
        let answer = controller.tick(&frame(tick));
        assert_ne!(answer.torques, [TorqueCounts(0); 2]);
        assert!(!answer.flags.contains(StatusFlags::SATURATED));
    }
    let largest_nm = controller.command.torque_nm.amax();
    // All of the torque is used, to the last count.
    let count_nm = configuration().converters.torque.converter().per_count;
    assert!((1.5 - largest_nm).abs() <= 1.01 * count_nm, "{largest_nm}");
}

#[test]
fn the_reference_waits_where_a_thrown_tip_has_left_it() {
    let mut configuration = configuration();
    let step = Segment::Step {
        target_m: 0.1,
        duration_s: 10.0,
    };
    configuration.settings.reference.segments = [step].into_iter().collect();
    let mut controller = Controller::new(&configuration).unwrap();
    // The tip is 0.26 m away, and the governor catches up.
    run(&mut controller, 0..100);
    let references_m = (100..200).filter_map(|tick| {
        let in_the_air = SensorFrame {
            normal_force: ForceCounts(0),
            tangential_force: ForceCounts(0),
            ..frame(tick)
        };
        let answer = controller.tick(&in_the_air);
        let recovers = answer.flags.contains(StatusFlags::RECOVERING);
        recovers.then_some(answer.reference_tip)
    });
    let references_m: std::vec::Vec<_> = references_m.collect();
    assert!(references_m.len() > 50, "{references_m:?}");
    assert!(
        references_m
            .iter()
            .all(|it| *it == references_m[0] && it.0 < 0)
    );
}

/// Returns a controller that tracked, with the drive off for 2 s in which somebody presses the tip and turns joint 1 on
/// `counts_at`.
fn turned_by_hand(counts_at: impl Fn(u32) -> i32) -> (Controller, SensorFrame) {
    let mut controller = tracking();
    let mut last = frame(20);
    for tick in 20..2020 {
        let mut by_hand = frame(tick);
        by_hand.inputs = DigitalInputs::default();
        let turned = by_hand.joints[0]
            .0
            .wrapping_add_signed(counts_at(tick - 20));
        by_hand.joints[0].0 = turned % 16_384;
        controller.tick(&by_hand);
        last = by_hand;
    }
    (controller, last)
}

#[test]
fn a_tip_that_somebody_presses_while_the_drive_is_off_shows_no_length() {
    let before = tracking().estimates.arm.link_length_m();
    // Readings that change, away from the belt.
    let (controller, _) = turned_by_hand(|tick| -200 - (tick as i32 % 3));
    assert_eq!(controller.estimates.arm.link_length_m(), before);
}

#[test]
fn a_joint_turned_once_around_while_the_drive_is_off_is_where_it_was() {
    let (mut controller, last) = turned_by_hand(|tick| 16_384.min(10 * tick as i32));
    let theta = controller.estimates.model.theta_rad.first();
    assert!((theta - (-11.4_f32).to_radians()).abs() < 1e-3, "{theta}");
    let enabled = SensorFrame {
        tick: last.tick + 1,
        sequence: last.sequence + 1,
        ..frame(last.tick + 1)
    };
    assert_eq!(controller.tick(&enabled).latched_fault(), None);
}

#[test]
fn torques_learnt_before_the_drive_was_off_are_forgotten() {
    let mut controller = tracking();
    // The arm does not give way to the torque of a law that wants to move: somebody holds it.
    for tick in 20..520 {
        controller.tick(&SensorFrame {
            normal_force: ForceCounts(300),
            ..frame(tick)
        });
    }
    let learnt_nm = |controller: &Controller| controller.estimates.disturbance.torque_nm;
    assert!(learnt_nm(&controller).amax() > 0.1);
    for tick in 520..523 {
        controller.tick(&SensorFrame {
            inputs: DigitalInputs::default(),
            ..frame(tick)
        });
    }
    assert_eq!(learnt_nm(&controller).amax(), 0.0);
}

#[test]
fn bad_configurations_are_named() {
    let mut bad = configuration();
    bad.settings.torque_limit_nm = f32::NAN;
    let error = Controller::new(&bad).unwrap_err();
    assert_eq!(error.key, "torque_limit_nm");
    let mut bad = configuration();
    bad.arm.height_m = 0.42;
    assert_eq!(Controller::new(&bad).unwrap_err().key, "arm.height_m");
}

painleve_shared::settings! {
    /// A law that expects a force beyond all measure, which is finite.
    #[derive(Copy)]
    pub struct Boundless {
        /// Force.
        force_n: f32 = 1e38, 0.0..=2e38, "N";
    }
}

impl Law for Boundless {
    type State = ();

    fn tick(&self, _: &mut (), _: &crate::law::LawInput<'_>) -> crate::law::LawOutput {
        crate::law::LawOutput {
            contact_force_n: nalgebra::Vector2::new(0.0, self.force_n),
            ..Default::default()
        }
    }
}

#[test]
fn a_force_beyond_all_measure_latches_a_fault_and_leaves_the_estimates() {
    let configuration = Configuration::<Boundless>::default();
    let mut controller = Controller::new(&configuration).unwrap();
    controller.tick(&SensorFrame {
        inputs: DigitalInputs::default(),
        ..frame(0)
    });
    let before = controller.estimates.model.theta_rad;
    let answer = controller.tick(&frame(1));
    assert_eq!(answer.latched_fault(), Some(Fault::NotFinite));
    controller.tick(&frame(2));
    let turned = controller.estimates.model.theta_rad - before;
    assert!(turned.amax() < 1e-3, "{turned:?}");
}

/// Joint 1 is turned by hand, forwards through half a turn.
#[test]
fn the_friction_of_a_joint_opposes_its_motion_through_half_a_turn() {
    let mut configuration = configuration();
    configuration.arm.coulomb_friction_nm = [0.1, 0.0];
    let [encoder, _] = configuration.converters.encoders;
    let mut controller = Controller::new(&configuration).unwrap();
    for tick in 0..400 {
        let angle_rad = 3.0 + 1e-3 * f64::from(tick);
        controller.tick(&SensorFrame {
            joints: [encoder.reading(angle_rad), encoder.reading(0.0)],
            inputs: DigitalInputs::default(),
            ..frame(tick)
        });
        let friction_nm = controller.estimates.joint_friction.torque_nm().first();
        assert!(tick < 50 || friction_nm > 0.0, "{tick}: {friction_nm}");
    }
}
