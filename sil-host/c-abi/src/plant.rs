//! The simulated arm on its belt, as measured by encoders and force cell and driven by torque
//! stages.

use std::ffi::c_char;

use painleve_plant::Plant;
use painleve_plant::mechanics::BuiltInPlant;
use painleve_plant::simulation::Simulation;

use crate::frames::{PainleveActuatorFrame, PainleveSensorFrame, PainleveSnapshot};
use crate::status::{
    CallError, PainleveStatus, borrow, borrow_mut, call, give, scenario, take_back, usable,
};

/// A plant with its converters.
pub struct PainlevePlant {
    simulation: Simulation,
    /// Whether this tick has been sampled.
    is_sampled: bool,
}

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
        let make = || {
            let mut plant = BuiltInPlant::new(&scenario)?;
            // Until it first advances, a plant only guesses the mode of a tip on the belt.
            plant.advance(0.0, &mut ())?;
            Ok(PainlevePlant {
                simulation: Simulation::of(plant, &scenario)?,
                is_sampled: false,
            })
        };
        // SAFETY: guaranteed by this function's contract.
        unsafe { give(plant, make) }
    })
}

/// Reads the sensors at this tick, once per tick and before [`painleve_plant_advance`]; another order is refused. Sets
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
        let plant = unsafe { borrow_mut(plant, "plant") }?;
        usable(sensor, "sensor")?;
        usable(is_lost, "is_lost")?;
        if plant.is_sampled {
            return Err(CallError::WrongOrder(
                "this tick has been sampled: advance the plant first",
            ));
        }
        let frame = plant.simulation.sample(&mut ())?;
        plant.is_sampled = true;
        // SAFETY: both are writable, by this function's contract.
        unsafe {
            sensor.write(frame.into());
            is_lost.write(plant.simulation.sensor_frame_is_lost());
        }
        Ok(())
    })
}

/// Accepts the answer to this tick's sample, or null if there is none, and advances to the next
/// tick. An answer to another tick, or with an unknown state or fault, is refused.
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
        let plant = unsafe { borrow_mut(plant, "plant") }?;
        let answer = if actuator.is_null() {
            None
        } else {
            // SAFETY: readable, by this function's contract.
            Some((*unsafe { borrow(actuator, "actuator") }?).into())
        };
        if !plant.is_sampled {
            return Err(CallError::WrongOrder(
                "this tick has not been sampled: sample it before the plant advances",
            ));
        }
        if let Some(answer) = &answer {
            plant.simulation.check_answer(answer)?;
        }
        plant.is_sampled = false;
        Ok(plant.simulation.advance(answer.as_ref(), &mut ())?)
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
        let plant = unsafe { borrow(plant, "plant") }?;
        usable(snapshot, "snapshot")?;
        let now = plant.simulation.plant().snapshot();
        // SAFETY: writable, by this function's contract.
        unsafe { snapshot.write(now.into()) };
        Ok(())
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
