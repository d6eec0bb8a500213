//! Arguments that come from C, and errors that go there.

use grain_pool::PoolError;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a function failed.
#[derive(Clone, Debug)]
pub(crate) struct Failure {
    pub(crate) code: i32,
    pub(crate) text: String,
}

/// Codes of the header.
pub(crate) const DONE: i32 = 0;
pub(crate) const REFUSED: i32 = 1;
pub(crate) const WORKERS_LOST: i32 = 2;
pub(crate) const BAD_INPUT: i32 = 3;
pub(crate) const DEFECT: i32 = 4;

impl Failure {
    /// Arguments that a function cannot use.
    pub(crate) fn input(text: impl ToString) -> Self {
        Self { code: BAD_INPUT, text: text.to_string() }
    }
}

impl From<PoolError> for Failure {
    fn from(error: PoolError) -> Self {
        let code = match &error {
            PoolError::Refused { .. } => REFUSED,
            PoolError::WorkersLost(_) | PoolError::Channel(_) | PoolError::NoProgram(_) | PoolError::Start { .. } => {
                WORKERS_LOST
            }
            _ => BAD_INPUT,
        };
        Self { code, text: error.to_string() }
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// The text of the last failure in this thread; empty if there was none.
pub(crate) fn last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|text| text.as_ptr())
}

/// Runs a function, keeps the text of its failure, and returns its code.
pub(crate) fn guarded(work: impl FnOnce() -> Result<(), Failure>) -> i32 {
    let ended = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        Err(Failure { code: DEFECT, text: "a defect of this library: see standard error".to_owned() })
    });
    let Err(failure) = ended else { return DONE };
    let text = CString::new(failure.text.replace('\0', " ")).unwrap_or_default();
    LAST_ERROR.set(text);
    failure.code
}

/// A text from C.
///
/// # Safety
/// `pointer` is null or a C string that is valid during the call.
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub(crate) unsafe fn text(pointer: *const c_char, name: &str) -> Result<String, Failure> {
    if pointer.is_null() {
        return Err(Failure::input(format!("`{name}` is a null pointer")));
    }
    // SAFETY: as promised by the caller.
    let text = unsafe { CStr::from_ptr(pointer) }.to_str();
    Ok(text.map_err(|_| Failure::input(format!("`{name}` is not UTF-8")))?.to_owned())
}

/// An array from C.
///
/// # Safety
/// `pointer` is null or points to `length` values that are valid during the call.
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub(crate) unsafe fn slice<'a, T>(pointer: *const T, length: usize, name: &str) -> Result<&'a [T], Failure> {
    if length == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(Failure::input(format!("`{name}` is a null pointer")));
    }
    // SAFETY: as promised by the caller.
    Ok(unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// An array that C wants filled; `None` for a null pointer.
///
/// # Safety
/// `pointer` is null or points to `length` values that nobody else uses during the call.
#[expect(unsafe_code, reason = "the boundary to C: see the crate's documentation")]
pub(crate) unsafe fn slice_mut<'a, T>(pointer: *mut T, length: usize) -> Option<&'a mut [T]> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: as promised by the caller.
    Some(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}
