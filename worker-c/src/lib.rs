//! The worker side for engines in C: [`grainspan_serve`] runs the same worker loop as the built-in engine, behind a
//! table of C functions. The header is `adapters/c/grainspan_worker.h`; the types in its module `table` mirror it.
//!
//! # Why `unsafe` is allowed here, and what makes it sound
//!
//! Calling C cannot be checked by the compiler. The crate does nothing else, and keeps to these rules: the table is
//! copied once and checked to be complete, so no function pointer is null; an RVE pointer comes from `create`, goes only
//! to functions of the same table, from one thread at a time, and is given to `release` exactly once, when its owner is
//! dropped; every buffer is ours, of the size that is passed along, and outlives the call; what C wrote is read as bytes
//! or plain numbers and checked for finiteness by the worker loop before it travels. What remains with the author of the
//! C functions is that they do what the header says.

mod engine;
mod table;

pub use table::{Answer, Cell, EngineTable, TrialOptions};

use engine::ForeignEngine;
use protocol::RveEngine;
use protocol::transport::shared_memory::SharedMemoryWorkerPort;
use rve_server::server::{ExitReason, ServeOptions, serve};
use std::ffi::{CStr, c_char, c_int};
use std::io::Write;
use std::time::Duration;

/// How long a worker waits for its run to appear.
const JOIN_TIMEOUT: Duration = Duration::from_secs(5);

const DONE: c_int = 0;
const REFUSED: c_int = 2;
const RUN_LOST: c_int = 3;

/// See the header.
///
/// # Safety
/// `run` is a C string or null, `engine` a table as the header describes it or null; both are valid during the call.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the module documentation")]
pub unsafe extern "C" fn grainspan_serve(run: *const c_char, engine: *const EngineTable) -> c_int {
    // SAFETY: as promised by the caller.
    let (Some(engine), Some(run)) = (unsafe { ForeignEngine::read(engine) }, unsafe { text(run) }) else {
        return complain("a function of the engine or its name is missing");
    };
    if let Some(defect) = engine.defect() {
        return complain(&defect);
    }
    served(&run, engine)
}

fn served(run: &str, mut engine: ForeignEngine) -> c_int {
    let mut port = match SharedMemoryWorkerPort::join(run, JOIN_TIMEOUT) {
        Ok(port) => port,
        Err(error) => return complain(&error.to_string()),
    };
    let outcome = serve(&mut engine, &mut port, &ServeOptions::new(run));
    drop(port);
    match outcome {
        Ok(ExitReason::MacroLost(reason)) => {
            complain(&format!("the run has ended: {reason}"));
            RUN_LOST
        }
        Ok(_) => DONE,
        Err(error) => complain(&error.to_string()),
    }
}

/// See the header.
///
/// # Safety
/// `engine` is a table as the header describes it or null, valid during the call.
#[unsafe(no_mangle)]
#[expect(unsafe_code, reason = "the boundary to C: see the module documentation")]
pub unsafe extern "C" fn grainspan_print_capabilities(engine: *const EngineTable) -> c_int {
    // SAFETY: as promised by the caller.
    let Some(engine) = (unsafe { ForeignEngine::read(engine) }) else {
        return complain("a function of the engine or its name is missing");
    };
    if let Some(defect) = engine.defect() {
        return complain(&defect);
    }
    let text = serde_json::to_string(&engine.capabilities()).expect("capabilities have no unserialisable parts");
    match writeln!(std::io::stdout(), "{text}") {
        Ok(()) => DONE,
        Err(error) => complain(&error.to_string()),
    }
}

fn complain(reason: &str) -> c_int {
    // Nobody is left to tell when standard error is closed.
    let _ = writeln!(std::io::stderr(), "error: {reason}");
    REFUSED
}

/// # Safety
/// `pointer` is null or a C string that is valid during the call.
#[expect(unsafe_code, reason = "the boundary to C: see the module documentation")]
unsafe fn text(pointer: *const c_char) -> Option<String> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: as promised by the caller.
    Some(unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned())
}
