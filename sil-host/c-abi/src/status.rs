//! What a call returns, and the message that goes with it.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use painleve_plant::PlantError;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_shared::range::OutOfRange;

/// What a call returns.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PainleveStatus {
    /// Done.
    Ok = 0,
    /// A pointer is null, or a text is not UTF-8.
    InvalidArgument = 1,
    /// The scenario is wrong.
    InvalidScenario = 2,
    /// The plant's motion cannot be continued.
    PlantFailed = 3,
    /// A defect of this library; the object must only be freed.
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

/// The message of the last call of this thread that failed, in one sentence; empty if none has.
/// Valid until the next call of this thread that fails.
#[unsafe(no_mangle)]
pub extern "C" fn painleve_last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|message| message.as_ptr())
}

/// Does the work of a call, keeping its message if it fails.
pub(crate) fn call(work: impl FnOnce() -> Result<(), CallError>) -> PainleveStatus {
    // What a panic leaves half done is behind a pointer that is only freed from then on.
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
/// `text` is null or points to a string that ends with a zero byte.
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

/// Hands an object to the caller.
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
/// `object` is null or was handed out by [`give`] and not taken back since.
pub(crate) unsafe fn take_back<T>(object: *mut T) {
    if !object.is_null() {
        // SAFETY: from `Box::into_raw` in `give`, once, by this function's contract.
        let object = unsafe { Box::from_raw(object) };
        // A panic in a drop would have nobody to be told to.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(object)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{painleve_plant_free, painleve_plant_new};
    use std::ptr;

    fn last_error() -> String {
        // SAFETY: a string of this thread that ends with a zero byte.
        let text = unsafe { CStr::from_ptr(painleve_last_error()) };
        text.to_string_lossy().into_owned()
    }

    #[test]
    fn a_panic_becomes_a_status_with_its_message() {
        assert_eq!(call(|| panic!("lost {}", 3)), PainleveStatus::Panic);
        assert_eq!(last_error(), "panic: lost 3; please report this");
    }

    #[test]
    fn null_and_wrong_texts_are_refused_and_freeing_nothing_is_fine() {
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
        // SAFETY: a C string, and no place for the plant; then nothing to free.
        unsafe {
            let status = painleve_plant_new(c"".as_ptr(), ptr::null_mut());
            assert_eq!(status, PainleveStatus::InvalidArgument);
            painleve_plant_free(ptr::null_mut());
        }
    }
}
