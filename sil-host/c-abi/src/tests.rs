//! Calls with bad arguments: each is refused with a status and a message, and changes nothing.

use std::ffi::{CStr, CString, c_char};
use std::ptr::{null, null_mut};

use crate::PainleveStatus::{
    InvalidArgument, InvalidScenario, Ok as Done, PlantFailed, WrongOrder,
};
use crate::controller::*;
use crate::plant::*;
use crate::{
    PainleveActuatorFrame, PainleveController, PainlevePlant, PainleveSensorFrame,
    PainleveSnapshot, PainleveStatus, painleve_last_error,
};

/// Joints that turn without end and forces at both ends of their range.
const EXTREMES: [u32; 5] = [0, 1, i32::MAX as u32, i32::MIN as u32, u32::MAX];

fn last_error() -> String {
    // SAFETY: a null-terminated string of this thread.
    let text = unsafe { CStr::from_ptr(painleve_last_error()) };
    text.to_string_lossy().into_owned()
}

/// Asserts that a call was refused with this status and a message that contains `part`.
#[track_caller]
fn refused(status: PainleveStatus, expected: PainleveStatus, part: &str) {
    assert_eq!(status, expected, "{}", last_error());
    assert!(last_error().contains(part), "{}", last_error());
}

/// Returns a pointer one byte after an aligned one.
fn crooked<T>(pointer: *mut T) -> *mut T {
    pointer.wrapping_byte_add(1)
}

fn new_plant(text: &CStr) -> *mut PainlevePlant {
    let mut plant = null_mut();
    // SAFETY: a C string, and a variable of this function.
    let status = unsafe { painleve_plant_new(text.as_ptr(), &mut plant) };
    assert_eq!(status, Done);
    plant
}

fn new_controller(text: &CStr) -> *mut PainleveController {
    let mut controller = null_mut();
    // SAFETY: a C string, and a variable of this function.
    let status = unsafe { painleve_controller_new(text.as_ptr(), &mut controller) };
    assert_eq!(status, Done);
    controller
}

#[test]
fn bad_texts_and_places_of_new_objects_are_refused() {
    let deep_array = CString::new(format!("name = {}", "[".repeat(100_000))).unwrap();
    let deep_key = CString::new(format!("{}a = 1", "a.".repeat(100_000))).unwrap();
    let deep_table = CString::new(format!("[{}a]", "a.".repeat(100_000))).unwrap();
    let texts: [(*const c_char, _, _); 9] = [
        (null(), InvalidArgument, "scenario_toml is null"),
        (c"\xff".as_ptr(), InvalidArgument, "not UTF-8"),
        (
            c"belt.friction = 99".as_ptr(),
            InvalidScenario,
            "belt.friction = 99",
        ),
        (
            c"belt.friction = nan".as_ptr(),
            InvalidScenario,
            "belt.friction = NaN",
        ),
        (c"belt =".as_ptr(), InvalidScenario, "line 1"),
        (c"belt.frction = 1".as_ptr(), InvalidScenario, "frction"),
        (deep_array.as_ptr(), InvalidScenario, ""),
        (deep_key.as_ptr(), InvalidScenario, ""),
        (deep_table.as_ptr(), InvalidScenario, ""),
    ];
    for (text, status, part) in texts {
        let (mut plant, mut controller) = (null_mut(), null_mut());
        // SAFETY: null or a C string, and variables of this function.
        unsafe {
            refused(painleve_plant_new(text, &mut plant), status, part);
            refused(painleve_controller_new(text, &mut controller), status, part);
        }
        assert!(plant.is_null() && controller.is_null());
    }
    // SAFETY: a C string, and places that are not written; freeing null is allowed.
    unsafe {
        let text = c"".as_ptr();
        let part = "the place of the new object is null";
        refused(painleve_plant_new(text, null_mut()), InvalidArgument, part);
        refused(
            painleve_controller_new(text, null_mut()),
            InvalidArgument,
            part,
        );
        let mut places = [null_mut(), null_mut()];
        let place = crooked(places.as_mut_ptr());
        refused(
            painleve_plant_new(text, place),
            InvalidArgument,
            "not aligned",
        );
        painleve_plant_free(null_mut());
        painleve_controller_free(null_mut());
    }
}

