//! Return values of calls, and their error messages.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use painleve_plant::PlantError;
use painleve_plant::scenario::{Scenario, ScenarioError};
use painleve_plant::simulation::AnswerError;
use painleve_shared::range::OutOfRange;

/// Return value of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PainleveStatus {
    /// Success.
    Ok = 0,
    /// A pointer is null or not aligned, a text is not UTF-8, or an answer is to another tick or unknown.
    InvalidArgument = 1,
    /// The scenario is invalid.
    InvalidScenario = 2,
    /// The plant's motion cannot be continued.
    PlantFailed = 3,
    /// A bug in this library; the object must only be freed.
    Panic = 4,
    /// Sample and advance do not alternate; the plant is unchanged.
    WrongOrder = 5,
}

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CallError {
    #[error("{0} is null")]
    Null(&'static str),
    #[error("{0} is not aligned")]
    NotAligned(&'static str),
    #[error("{0} is not UTF-8")]
    NotUtf8(&'static str),
    #[error("{0}")]
    WrongOrder(&'static str),
    #[error(transparent)]
    Answer(#[from] AnswerError),
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
            Self::Null(_) | Self::NotAligned(_) | Self::NotUtf8(_) | Self::Answer(_) => {
                PainleveStatus::InvalidArgument
            }
            Self::WrongOrder(_) => PainleveStatus::WrongOrder,
            Self::Scenario(_) | Self::Range(_) => PainleveStatus::InvalidScenario,
            Self::Plant(_) => PainleveStatus::PlantFailed,
        }
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Returns the message of this thread's last failed call, in one sentence; empty if no call has
/// failed. It is valid until this thread's next failed call: call this function in a statement of its
/// own, because C evaluates the arguments of a call in any order.
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

/// Checks that a pointer of the caller may be used.
pub(crate) fn usable<T>(pointer: *const T, name: &'static str) -> Result<(), CallError> {
    if pointer.is_null() {
        Err(CallError::Null(name))
    } else if !pointer.is_aligned() {
        Err(CallError::NotAligned(name))
    } else {
        Ok(())
    }
}

/// Borrows what a pointer of the caller points to.
///
/// # Safety
/// `pointer` is null, or can be read for `'a`.
pub(crate) unsafe fn borrow<'a, T>(
    pointer: *const T,
    name: &'static str,
) -> Result<&'a T, CallError> {
    usable(pointer, name)?;
    // SAFETY: usable, and readable by this function's contract.
    Ok(unsafe { &*pointer })
}

/// Borrows an object of the caller to change it.
///
/// # Safety
/// `pointer` is null, or comes from [`give`], has not been taken back, and is not shared for `'a`.
pub(crate) unsafe fn borrow_mut<'a, T>(
    pointer: *mut T,
    name: &'static str,
) -> Result<&'a mut T, CallError> {
    usable(pointer, name)?;
    // SAFETY: usable, and valid and not shared by this function's contract.
    Ok(unsafe { &mut *pointer })
}

/// Passes ownership of an object to the caller.
///
/// # Safety
/// `place` is null or can be written.
pub(crate) unsafe fn give<T>(
    place: *mut *mut T,
    make: impl FnOnce() -> Result<T, CallError>,
) -> Result<(), CallError> {
    usable(place, "the place of the new object")?;
    let object = Box::into_raw(Box::new(make()?));
    // SAFETY: usable, and writable by this function's contract.
    unsafe { place.write(object) };
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

    #[test]
    fn a_panic_becomes_a_status_with_its_message() {
        assert_eq!(call(|| panic!("lost {}", 3)), PainleveStatus::Panic);
        // SAFETY: a null-terminated string of this thread.
        let message = unsafe { CStr::from_ptr(painleve_last_error()) };
        assert_eq!(message.to_str(), Ok("panic: lost 3; please report this"));
    }
}
