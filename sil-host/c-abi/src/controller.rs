//! The firmware's controller.

use std::ffi::c_char;

use painleve_plant::Controller;

use crate::frames::{PainleveActuatorFrame, PainleveSensorFrame};
use crate::status::{PainleveStatus, borrow, borrow_mut, call, give, scenario, take_back, usable};

/// A controller with its state.
pub struct PainleveController(Controller);

/// Creates the controller of a scenario.
///
/// # Safety
/// `scenario_toml` is a null-terminated string; `controller` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_controller_new(
    scenario_toml: *const c_char,
    controller: *mut *mut PainleveController,
) -> PainleveStatus {
    call(|| {
        // SAFETY: guaranteed by this function's contract.
        let scenario = unsafe { scenario(scenario_toml) }?;
        let configuration = scenario.controller_configuration();
        // SAFETY: guaranteed by this function's contract.
        unsafe {
            give(controller, || {
                Ok(PainleveController(Controller::new(&configuration)?))
            })
        }
    })
}

/// Runs one tick: reads a sensor frame and writes the answer.
///
/// # Safety
/// `controller` comes from [`painleve_controller_new`] and has not been freed, `sensor` can be read
/// and `actuator` written, and no other thread uses the controller at the same time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_controller_tick(
    controller: *mut PainleveController,
    sensor: *const PainleveSensorFrame,
    actuator: *mut PainleveActuatorFrame,
) -> PainleveStatus {
    call(|| {
        // SAFETY: null or valid and not shared, by this function's contract.
        let controller = unsafe { borrow_mut(controller, "controller") }?;
        // SAFETY: null or readable, by this function's contract.
        let sensor = unsafe { borrow(sensor, "sensor") }?;
        usable(actuator, "actuator")?;
        let answer = controller.0.tick(&(*sensor).into());
        // SAFETY: writable, by this function's contract.
        unsafe { actuator.write(answer.into()) };
        Ok(())
    })
}

/// Frees a controller; does nothing with null.
///
/// # Safety
/// `controller` is null or comes from [`painleve_controller_new`], and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_controller_free(controller: *mut PainleveController) {
    // SAFETY: guaranteed by this function's contract.
    unsafe { take_back(controller) }
}
