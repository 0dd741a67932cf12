//! The C functions of FMI 3.0 for co-simulation without event mode.
//!
//! Every call is checked against the state machine of the standard, and each of its arguments. A call that is refused
//! is reported and moves the instance to the state Terminated, as the standard prescribes for `fmi3Error`: its values can
//! still be read, and `fmi3Reset` begins anew. Metadata and access to variables are those of `fmi-export`, whose own C
//! functions check neither state nor arguments, and end the simulator's process where they are not implemented.

// C pointers require unsafe code; every use states why it is sound.
#![allow(unsafe_code)]
// The names of the standard.
#![allow(non_snake_case)]

use std::ffi::{CStr, CString, c_char, c_void};
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::ptr::null_mut;

use fmi::fmi3::binding::{
    fmi3Instance, fmi3IntermediateUpdateCallback, fmi3LogMessageCallback, fmi3Status,
    fmi3Status_fmi3Error, fmi3Status_fmi3OK, fmi3String, fmi3ValueReference, fmi3Version,
};
use fmi_export::fmi3::{BasicContext, Model, ModelGetSet, ModelMetadata};

use crate::{ArmOnBelt, Failure};

/// Value reference of the time.
const TIME: fmi3ValueReference = 0;
/// The value references below this one are parameters.
const FIRST_INPUT: fmi3ValueReference = 7;
/// The value references from this one are outputs.
const FIRST_OUTPUT: fmi3ValueReference = 9;

/// States of the standard's machine that an FMU for co-simulation without event mode can have.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Instantiated,
    InitializationMode,
    StepMode,
    Terminated,
}

use State::{InitializationMode, Instantiated, StepMode, Terminated};

const ANY: &[State] = &[Instantiated, InitializationMode, StepMode, Terminated];
const NONE: &[State] = &[];

/// One instance of the FMU.
struct Instance {
    name: String,
    state: State,
    arm: ArmOnBelt,
    log: Log,
    /// What access to variables requires, without a meaning here.
    context: BasicContext<ArmOnBelt>,
    /// The texts of the last `fmi3GetString`, which stay valid until the next call.
    texts: Vec<CString>,
}

/// The simulator's log.
struct Log {
    environment: *mut c_void,
    callback: fmi3LogMessageCallback,
    is_on: bool,
}

impl Log {
    /// Reports an error: in the simulator's log, or on standard error if that log is off.
    fn error(&self, message: &str) {
        let text = CString::new(message.replace('\0', " ")).unwrap_or_default();
        match self.callback {
            // SAFETY: the simulator's own function with the arguments of the standard.
            Some(callback) if self.is_on => unsafe {
                callback(
                    self.environment,
                    fmi3Status_fmi3Error,
                    c"logStatusError".as_ptr(),
                    text.as_ptr(),
                );
            },
            _ => complain(message),
        }
    }
}

/// Writes a line to standard error. A simulator may have closed it, and `eprintln!` would then end the process.
fn complain(message: &str) {
    let _ = writeln!(std::io::stderr(), "painleve: {message}");
}

/// Does a call's work if the instance is in one of the states.
fn call(
    instance: fmi3Instance,
    name: &str,
    states: &[State],
    work: impl FnOnce(&mut Instance) -> Result<(), Failure>,
) -> fmi3Status {
    // SAFETY: null or from `fmi3InstantiateCoSimulation`, not freed and not shared, by the standard.
    let Some(instance) = (unsafe { instance.cast::<Instance>().as_mut() }) else {
        complain(&format!("{name}: the instance is null"));
        return fmi3Status_fmi3Error;
    };
    let result = if !states.contains(&instance.state) {
        let state = instance.state;
        Err(format!("is not allowed in the state {state:?}").into())
    } else {
        // An instance that a panic has left is Terminated.
        catch_unwind(AssertUnwindSafe(|| work(instance)))
            .unwrap_or_else(|_| Err("has a bug; please report this".into()))
    };
    match result {
        Ok(()) => fmi3Status_fmi3OK,
        Err(cause) => {
            instance.state = Terminated;
            let message = format!("{}: {name}: {cause}", instance.name);
            instance.log.error(&message);
            fmi3Status_fmi3Error
        }
    }
}