#[test]
fn bad_pointers_are_refused_and_change_nothing() {
    let (plant, controller) = (new_plant(c""), new_controller(c""));
    let mut sensors = [PainleveSensorFrame::default(); 2];
    let mut actuators = [PainleveActuatorFrame::default(); 2];
    let mut snapshots = [PainleveSnapshot::default(); 2];
    let (sensor, actuator) = (sensors.as_mut_ptr(), actuators.as_mut_ptr());
    let snapshot = snapshots.as_mut_ptr();
    let mut lost = false;
    let is_lost = &raw mut lost;
    // SAFETY: null, not aligned, or objects and variables of this function.
    unsafe {
        let sample = |plant, sensor, is_lost| painleve_plant_sample(plant, sensor, is_lost);
        let advance = |plant, actuator| painleve_plant_advance(plant, actuator);
        let state = |plant, snapshot| painleve_plant_snapshot(plant, snapshot);
        let tick =
            |controller, sensor, actuator| painleve_controller_tick(controller, sensor, actuator);
        let calls: [(&dyn Fn() -> PainleveStatus, &str); 18] = [
            (&|| sample(null_mut(), sensor, is_lost), "plant is null"),
            (
                &|| sample(crooked(plant), sensor, is_lost),
                "plant is not aligned",
            ),
            (&|| sample(plant, null_mut(), is_lost), "sensor is null"),
            (
                &|| sample(plant, crooked(sensor), is_lost),
                "sensor is not aligned",
            ),
            (&|| sample(plant, sensor, null_mut()), "is_lost is null"),
            (&|| advance(null_mut(), actuator), "plant is null"),
            (
                &|| advance(crooked(plant), actuator),
                "plant is not aligned",
            ),
            (
                &|| advance(plant, crooked(actuator)),
                "actuator is not aligned",
            ),
            (&|| state(null_mut(), snapshot), "plant is null"),
            (&|| state(crooked(plant), snapshot), "plant is not aligned"),
            (&|| state(plant, null_mut()), "snapshot is null"),
            (
                &|| state(plant, crooked(snapshot)),
                "snapshot is not aligned",
            ),
            (&|| tick(null_mut(), sensor, actuator), "controller is null"),
            (
                &|| tick(crooked(controller), sensor, actuator),
                "controller is not aligned",
            ),
            (&|| tick(controller, null_mut(), actuator), "sensor is null"),
            (
                &|| tick(controller, crooked(sensor), actuator),
                "sensor is not aligned",
            ),
            (&|| tick(controller, sensor, null_mut()), "actuator is null"),
            (
                &|| tick(controller, sensor, crooked(actuator)),
                "actuator is not aligned",
            ),
        ];
        for (call, part) in calls {
            refused(call(), InvalidArgument, part);
        }

        // The refused calls have drawn no noise and moved nothing.
        let untouched = new_plant(c"");
        for _ in 0..3 {
            let mut frames = [PainleveSensorFrame::default(); 2];
            assert_eq!(sample(plant, &mut frames[0], &mut lost), Done);
            assert_eq!(sample(untouched, &mut frames[1], &mut lost), Done);
            assert_eq!(format!("{:?}", frames[0]), format!("{:?}", frames[1]));
            assert_eq!(painleve_plant_advance(plant, null()), Done);
            assert_eq!(painleve_plant_advance(untouched, null()), Done);
        }
        painleve_plant_free(plant);
        painleve_plant_free(untouched);
        painleve_controller_free(controller);
    }
}

