//! Return values of calls, and their error messages.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use painleve_plant::PlantError;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_shared::range::OutOfRange;

/// Return value of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PainleveStatus {
    /// Success.
    Ok = 0,
    /// A pointer is null, or a text is not UTF-8.
    InvalidArgument = 1,
    /// The scenario is invalid.
    InvalidScenario = 2,
    /// The plant's motion cannot be continued.
    PlantFailed = 3,
    /// A bug in this library; the object must only be freed.
    Panic = 4,
}

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CallError {
    #[error("{0} is null")]
    Null(&'static str),
    #[error("{0} is not UTF-8")]
    NotUtf8(&'static str),
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    #[error(transparent)]
    Range(#[from] OutOfRange),
    #[error(transparent)]
    Plant(#[from] PlantError),
}

impl CallError {
    fn status(&self) -> PainleveStatus {
        match self {
            Self::Null(_) | Self::NotUtf8(_) => PainleveStatus::InvalidArgument,
            Self::Scenario(_) | Self::Range(_) => PainleveStatus::InvalidScenario,
            Self::Plant(_) => PainleveStatus::PlantFailed,
        }
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Returns the message of this thread's last failed call, in one sentence; empty if no call has
/// failed. It is valid until this thread's next failed call.
#[unsafe(no_mangle)]
pub extern "C" fn painleve_last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|message| message.as_ptr())
}

/// Runs a call, and keeps its message if it fails.
pub(crate) fn call(work: impl FnOnce() -> Result<(), CallError>) -> PainleveStatus {
    // Values that a panic leaves inconsistent are behind a pointer that may only be freed
    // afterwards.
    let (status, message) = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => return PainleveStatus::Ok,
        Ok(Err(error)) => (error.status(), error.to_string()),
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().map(ToString::to_string);
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
            let text = text.unwrap_or_else(|| "no message".into());
            (
                PainleveStatus::Panic,
                format!("panic: {text}; please report this"),
            )
        }
    };
    let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
    LAST_ERROR.set(message);
    status
}

/// Reads a scenario from a C string.
///
/// # Safety
/// `text` is null or points to a null-terminated string.
pub(crate) unsafe fn scenario(text: *const c_char) -> Result<Scenario, CallError> {
    if text.is_null() {
        return Err(CallError::Null("scenario_toml"));
    }
    // SAFETY: not null, and a C string by this function's contract.
    let text = unsafe { CStr::from_ptr(text) };
    let text = text
        .to_str()
        .map_err(|_| CallError::NotUtf8("scenario_toml"))?;
    Ok(Scenario::from_toml(text)?)
}

/// Passes ownership of an object to the caller.
///
/// # Safety
/// `place` is null or can be written.
pub(crate) unsafe fn give<T>(
    place: *mut *mut T,
    make: impl FnOnce() -> Result<T, CallError>,
) -> Result<(), CallError> {
    if place.is_null() {
        return Err(CallError::Null("the place of the new object"));
    }
    let object = Box::into_raw(Box::new(make()?));
    // SAFETY: not null, and writable by this function's contract.
    unsafe { place.write(object) };
    Ok(())
}

/// Writes a result to the caller's variable.
///
/// # Safety
/// `place` is null or can be written.
pub(crate) unsafe fn put<T>(place: *mut T, name: &'static str, value: T) -> Result<(), CallError> {
    if place.is_null() {
        return Err(CallError::Null(name));
    }
    // SAFETY: not null, and writable by this function's contract.
    unsafe { place.write(value) };
    Ok(())
}

/// Takes an object back and drops it.
///
/// # Safety
/// `object` is null or comes from [`give`] and has not been taken back.
pub(crate) unsafe fn take_back<T>(object: *mut T) {
    if !object.is_null() {
        // SAFETY: from `Box::into_raw` in `give`, once, by this function's contract.
        let object = unsafe { Box::from_raw(object) };
        // A panic in a destructor cannot be reported to a caller.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(object)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{painleve_plant_free, painleve_plant_new};
    use std::ptr;

    fn last_error() -> String {
        // SAFETY: a null-terminated string of this thread.
        let text = unsafe { CStr::from_ptr(painleve_last_error()) };
        text.to_string_lossy().into_owned()
    }

    #[test]
    fn a_panic_becomes_a_status_with_its_message() {
        assert_eq!(call(|| panic!("lost {}", 3)), PainleveStatus::Panic);
        assert_eq!(last_error(), "panic: lost 3; please report this");
    }

    #[test]
    fn null_and_invalid_texts_are_refused_and_null_can_be_freed() {
        let mut plant = ptr::null_mut();
        for (text, status, part) in [
            (
                None,
                PainleveStatus::InvalidArgument,
                "scenario_toml is null",
            ),
            (Some(c"\xff"), PainleveStatus::InvalidArgument, "not UTF-8"),
            (
                Some(c"belt.friction = 99"),
                PainleveStatus::InvalidScenario,
                "belt.friction",
            ),
            (Some(c"belt ="), PainleveStatus::InvalidScenario, "line 1"),
        ] {
            let text = text.map_or(ptr::null(), CStr::as_ptr);
            // SAFETY: null or a C string, and a variable of this function.
            assert_eq!(unsafe { painleve_plant_new(text, &mut plant) }, status);
            assert!(last_error().contains(part), "{}", last_error());
            assert!(plant.is_null());
        }
        // SAFETY: a C string, and a null output pointer; freeing null is allowed.
        unsafe {
            let status = painleve_plant_new(c"".as_ptr(), ptr::null_mut());
            assert_eq!(status, PainleveStatus::InvalidArgument);
            painleve_plant_free(ptr::null_mut());
        }
    }
}
