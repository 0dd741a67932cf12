//! The simulated arm on its belt, as measured by encoders and force cell and driven by torque
//! stages.

use std::ffi::c_char;

use painleve_plant::Plant;
use painleve_plant::simulation::Simulation;

use crate::frames::{PainleveActuatorFrame, PainleveSensorFrame, PainleveSnapshot};
use crate::status::{CallError, PainleveStatus, call, give, put, scenario, take_back};

/// A plant with its converters.
pub struct PainlevePlant(Simulation);

/// Creates the plant of a scenario, at time 0.
///
/// # Safety
/// `scenario_toml` is a null-terminated string; `plant` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_plant_new(
    scenario_toml: *const c_char,
    plant: *mut *mut PainlevePlant,
) -> PainleveStatus {
    call(|| {
        // SAFETY: guaranteed by this function's contract.
        let scenario = unsafe { scenario(scenario_toml) }?;
        // SAFETY: guaranteed by this function's contract.
        unsafe { give(plant, || Ok(PainlevePlant(Simulation::new(&scenario)?))) }
    })
}

/// Reads the sensors at this tick; call it once per tick, before [`painleve_plant_advance`]. Sets
/// `is_lost` if the scenario loses this frame in transit; the controller must then not receive it.
///
/// # Safety
/// `plant` comes from [`painleve_plant_new`] and has not been freed, `sensor` and `is_lost` can be
/// written, and no other thread uses the plant at the same time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_plant_sample(
    plant: *mut PainlevePlant,
    sensor: *mut PainleveSensorFrame,
    is_lost: *mut bool,
) -> PainleveStatus {
    call(|| {
        // SAFETY: null or valid and not shared, by this function's contract.
        let plant = unsafe { plant.as_mut() }.ok_or(CallError::Null("plant"))?;
        if sensor.is_null() || is_lost.is_null() {
            return Err(CallError::Null("sensor or is_lost"));
        }
        let frame = plant.0.sample(&mut ())?;
        // SAFETY: both are writable, by this function's contract.
        unsafe {
            put(sensor, "sensor", frame.into())?;
            put(is_lost, "is_lost", plant.0.sensor_frame_is_lost())
        }
    })
}

/// Accepts the answer to this tick's sample, or null if there is none, and advances to the next
/// tick.
///
/// # Safety
/// `plant` comes from [`painleve_plant_new`] and has not been freed, `actuator` is null or can be
/// read, and no other thread uses the plant at the same time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_plant_advance(
    plant: *mut PainlevePlant,
    actuator: *const PainleveActuatorFrame,
) -> PainleveStatus {
    call(|| {
        // SAFETY: null or valid and not shared, by this function's contract.
        let plant = unsafe { plant.as_mut() }.ok_or(CallError::Null("plant"))?;
        // SAFETY: null or readable, by this function's contract.
        let answer = unsafe { actuator.as_ref() }.map(|frame| (*frame).into());
        Ok(plant.0.advance(answer.as_ref(), &mut ())?)
    })
}

/// Writes the present state of the plant.
///
/// # Safety
/// `plant` comes from [`painleve_plant_new`] and has not been freed, `snapshot` can be written, and
/// no other thread uses the plant at the same time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_plant_snapshot(
    plant: *const PainlevePlant,
    snapshot: *mut PainleveSnapshot,
) -> PainleveStatus {
    call(|| {
        // SAFETY: null or valid, by this function's contract.
        let plant = unsafe { plant.as_ref() }.ok_or(CallError::Null("plant"))?;
        let now = plant.0.plant().snapshot();
        // SAFETY: writable, by this function's contract.
        unsafe { put(snapshot, "snapshot", now.into()) }
    })
}

/// Frees a plant; does nothing with null.
///
/// # Safety
/// `plant` is null or comes from [`painleve_plant_new`], and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn painleve_plant_free(plant: *mut PainlevePlant) {
    // SAFETY: guaranteed by this function's contract.
    unsafe { take_back(plant) }
}