/// Borrows an array of the simulator.
///
/// # Safety
/// `pointer` is null or points to `length` readable values.
unsafe fn array<'a, T>(pointer: *const T, length: usize) -> Result<&'a [T], Failure> {
    if length == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() || !pointer.is_aligned() {
        return Err("an array is null or not aligned".into());
    }
    // SAFETY: neither null nor unaligned, and readable by this function's contract.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// Borrows an array of the simulator to write to it.
///
/// # Safety
/// `pointer` is null or points to `length` writable values that nothing else uses.
unsafe fn array_mut<'a, T>(pointer: *mut T, length: usize) -> Result<&'a mut [T], Failure> {
    if length == 0 {
        return Ok(&mut []);
    }
    if pointer.is_null() || !pointer.is_aligned() {
        return Err("an array is null or not aligned".into());
    }
    // SAFETY: neither null nor unaligned, and writable by this function's contract.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}

/// Reads a text of the simulator.
///
/// # Safety
/// `text` is null or a C string.
unsafe fn text<'a>(text: fmi3String, name: &str) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Err(format!("{name} is null").into());
    }
    // SAFETY: not null, and a C string by this function's contract.
    let text = unsafe { CStr::from_ptr(text) }.to_str();
    text.map_err(|_| format!("{name} is not UTF-8").into())
}

/// Writes a result to the simulator's variable, if there is one.
///
/// # Safety
/// `place` is null or can be written.
unsafe fn put<T>(place: *mut T, value: T) {
    if !place.is_null() && place.is_aligned() {
        // SAFETY: writable by this function's contract.
        unsafe { place.write(value) };
    }
}

/// Checks that a scalar variable has one value each.
fn same_length(references: usize, values: usize) -> Result<(), Failure> {
    if references == values {
        return Ok(());
    }
    Err(format!("{references} value references, but {values} values").into())
}

impl Instance {
    /// Makes the outputs those of the present state, if one of these variables is one.
    fn refresh(&mut self, references: &[fmi3ValueReference]) -> Result<(), Failure> {
        let is_output = |reference: &fmi3ValueReference| *reference >= FIRST_OUTPUT;
        if matches!(self.state, Instantiated | InitializationMode)
            && references.iter().any(is_output)
        {
            self.arm.show_start()?;
        }
        Ok(())
    }

    /// Checks that a variable may be set in the present state.
    fn check_settable(&self, reference: fmi3ValueReference) -> Result<(), Failure> {
        let why_not = match reference {
            TIME => "is the time",
            FIRST_OUTPUT.. => "is an output or unknown",
            ..FIRST_INPUT if self.state == StepMode => "is a fixed parameter",
            _ => return Ok(()),
        };
        Err(
            format!("the variable with value reference {reference} {why_not} and cannot be set")
                .into(),
        )
    }
}

fn no_such_variable(reference: fmi3ValueReference) -> Failure {
    format!("there is no variable of this type with value reference {reference}").into()
}

// --- Metadata, which the bundler reads from the library. ---

/// The variables of the FMU.
#[unsafe(no_mangle)]
pub fn model_metadata() -> ModelMetadata {
    ArmOnBelt::build_toplevel_metadata()
}

/// The token of the FMU.
#[unsafe(no_mangle)]
pub static FMI3_INSTANTIATION_TOKEN: &str = ArmOnBelt::INSTANTIATION_TOKEN;

