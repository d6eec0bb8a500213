//! What cannot be tested for want of an engine or a compiler.

/// Says that something is left out of the tests, and why. `engine` is its name in `GRAINSPAN_REQUIRE_ENGINES`, a list with commas between;
/// what is listed there may not be missing, and fails the test.
pub fn skip(engine: &str, what: &str, reason: &str) {
    let required = std::env::var("GRAINSPAN_REQUIRE_ENGINES").unwrap_or_default();
    assert!(!required.split(',').any(|name| name == engine), "{what} is required: {reason}");
    eprintln!("SKIPPED: {what}: {reason}");
}
