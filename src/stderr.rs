//! Lines for people on standard error.

use std::fmt::Display;
use std::io::Write;

/// Writes a line to standard error. Whether anybody reads it changes nothing: a reader that has seen enough (`2>&1 | head`) ends no run.
pub fn tell(line: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}