#[unsafe(no_mangle)]
extern "C" fn fmi3SupportsModelExchange() -> bool {
    ArmOnBelt::SUPPORTS_MODEL_EXCHANGE
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SupportsCoSimulation() -> bool {
    ArmOnBelt::SUPPORTS_CO_SIMULATION
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SupportsScheduledExecution() -> bool {
    ArmOnBelt::SUPPORTS_SCHEDULED_EXECUTION
}

// --- Life of an instance. ---

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    fmi3Version.as_ptr().cast()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    instance_name: fmi3String,
    instantiation_token: fmi3String,
    _resource_path: fmi3String,
    _visible: bool,
    logging_on: bool,
    event_mode_used: bool,
    _early_return_allowed: bool,
    _required_intermediate_variables: *const fmi3ValueReference,
    n_required_intermediate_variables: usize,
    instance_environment: *mut c_void,
    log_message: fmi3LogMessageCallback,
    _intermediate_update: fmi3IntermediateUpdateCallback,
) -> fmi3Instance {
    let log = Log {
        environment: instance_environment,
        callback: log_message,
        is_on: logging_on,
    };
    let checked = || {
        // SAFETY: null or C strings, by the standard.
        let (name, token) = unsafe {
            let token = text(instantiation_token, "instantiationToken")?;
            (text(instance_name, "instanceName")?, token)
        };
        if name.trim().is_empty() {
            return Err("instanceName is empty".into());
        }
        if token != ArmOnBelt::INSTANTIATION_TOKEN {
            return Err(format!("instantiationToken '{token}' is that of another FMU").into());
        }
        if event_mode_used {
            return Err("eventModeUsed: this FMU has no event mode".into());
        }
        if n_required_intermediate_variables > 0 {
            return Err("requiredIntermediateVariables: this FMU has none".into());
        }
        Ok(name.to_owned())
    };
    match checked() {
        Ok(name) => Box::into_raw(Box::new(Instance {
            name,
            state: Instantiated,
            arm: ArmOnBelt::at_start(),
            log,
            context: BasicContext::new(false, Box::new(|_, _, _| ()), PathBuf::new(), false, None),
            texts: Vec::new(),
        }))
        .cast(),
        Err::<_, Failure>(cause) => {
            log.error(&format!("fmi3InstantiateCoSimulation: {cause}"));
            null_mut()
        }
    }
}

/// Instantiation for another kind of simulation. Its arguments are not looked at.
fn not_instantiated(name: &str) -> fmi3Instance {
    complain(&format!("{name}: this FMU is for co-simulation only"));
    null_mut()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateModelExchange() -> fmi3Instance {
    not_instantiated("fmi3InstantiateModelExchange")
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateScheduledExecution() -> fmi3Instance {
    not_instantiated("fmi3InstantiateScheduledExecution")
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: fmi3Instance) {
    if !instance.is_null() {
        // SAFETY: from `Box::into_raw` in `fmi3InstantiateCoSimulation`, once, by the standard.
        drop(unsafe { Box::from_raw(instance.cast::<Instance>()) });
    }
}

/// The FMU defines no categories, so that all messages are on or off.
#[unsafe(no_mangle)]
extern "C" fn fmi3SetDebugLogging(
    instance: fmi3Instance,
    logging_on: bool,
    _n_categories: usize,
    _categories: *const fmi3String,
) -> fmi3Status {
    call(instance, "fmi3SetDebugLogging", ANY, |instance| {
        instance.log.is_on = logging_on;
        Ok(())
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi3EnterInitializationMode(
    instance: fmi3Instance,
    tolerance_defined: bool,
    tolerance: f64,
    start_time: f64,
    stop_time_defined: bool,
    stop_time: f64,
) -> fmi3Status {
    const NAME: &str = "fmi3EnterInitializationMode";
    call(instance, NAME, &[Instantiated], |instance| {
        if tolerance_defined && !(tolerance.is_finite() && tolerance > 0.0) {
            return Err(format!("tolerance = {tolerance} is not a positive number").into());
        }
        let stop_time = stop_time_defined.then_some(stop_time);
        instance.arm.set_times(start_time, stop_time)?;
        instance.state = InitializationMode;
        Ok(())
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi3ExitInitializationMode(instance: fmi3Instance) -> fmi3Status {
    const NAME: &str = "fmi3ExitInitializationMode";
    call(instance, NAME, &[InitializationMode], |instance| {
        instance.arm.start()?;
        instance.state = StepMode;
        Ok(())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: fmi3Instance,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_fmu_state_prior_to_current_point: bool,
    event_handling_needed: *mut bool,
    terminate_simulation: *mut bool,
    early_return: *mut bool,
    last_successful_time: *mut f64,
) -> fmi3Status {
    call(instance, "fmi3DoStep", &[StepMode], |instance| {
        let arm = &mut instance.arm;
        let stepped = arm.step(current_communication_point, communication_step_size);
        // SAFETY: null or writable, by the standard.
        unsafe {
            put(event_handling_needed, false);
            put(terminate_simulation, false);
            put(early_return, false);
            put(last_successful_time, arm.now_s());
        }
        stepped
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi3Terminate(instance: fmi3Instance) -> fmi3Status {
    call(instance, "fmi3Terminate", &[StepMode], |instance| {
        instance.state = Terminated;
        Ok(())
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi3Reset(instance: fmi3Instance) -> fmi3Status {
    call(instance, "fmi3Reset", ANY, |instance| {
        instance.arm = ArmOnBelt::at_start();
        instance.state = Instantiated;
        Ok(())
    })
}

// --- Variables. ---

/// Defines the functions that get and set the variables of a type of numbers.
macro_rules! numbers {
    ($($get:ident $set:ident $of_type:ty: $read:ident $write:ident;)*) => { $(
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $get(
            instance: fmi3Instance,
            references: *const fmi3ValueReference,
            n_references: usize,
            values: *mut $of_type,
            n_values: usize,
        ) -> fmi3Status {
            call(instance, stringify!($get), ANY, |instance| {
                // SAFETY: null or arrays of these lengths, by the standard.
                let (references, values) =
                    unsafe { (array(references, n_references)?, array_mut(values, n_values)?) };
                same_length(references.len(), values.len())?;
                instance.refresh(references)?;
                for (&reference, value) in references.iter().zip(values) {
                    let found = match reference.checked_sub(1) {
                        Some(field) => {
                            let value = std::slice::from_mut(value);
                            instance.arm.$read(field, value, &instance.context).is_ok()
                        }
                        None => instance.arm.put_time(value),
                    };
                    if !found {
                        return Err(no_such_variable(reference));
                    }
                }
                Ok(())
            })
        }

        #[unsafe(no_mangle)]
        unsafe extern "C" fn $set(
            instance: fmi3Instance,
            references: *const fmi3ValueReference,
            n_references: usize,
            values: *const $of_type,
            n_values: usize,
        ) -> fmi3Status {
            const STATES: &[State] = &[Instantiated, InitializationMode, StepMode];
            call(instance, stringify!($set), STATES, |instance| {
                // SAFETY: null or arrays of these lengths, by the standard.
                let (references, values) =
                    unsafe { (array(references, n_references)?, array(values, n_values)?) };
                same_length(references.len(), values.len())?;
                for &reference in references {
                    instance.check_settable(reference)?;
                    // Only a variable of this type can be read as one.
                    let mut present = [Default::default()];
                    instance
                        .arm
                        .$read(reference - 1, &mut present, &instance.context)
                        .map_err(|_| no_such_variable(reference))?;
                }
                for (&reference, value) in references.iter().zip(values) {
                    let value = std::slice::from_ref(value);
                    instance
                        .arm
                        .$write(reference - 1, value, &instance.context)
                        .map_err(|_| no_such_variable(reference))?;
                }
                Ok(())
            })
        }
    )* };
}

numbers! {
    fmi3GetFloat32 fmi3SetFloat32 f32: get_float32 set_float32;
    fmi3GetFloat64 fmi3SetFloat64 f64: get_float64 set_float64;
    fmi3GetInt8 fmi3SetInt8 i8: get_int8 set_int8;
    fmi3GetUInt8 fmi3SetUInt8 u8: get_uint8 set_uint8;
    fmi3GetInt16 fmi3SetInt16 i16: get_int16 set_int16;
    fmi3GetUInt16 fmi3SetUInt16 u16: get_uint16 set_uint16;
    fmi3GetInt32 fmi3SetInt32 i32: get_int32 set_int32;
    fmi3GetUInt32 fmi3SetUInt32 u32: get_uint32 set_uint32;
    fmi3GetInt64 fmi3SetInt64 i64: get_int64 set_int64;
    fmi3GetUInt64 fmi3SetUInt64 u64: get_uint64 set_uint64;
    fmi3GetBoolean fmi3SetBoolean bool: get_boolean set_boolean;
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetString(
    instance: fmi3Instance,
    references: *const fmi3ValueReference,
    n_references: usize,
    values: *mut fmi3String,
    n_values: usize,
) -> fmi3Status {
    call(instance, "fmi3GetString", ANY, |instance| {
        // SAFETY: null or arrays of these lengths, by the standard.
        let (references, values) = unsafe {
            (
                array(references, n_references)?,
                array_mut(values, n_values)?,
            )
        };
        same_length(references.len(), values.len())?;
        let mut texts = vec![CString::default(); references.len()];
        for (&reference, text) in references.iter().zip(&mut texts) {
            let text = std::slice::from_mut(text);
            reference
                .checked_sub(1)
                .and_then(|field| instance.arm.get_string(field, text, &instance.context).ok())
                .ok_or_else(|| no_such_variable(reference))?;
        }
        instance.texts = texts;
        for (text, value) in instance.texts.iter().zip(values) {
            *value = text.as_ptr();
        }
        Ok(())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetString(
    instance: fmi3Instance,
    references: *const fmi3ValueReference,
    n_references: usize,
    values: *const fmi3String,
    n_values: usize,
) -> fmi3Status {
    const STATES: &[State] = &[Instantiated, InitializationMode, StepMode];
    call(instance, "fmi3SetString", STATES, |instance| {
        // SAFETY: null or arrays of these lengths, by the standard.
        let (references, values) =
            unsafe { (array(references, n_references)?, array(values, n_values)?) };
        same_length(references.len(), values.len())?;
        let mut texts = Vec::new();
        for (&reference, &value) in references.iter().zip(values) {
            instance.check_settable(reference)?;
            let mut present = [CString::default()];
            instance
                .arm
                .get_string(reference - 1, &mut present, &instance.context)
                .map_err(|_| no_such_variable(reference))?;
            // SAFETY: null or a C string, by the standard.
            texts.push(CString::new(unsafe { text(value, "a text") }?)?);
        }
        for (&reference, value) in references.iter().zip(texts) {
            instance
                .arm
                .set_string(reference - 1, &[value], &instance.context)
                .map_err(|_| no_such_variable(reference))?;
        }
        Ok(())
    })
}

// --- What this FMU cannot do, as its description says. ---

/// Defines functions that are refused in every state. They do not look at their further arguments, which the caller
/// removes in C's calling convention.
macro_rules! refused {
    ($($name:ident)*) => { $(
        #[unsafe(no_mangle)]
        extern "C" fn $name(instance: fmi3Instance) -> fmi3Status {
            call(instance, stringify!($name), NONE, |_| Ok(()))
        }
    )* };
}

refused! {
    fmi3EnterConfigurationMode fmi3ExitConfigurationMode
    fmi3EnterEventMode fmi3EnterStepMode fmi3EvaluateDiscreteStates fmi3UpdateDiscreteStates
    fmi3GetBinary fmi3SetBinary fmi3GetClock fmi3SetClock
    fmi3GetIntervalDecimal fmi3SetIntervalDecimal fmi3GetIntervalFraction fmi3SetIntervalFraction
    fmi3GetShiftDecimal fmi3SetShiftDecimal fmi3GetShiftFraction fmi3SetShiftFraction
    fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState
    fmi3SerializedFMUStateSize fmi3SerializeFMUState fmi3DeserializeFMUState
    fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies
    fmi3GetDirectionalDerivative fmi3GetAdjointDerivative fmi3GetOutputDerivatives
    fmi3EnterContinuousTimeMode fmi3CompletedIntegratorStep fmi3SetTime
    fmi3SetContinuousStates fmi3GetContinuousStates fmi3GetContinuousStateDerivatives
    fmi3GetNumberOfContinuousStates fmi3GetNominalsOfContinuousStates
    fmi3GetNumberOfEventIndicators fmi3GetEventIndicators fmi3ActivateModelPartition
}