#[test]
fn sample_and_advance_alternate() {
    let plant = new_plant(c"");
    let mut sensor = PainleveSensorFrame::default();
    let mut snapshot = PainleveSnapshot::default();
    let mut lost = false;
    // SAFETY: an object and variables of this function.
    unsafe {
        for tick in 0..3 {
            refused(
                painleve_plant_advance(plant, null()),
                WrongOrder,
                "not been sampled",
            );
            assert_eq!(painleve_plant_sample(plant, &mut sensor, &mut lost), Done);
            let again = painleve_plant_sample(plant, &mut sensor, &mut lost);
            refused(again, WrongOrder, "has been sampled");
            assert_eq!(sensor.tick, tick);
            assert_eq!(painleve_plant_snapshot(plant, &mut snapshot), Done);
            assert_eq!(painleve_plant_advance(plant, null()), Done);
        }
        assert_eq!(painleve_plant_snapshot(plant, &mut snapshot), Done);
        assert_eq!(snapshot.time_s, 0.003);
        painleve_plant_free(plant);
    }
}

#[test]
fn the_first_sample_changes_neither_contact_nor_force() {
    // From x0,a the belt throws the tip off, from x0,d it does not.
    for text in [c"initial = { theta1_deg = 32.0, theta2_deg = 18.27 }", c""] {
        let plant = new_plant(text);
        let mut states = [PainleveSnapshot::default(); 2];
        let (mut sensor, mut lost) = (PainleveSensorFrame::default(), false);
        // SAFETY: an object and variables of this function.
        unsafe {
            assert_eq!(painleve_plant_snapshot(plant, &mut states[0]), Done);
            assert_eq!(painleve_plant_sample(plant, &mut sensor, &mut lost), Done);
            assert_eq!(painleve_plant_snapshot(plant, &mut states[1]), Done);
            painleve_plant_free(plant);
        }
        let [before, after] = states.map(|state| (state.contact_mode, state.normal_force_n));
        assert_eq!(before, after);
        assert!(before.1 >= 0.0);
    }
}

#[test]
fn any_frame_has_an_answer_without_a_panic() {
    // SAFETY: objects and variables of this function.
    unsafe {
        for scenario in [c"", c"controller.law.pid = {}"] {
            let controller = new_controller(scenario);
            let mut answer = PainleveActuatorFrame::default();
            for case in 0..5_u32.pow(5) {
                let pick = |place: u32| EXTREMES[(case / 5_u32.pow(place) % 5) as usize];
                let sensor = PainleveSensorFrame {
                    tick: case,
                    sequence: pick(0),
                    joints: [pick(1), pick(2)],
                    normal_force: pick(3).cast_signed(),
                    tangential_force: pick(4).cast_signed(),
                    inputs: pick(0),
                };
                let status = painleve_controller_tick(controller, &sensor, &mut answer);
                assert_eq!((status, answer.tick), (Done, case), "{sensor:?}");
            }
            painleve_controller_free(controller);
        }
        for counts in EXTREMES {
            let plant = new_plant(c"converters.torque.range_nm = 1e6");
            let (mut sensor, mut lost) = (PainleveSensorFrame::default(), false);
            let mut answer = PainleveActuatorFrame {
                torques: [counts.cast_signed(), !counts.cast_signed()],
                state: 2,
                flags: u16::MAX,
                ..PainleveActuatorFrame::default()
            };
            for _ in 0..20 {
                let mut status = painleve_plant_sample(plant, &mut sensor, &mut lost);
                if status == Done {
                    for (tick, state, fault) in [
                        (sensor.tick, 255, 0),
                        (sensor.tick, 2, 255),
                        (sensor.tick.wrapping_sub(1), 2, 0),
                    ] {
                        let other = PainleveActuatorFrame {
                            tick,
                            state,
                            fault,
                            ..answer
                        };
                        assert_eq!(painleve_plant_advance(plant, &other), InvalidArgument);
                    }
                    answer.tick = sensor.tick;
                    status = painleve_plant_advance(plant, &answer);
                }
                // A million newton metres may be more than the motion can follow; that is an error, not a panic.
                assert!(
                    matches!(status, Done | PlantFailed),
                    "{counts}: {}",
                    last_error()
                );
                if status == PlantFailed {
                    break;
                }
            }
            painleve_plant_free(plant);
        }
    }
}
